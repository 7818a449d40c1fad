"""The two coloured LEDs of a PiBorg ThunderBorg (board and lid) as a status light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval

from wayfarer.drivers.buses import Buses
from wayfarer.drivers.thunderborg import DEFAULT_ADDRESS, Opcode, ThunderBorg, ThunderBorgLink
from wayfarer.hal import Colour

_FULL = 255


@dataclass(frozen=True, slots=True)
class ThunderBorgLightSettings:
    """Where the board is: as for the motors."""

    bus: str = "/dev/i2c-1"
    address: Annotated[int, Interval(ge=0x03, le=0x77)] = DEFAULT_ADDRESS


class ThunderBorgLight:
    """Both LEDs in one colour; implements ``hal.StatusLight``.

    The board ignores colours while its LEDs show the battery. It may acknowledge a colour without showing it: a user in
    PiBorg's forum had to send each twice. So each change is sent twice, and the same colour is not sent again.
    """

    part: ClassVar[str] = "light"
    chip: ClassVar[str] = ThunderBorg.chip
    Settings = ThunderBorgLightSettings

    def __init__(self, settings: ThunderBorgLightSettings, buses: Buses) -> None:
        self._board = ThunderBorgLink(buses.i2c(settings.bus), settings.address)
        self.name = f"light of {self._board.where}"
        self._shown: Colour | None = None

    async def open(self) -> None:
        """Find the board and take its LEDs from the battery display."""
        self._shown = None
        await self._board.identify()
        await self._board.write(Opcode.SET_LEDS_SHOW_BATTERY, 0)

    async def close(self) -> None:
        """Nothing to release; the last colour stays."""

    async def show(self, colour: Colour) -> None:
        """Show a colour until the next call, in 255 steps of each part."""
        if colour == self._shown:
            return
        red, green, blue = (round(_FULL * part) for part in colour)
        for _ in range(2):
            await self._board.write(Opcode.SET_BOTH_LEDS, red, green, blue)
        self._shown = colour
