"""Wheel encoders at the GPIO pins: two channels, A and B, at one wheel of each side.

Each edge moves a state of four; the pins' thread counts. Python keeps up with one or two thousand edges per second, and
two edges of a channel that are lost together are not noticed (docs/reference/hardware.md). Encoders with more edges
belong at a board that counts, such as a RoboClaw. One channel alone does not say which way a wheel turns: it is not
supported.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar

from annotated_types import Interval

from wayfarer.drivers.buses import Buses, InputPin
from wayfarer.drivers.gpio import GpioPart, Pin
from wayfarer.hal import WheelReading

_A, _B = 0b10, 0b01
_CYCLE = (0b00, _A, _A | _B, _B)  # the states of A and B while a wheel turns ahead: A leads
# Counts for each of the 16 moves, at four times the old state and the new one; both channels at once is none.
_MOVES = tuple(
    {0: 0, 1: 1, 2: None, 3: -1}[(_CYCLE.index(new) - _CYCLE.index(old)) % 4] for old in range(4) for new in range(4)
)


@dataclass(frozen=True, slots=True)
class EncodersSettings:
    """The pins of both encoders, and what they count."""

    left_a: Pin
    """GPIO number of channel A of the left encoder."""
    left_b: Pin
    """GPIO number of channel B of the left encoder."""
    right_a: Pin
    """GPIO number of channel A of the right encoder."""
    right_b: Pin
    """GPIO number of channel B of the right encoder."""
    counts_per_m: Annotated[float, Interval(gt=0, le=1e5)]
    """Edges of both channels for each metre that the rim of a wheel turns. What a maker calls CPR may be edges, or
    cycles of four edges, and of the motor before its gear: turn the wheel once, and divide by its circumference."""
    pull_up: bool = True
    """The Pi's own resistors pull the pins up, for encoders with open collectors; false: they pull them down. An
    encoder that drives its outputs itself needs neither. Never more than 3.3 V."""
    reverse_left: bool = False
    """The left encoder counts down when its wheel turns forwards."""
    reverse_right: bool = False
    """The right encoder counts down when its wheel turns forwards."""


class _Counter:
    """Counts the edges of one encoder; ``missed`` are the edges that must have been between those that came."""

    def __init__(self) -> None:
        self.count = self.missed = 0
        self._state = 0
        self._edges = self._edges_seen = 0
        self._doubt: int | None = None

    def start(self, state: int) -> None:
        """Begin with the levels of both channels."""
        self._state, self._doubt = state, None

    def edge(self, channel: int, level: int) -> None:
        """Take an edge of a channel, to 0 or to its own bit, from the pins' thread."""
        self._edges += 1
        self._move(self._state & ~channel | level)

    def look(self, state: int) -> None:
        """Compare with the levels now: if no edge has come since the last look but one, they must be the same."""
        if self._edges != self._edges_seen or state == self._state:
            self._edges_seen, self._doubt = self._edges, None
        elif self._doubt == state:
            self.missed += bool(_MOVES[4 * self._state + state])  # ``_move`` counts the others
            self._move(state)
            self._doubt = None
        else:  # an edge that comes right now is not a mistake
            self._doubt = state

    def _move(self, state: int) -> None:
        counts = _MOVES[4 * self._state + state]
        if counts:
            self.count += counts
        else:  # a level twice, or both channels at once
            self.missed += 1
        self._state = state


class Encoders(GpioPart):
    """Both encoders as a ``hal.WheelSensor``; ``error_counts`` counts edges that were missed, as far as that shows."""

    part: ClassVar[str] = "wheels"
    Settings = EncodersSettings

    def __init__(self, settings: EncodersSettings, buses: Buses) -> None:
        left, right = (settings.left_a, settings.left_b), (settings.right_a, settings.right_b)
        super().__init__(f"encoders on GPIO {left[0]}/{left[1]} and {right[0]}/{right[1]}", buses.pins())
        self._settings = settings
        self._channels = {"left": left, "right": right}
        self._m_per_count = 1.0 / settings.counts_per_m
        self._signs = (-1 if settings.reverse_left else 1), (-1 if settings.reverse_right else 1)
        self._counters = {side: _Counter() for side in self._channels}
        self._counted: tuple[int, int] | None = None

    @property
    def error_counts(self) -> dict[str, int]:
        """How many edges must have been missed."""
        return {"edges missed": sum(counter.missed for counter in self._counters.values())}

    async def open(self) -> None:
        """Claim the pins; what the wheels did before is not known. Raises as ``GpioPart.open``."""
        await super().open()
        self._counted = None
        with self._using() as sides:
            for side, pins in sides.items():
                counter = self._counters[side]
                counter.start(_state(pins))
                for channel, pin in pins.items():
                    pin.when_activated = partial(counter.edge, channel, channel)
                    pin.when_deactivated = partial(counter.edge, channel, 0)

    async def read(self) -> WheelReading:
        """Return the way of the rims since the previous read; the first says nothing.

        Raises:
            NotResponding: a pin failed.
        """
        with self._using() as sides:
            for side, pins in sides.items():
                self._counters[side].look(_state(pins))
        before, self._counted = self._counted, (self._counters["left"].count, self._counters["right"].count)
        now_s = asyncio.get_running_loop().time()
        if before is None:
            return WheelReading(now_s, None, None)
        left_m, right_m = (
            sign * (count - last) * self._m_per_count
            for sign, count, last in zip(self._signs, self._counted, before, strict=True)
        )
        return WheelReading(now_s, left_m, right_m)

    def _make(self) -> dict[str, dict[int, InputPin]]:
        pull_up = self._settings.pull_up
        return {
            side: {_A: self._input(a, pull_up=pull_up), _B: self._input(b, pull_up=pull_up)}
            for side, (a, b) in self._channels.items()
        }


def _state(pins: dict[int, InputPin]) -> int:
    return sum(channel for channel, pin in pins.items() if pin.is_active)
