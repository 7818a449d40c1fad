"""A status light at the GPIO pins, through gpiozero: one LED, one of three colours, or a buzzer.

Each pin is on or off, nothing between: eight colours are enough for ten metres, and a buzzer has no other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from wayfarer.drivers.buses import Buses
from wayfarer.drivers.gpio import Pin, claim, named, release
from wayfarer.errors import NotResponding
from wayfarer.hal import Colour


@dataclass(frozen=True, slots=True)
class GpioLightSettings:
    """The pin of each colour, by GPIO number; None where there is none. A buzzer is a light with one colour.

    active_high: the pin is high while its colour shines. False for LEDs with a common anode.
    """

    red: Pin | None = None
    green: Pin | None = None
    blue: Pin | None = None
    active_high: bool = True

    def __post_init__(self) -> None:
        """Refuse a light without a pin.

        Raises:
            ValueError: no colour has a pin.
        """
        if not self.pins:
            raise ValueError("a light needs the pin of at least one colour: red, green or blue")

    @property
    def pins(self) -> dict[str, int]:
        """The colours that have a pin."""
        pins = {"red": self.red, "green": self.green, "blue": self.blue}
        return {colour: pin for colour, pin in pins.items() if pin is not None}


class GpioLight:
    """The pins as a ``hal.StatusLight``."""

    part: ClassVar[str] = "light"
    Settings = GpioLightSettings

    def __init__(self, settings: GpioLightSettings, _buses: Buses) -> None:
        self.name = f"light on GPIO {', '.join(map(str, settings.pins.values()))}"
        self._settings = settings
        self._lamps: dict[str, Any] = {}

    async def open(self) -> None:
        """Claim the pins, all dark.

        Raises:
            NotResponding: gpiozero is missing, or it cannot have the pins.
        """
        await self.close()
        self._lamps = claim(self.name, self._make)

    async def close(self) -> None:
        """Let go of the pins."""
        lamps, self._lamps = self._lamps, {}
        release(lamps.values())

    async def show(self, colour: Colour) -> None:
        """Show a colour until told otherwise. One that this light does not have is shown by all it has: never dark.

        Raises:
            NotResponding: the pins are not open or failed.
        """
        if not self._lamps:
            raise NotResponding(f"{self.name}: not open")
        lit = {part for part in self._lamps if getattr(colour, part) > 0.0}
        if not lit and any(colour):
            lit = set(self._lamps)
        with named(self.name):
            for part, lamp in self._lamps.items():
                lamp.value = part in lit

    def _make(self, gpiozero: Any) -> dict[str, Any]:
        pins, high = self._settings.pins, self._settings.active_high
        return {part: gpiozero.DigitalOutputDevice(pin, active_high=high) for part, pin in pins.items()}
