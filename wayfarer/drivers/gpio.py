"""What parts at GPIO pins have in common: they claim pins, and make driver errors of those of the pins."""

from __future__ import annotations

import gc
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Annotated, Any

from annotated_types import Interval

from wayfarer.drivers.buses import InputPin, OutputPin, Pins
from wayfarer.errors import NotInstalled, NotResponding, how_to_install, one_line

# What helps, by what lgpio or gpiozero says; the last one if it says nothing of that.
_REMEDIES = {
    "pin factory": "sudo apt install python3-lgpio, and a venv with --system-site-packages",
    "busy": "end the program that holds a pin (gpioinfo shows it), or correct the pins in the rover file",
    "in use": "give each pin to one part in the rover file",
    "can not open": "add the user to group gpio and log in again: sudo usermod -aG gpio $USER",
    "permission": "add the user to group gpio and log in again: sudo usermod -aG gpio $USER",
    "": "does another program hold one, is the user in group gpio, is python3-lgpio installed?",
}

Pin = Annotated[int, Interval(ge=0, le=27)]  # GPIO numbers of the 40-pin header, not positions on it


class GpioPart(ABC):
    """A part at GPIO pins: ``open`` claims them, ``close`` releases them.

    ``_make`` of a driver claims its pins with ``_output`` and ``_input``, and gives ``_devices``. Every other use of
    the pins raises ``NotResponding`` if they are not open or failed.
    """

    def __init__(self, name: str, pins: Pins) -> None:
        self.name = name
        self._pins = pins
        self._devices: Mapping[Any, Any] = {}
        self._claimed: list[OutputPin | InputPin] = []

    async def open(self) -> None:
        """Claim the pins.

        Raises:
            NotResponding: gpiozero is missing, or it cannot claim the pins.
        """
        await self.close()
        try:
            self._devices = self._claim()
        except NotResponding:
            await self.close()  # the pins that it did claim
            raise

    async def close(self) -> None:
        """Release the pins."""
        claimed, self._claimed, self._devices = self._claimed, [], {}
        with _uncollected():
            for pin in claimed:
                with suppress(Exception):
                    pin.close()

    @abstractmethod
    def _make(self) -> Mapping[Any, Any]:
        """Claim the pins of this part."""

    def _output(self, pin: int, *, pwm_hz: float | None = None, active_high: bool = True) -> OutputPin:
        """Claim a pin that this part drives."""
        self._claimed.append(output := self._pins.output(pin, pwm_hz=pwm_hz, active_high=active_high))
        return output

    def _input(self, pin: int, *, pull_up: bool) -> InputPin:
        """Claim a pin that this part reads."""
        self._claimed.append(read := self._pins.input(pin, pull_up=pull_up))
        return read

    def _claim(self) -> Mapping[Any, Any]:
        try:
            with _uncollected():
                return self._make()
        except ModuleNotFoundError as error:
            raise NotInstalled(self.name, error, {"gpiozero": how_to_install("pi")}) from None
        except Exception as error:  # lgpio's own error, for one, is a bare Exception
            reason = one_line(error)
            remedy = next((text for said, text in _REMEDIES.items() if said in reason.casefold()), _REMEDIES[""])
        # Raised here, not in the handler: a traceback kept by a caller would also keep the claimed pins alive.
        raise NotResponding(f"{self.name}: cannot have these pins: {reason}", remedy)

    @contextmanager
    def _using(self) -> Iterator[Mapping[Any, Any]]:
        """Give the devices; every error of the pins while they are used becomes ``NotResponding``."""
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
    """Prevent garbage collection while pins are claimed or released.

    gpiozero holds a lock meanwhile. A device that was not closed is closed when it is collected, and waits for that
    lock; it waits for ever if it is collected in the same thread.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
