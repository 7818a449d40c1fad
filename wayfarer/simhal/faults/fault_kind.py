"""What a kind of fault is: parameters, where it fits, what it does; and the changes that most of them consist of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from random import Random
from typing import Any, ClassVar

SENSES = ("compass", "motion", "contact", "wheels", "position")
PARTS = (*SENSES, "motors")


@dataclass(frozen=True)
class FaultKind(ABC):
    """A kind of fault: each concrete class is one; its fields are the parameters, each with a range and a default.

    Its docstring is its row in ``docs/reference/faults.md``. ``targets`` says to what it can happen: parts, the
    ``world`` or the ``process``. ``typical`` are the parameters of ``--fault`` if the defaults change nothing.
    """

    targets: ClassVar[tuple[str, ...]]
    typical: ClassVar[Mapping[str, float]] = {}

    @abstractmethod
    def effect(self, target: Any, rng: Random) -> AbstractContextManager[None]:
        """Return what makes the fault happen while it is entered.

        It needs no ``finally``: only the injector enters and leaves it, and never leaves it by an error.

        Args:
            target: the world, a ``FaultyPart``, a ``WiredPart``, or what takes the computer's flags: by base class.
            rng: the fault's own chance.
        """


@contextmanager
def listed(items: list[Any], item: Any) -> Iterator[None]:
    """Add an item to a list."""
    items.append(item)
    yield
    items.remove(item)


@contextmanager
def changed(thing: Any, **values: Any) -> Iterator[None]:
    """Give attributes other values."""
    before = {name: getattr(thing, name) for name in values}
    _set(thing, values)
    yield
    _set(thing, before)


def _set(thing: Any, values: dict[str, Any]) -> None:
    for name, value in values.items():
        setattr(thing, name, value)


@contextmanager
def added(thing: Any, **amounts: float) -> Iterator[None]:
    """Add to attributes; several such changes may overlap."""
    _set(thing, {name: getattr(thing, name) + amount for name, amount in amounts.items()})
    yield
    _set(thing, {name: getattr(thing, name) - amount for name, amount in amounts.items()})
