"""A status light at the GPIO pins: one LED, one of three colours, or a buzzer.

Each pin is on or off, with nothing between: eight colours are enough at ten metres, and a buzzer is only on or off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from wayfarer.drivers.buses import Buses, OutputPin
from wayfarer.drivers.gpio import GpioPart, Pin
from wayfarer.hal import Colour


@dataclass(frozen=True, slots=True)
class GpioLightSettings:
    """The pin of each colour; None if there is none. A buzzer is a light with one colour."""

    red: Pin | None = None
    """GPIO number of the red light."""
    green: Pin | None = None
    """GPIO number of the green light."""
    blue: Pin | None = None
    """GPIO number of the blue light."""
    active_high: bool = True
    """A pin is high while its colour shines. False for LEDs with a common anode."""

    def __post_init__(self) -> None:
        if not self.pins:
            raise ValueError("a light needs the pin of at least one colour: red, green or blue")

    @property
    def pins(self) -> dict[str, int]:
        """The colours that have a pin."""
        pins = {"red": self.red, "green": self.green, "blue": self.blue}
        return {colour: pin for colour, pin in pins.items() if pin is not None}


class GpioLight(GpioPart):
    """The pins as a ``hal.StatusLight``; all are dark once claimed."""

    part: ClassVar[str] = "light"
    Settings = GpioLightSettings

    def __init__(self, settings: GpioLightSettings, buses: Buses) -> None:
        super().__init__(f"light on GPIO {', '.join(map(str, settings.pins.values()))}", buses.pins())
        self._settings = settings

    async def show(self, colour: Colour) -> None:
        """Show a colour until the next call. If this light has no pin for it, all pins are lit: it is never dark."""
        with self._using() as lamps:
            lit = {part for part in lamps if getattr(colour, part) > 0.0}
            if not lit and any(colour):
                lit = set(lamps)
            for part, lamp in lamps.items():
                lamp.value = part in lit

    def _make(self) -> dict[str, OutputPin]:
        high = self._settings.active_high
        return {part: self._output(pin, active_high=high) for part, pin in self._settings.pins.items()}
