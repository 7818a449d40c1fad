"""Encoders at the pins count each edge the right way round, and say what they must have missed."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.virtual import virtual
from wayfarer.drivers.encoders import Encoders, EncodersSettings
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.hal import WheelReading, WheelSensor
from wayfarer.simhal.buses import FakeBuses

A, B = 5, 6
CYCLE = ((0, 0), (1, 0), (1, 1), (0, 1))
steps = st.lists(st.sampled_from([1, -1]), max_size=40)


class Bench:
    """The driver at simulated pins, with an encoder at the left wheel that is turned by hand; 100 counts a metre."""

    def __init__(self, *, pull_up: bool = False, reverse_left: bool = False) -> None:
        self.buses = FakeBuses()
        self._low = pull_up
        self._at = 0
        self.put(*CYCLE[0])
        self.encoders = Encoders(
            EncodersSettings(A, B, 12, 13, 100.0, pull_up=pull_up, reverse_left=reverse_left), self.buses
        )

    def put(self, a: int, b: int) -> None:
        """Set the levels of both channels."""
        for number, level in ((A, a), (B, b)):
            self.buses.pins().wire(number).level = float(level != self._low)

    def turn(self, moves: Iterable[int]) -> None:
        for move in moves:
            self._at += move
            self.put(*CYCLE[self._at % 4])

    async def opened(self) -> WheelReading:
        await self.encoders.open()
        return await self.encoders.read()

    @property
    def missed(self) -> int:
        return self.encoders.error_counts["edges missed"]


@given(before=steps, after=steps, pull_up=st.booleans(), reverse_left=st.booleans())
@virtual
async def test_each_edge_counts_in_its_direction(
    before: list[int], after: list[int], pull_up: bool, reverse_left: bool
) -> None:
    bench = Bench(pull_up=pull_up, reverse_left=reverse_left)
    assert isinstance(bench.encoders, WheelSensor)
    bench.turn(before)
    first = await bench.opened()
    assert (first.left_m, first.right_m, first.left_a) == (None, None, None)
    bench.turn(after)
    reading = await bench.encoders.read()
    assert reading.left_m == pytest.approx((-1 if reverse_left else 1) * sum(after) / 100.0)
    assert reading.right_m == 0.0
    assert (await bench.encoders.read()).left_m == 0.0
    assert bench.missed == 0


@virtual
async def test_edge_that_never_came_shows_once_the_wheel_stands() -> None:
    bench = Bench()
    await bench.opened()
    pin = bench.buses.pins().wire(A)
    listeners, pin.listeners = pin.listeners, []
    bench.turn([1])
    pin.listeners = listeners
    ways_m = [(await bench.encoders.read()).left_m for _ in range(3)]
    assert ways_m == [0.0, 0.01, 0.0], "not at the first look: the edge might only be late"
    assert bench.missed == 1


@virtual
async def test_move_of_both_channels_at_once_is_none_and_counted() -> None:
    bench = Bench()
    await bench.opened()
    for number in (A, B):
        bench.buses.pins().wire(number).listeners = []
    bench.put(1, 1)
    ways_m = [(await bench.encoders.read()).left_m for _ in range(3)]
    assert (ways_m, bench.missed) == ([0.0, 0.0, 0.0], 1)


@virtual
async def test_gpiozero_s_own_pins_are_counted(board: Any) -> None:
    encoders = Encoders(EncodersSettings(A, B, 12, 13, 100.0), LinuxBuses())
    await encoders.open()
    await encoders.read()
    for number in (A, B, A, B, A):  # pulled up: low is active
        pin = board.pin(number)
        (pin.drive_high if pin.state == 0 else pin.drive_low)()
    await asyncio.sleep(0.0)
    assert (await encoders.read()).left_m == pytest.approx(0.05)
    await encoders.close()
