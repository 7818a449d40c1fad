"""GPIO pins through gpiozero: claims pins, and converts gpiozero's errors to driver errors.

gpiozero is imported when the first pin is claimed. Its pin library (lgpio) comes from the distribution.
"""

from __future__ import annotations

import gc
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Annotated, Any

from annotated_types import Interval

from wayfarer.errors import NotResponding, one_line

Pin = Annotated[int, Interval(ge=0, le=27)]  # GPIO numbers of the 40-pin header, not positions on it


class GpioPart(ABC):
    """A part at GPIO pins: ``open`` claims them, ``close`` lets go of them. Each driver says in ``_make`` what for.

    What else a driver does with its pins raises ``NotResponding`` where they are not open or failed.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._devices: Mapping[Any, Any] = {}

    async def open(self) -> None:
        """Claim the pins.

        Raises:
            NotResponding: gpiozero is missing, or it cannot have the pins.
        """
        await self.close()
        self._devices = self._claim()

    async def close(self) -> None:
        """Let go of the pins."""
        devices, self._devices = self._devices, {}
        with _uncollected():
            for device in devices.values():
                with suppress(Exception):
                    device.close()

    @abstractmethod
    def _make(self, gpiozero: Any) -> Mapping[Any, Any]:
        """Return the devices of the module gpiozero on this part's pins."""

    def _claim(self) -> Mapping[Any, Any]:
        try:
            gpiozero = import_module("gpiozero")
        except ImportError:
            raise NotResponding(
                f"{self.name}: gpiozero is not installed; pip install '.[pi]' in wayfarer's checkout"
            ) from None
        try:
            with _uncollected(), warnings.catch_warnings():
                # Two lines for each pin library that is not there; where none is, the error below says so in one.
                for expected in (gpiozero.PinFactoryFallback, gpiozero.NativePinFactoryFallback):
                    warnings.simplefilter("ignore", expected)
                return self._make(gpiozero)
        except Exception as error:  # lgpio's own error, for one, is a bare Exception
            reason = one_line(error)
        # Raised here, not in the handler: a traceback kept by a caller would keep the pins that were claimed before.
        raise NotResponding(
            f"{self.name}: cannot have these pins: {reason}; does another program hold one, is the user in group gpio, "
            "is python3-lgpio installed?"
        )

    @contextmanager
    def _using(self) -> Iterator[Mapping[Any, Any]]:
        """Give the devices; turn whatever pins raise while they are used into ``NotResponding``."""
        if not self._devices:
            raise NotResponding(f"{self.name}: not open")
        try:
            yield self._devices
        except Exception as error:
            raise NotResponding(
                f"{self.name}: the pins failed: {one_line(error)}; has another program taken them?"
            ) from None


@contextmanager
def _uncollected() -> Iterator[None]:
    """Let nothing be garbage collected while pins are claimed or released.

    gpiozero holds a lock meanwhile. A device that nobody has closed is closed when it is collected, and waits for that
    lock: for ever, where it is collected in the same thread.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
