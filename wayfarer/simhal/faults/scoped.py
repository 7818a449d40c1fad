"""Changes that last as long as a ``with`` block: what most faults consist of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from random import Random
from typing import Any

# What makes a fault happen to its target (world, part, wired part or process), with its parameters and its own chance.
Effect = Callable[[Any, Any, Random], AbstractContextManager[None]]


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
