"""GPIO pins through gpiozero: claims pins, and converts gpiozero's errors to driver errors.

gpiozero is imported when the first pin is claimed. Its pin library (lgpio) comes from the distribution.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Annotated, Any, TypeVar

from annotated_types import Interval

from wayfarer.errors import NotResponding

T = TypeVar("T")

Pin = Annotated[int, Interval(ge=0, le=27)]  # GPIO numbers of the 40-pin header, not positions on it


def claim(name: str, make: Callable[[Any], T]) -> T:
    """Return what ``make`` builds on GPIO pins; it is given the module gpiozero.

    Raises:
        NotResponding: gpiozero is missing, or it cannot have the pins.
    """
    try:
        gpiozero = import_module("gpiozero")
    except ImportError:
        raise NotResponding(f"{name}: gpiozero is not installed; pip install '.[pi]' in wayfarer's checkout") from None
    try:
        with warnings.catch_warnings():
            # Two lines for each pin library that is not there; where none is, the error below says so in one.
            for expected in (gpiozero.PinFactoryFallback, gpiozero.NativePinFactoryFallback):
                warnings.simplefilter("ignore", expected)
            return make(gpiozero)
    except Exception as error:  # lgpio's own error, for one, is a bare Exception
        reason = " ".join(str(error).split())
    # Raised here, not in the handler: a traceback kept by a caller would keep the pins that were claimed before.
    raise NotResponding(
        f"{name}: cannot have these pins: {reason}; does another program hold one, is the user in group gpio, "
        "is python3-lgpio installed?"
    )


@contextmanager
def named(name: str) -> Iterator[None]:
    """Turn whatever pins raise while they are used into ``NotResponding`` of that name."""
    try:
        yield
    except Exception as error:
        reason = " ".join(str(error).split())
        raise NotResponding(f"{name}: the pins failed: {reason}; has another program taken them?") from None


def release(devices: Iterable[Any]) -> None:
    """Close each device, whatever becomes of the others."""
    for device in devices:
        with suppress(Exception):
            device.close()
