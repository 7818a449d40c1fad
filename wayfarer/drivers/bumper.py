"""Bumper switches at the GPIO pins: one switch for each side of the body.

A switch that closes and opens again between two reads is not missed: the pin's own event is remembered until the next
read. A switch whose wire is broken looks like one that nothing touches; this driver cannot detect that.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from wayfarer.drivers.buses import Buses, InputPin
from wayfarer.drivers.gpio import GpioPart, Pin
from wayfarer.hal import ContactReading, Side


@dataclass(frozen=True, slots=True)
class BumperSettings:
    """The pin of each side's switch; None if there is none."""

    front: Pin | None = None
    """GPIO number of the switch in front."""
    left: Pin | None = None
    """GPIO number of the left switch."""
    right: Pin | None = None
    """GPIO number of the right switch."""
    rear: Pin | None = None
    """GPIO number of the switch at the rear."""
    pull_up: bool = True
    """The switches connect their pin to ground when pressed, and the Pi's own resistors pull it up otherwise. False:
    they connect it to 3.3 V (never 5 V), and it is pulled down otherwise."""

    def __post_init__(self) -> None:
        if not self.pins:
            raise ValueError("a bumper needs the pin of at least one side: front, left, right or rear")

    @property
    def pins(self) -> dict[Side, int]:
        """The sides that have a switch."""
        pins = {Side.FRONT: self.front, Side.LEFT: self.left, Side.RIGHT: self.right, Side.REAR: self.rear}
        return {side: pin for side, pin in pins.items() if pin is not None}


class Bumper(GpioPart):
    """The switches as a ``hal.ContactSensor``; they do not know the bearing of an obstacle."""

    part: ClassVar[str] = "contact"
    Settings = BumperSettings

    def __init__(self, settings: BumperSettings, buses: Buses) -> None:
        super().__init__(f"bumper on GPIO {', '.join(map(str, settings.pins.values()))}", buses.pins())
        self._settings = settings
        self._pressed: dict[Side, bool] = {}  # since the last read; the pins' thread writes it, item by item

    async def open(self) -> None:
        """Claim the pins, and forget earlier presses; raises as ``GpioPart.open``."""
        await super().open()
        self._pressed.clear()
        for side, switch in self._devices.items():
            switch.when_activated = partial(self._remember, side)

    async def read(self) -> ContactReading:
        """Return the sides that are pressed now, or were since the previous read."""
        with self._using() as switches:
            # Forget before looking: a press between the two is then reported twice, and is not missed.
            sides = tuple(side for side, switch in switches.items() if self._forget(side) or switch.is_active)
        return ContactReading(asyncio.get_running_loop().time(), sides, None)

    def _make(self) -> dict[Side, InputPin]:
        pull_up = self._settings.pull_up
        return {side: self._input(pin, pull_up=pull_up) for side, pin in self._settings.pins.items()}

    def _remember(self, side: Side) -> None:
        self._pressed[side] = True

    def _forget(self, side: Side) -> bool:
        """Return whether a side was pressed since the last call."""
        return self._pressed.pop(side, False)
