"""Bumper switches: which sides, and no press lost between two reads."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.virtual import virtual
from wayfarer.drivers.bumper import Bumper, BumperSettings
from wayfarer.hal import Side
from wayfarer.simhal.buses import FakeBuses

pytestmark = pytest.mark.usefixtures("board")

PIN_OF = {Side.FRONT: 5, Side.LEFT: 6, Side.RIGHT: 12, Side.REAR: 13}
ALL_ROUND = BumperSettings(front=5, left=6, right=12, rear=13)


async def opened(settings: BumperSettings = ALL_ROUND) -> Bumper:
    bumper = Bumper(settings, FakeBuses())
    await bumper.open()
    return bumper


def press(board: Any, side: Side) -> None:
    board.pin(PIN_OF[side]).drive_low()


def let_go(board: Any, side: Side) -> None:
    board.pin(PIN_OF[side]).drive_high()


@given(
    touches=st.lists(
        st.tuples(
            st.sets(st.sampled_from(Side)),  # pressed and let go between two reads
            st.sets(st.sampled_from(Side)),  # held over the read
        ),
        max_size=8,
    )
)
@virtual
async def test_every_press_is_reported_once_let_go_and_as_long_as_it_is_held(
    board: Any, touches: list[tuple[set[Side], set[Side]]]
) -> None:
    held: set[Side] = set()
    bumper = await opened()
    for taps, holds in touches:
        tapped = taps - held
        for side in tapped:
            press(board, side)
            let_go(board, side)
        for side in held - holds:
            let_go(board, side)
        for side in holds - held:
            press(board, side)
        held = holds
        sides = (await bumper.read()).sides
        assert set(sides) == held | tapped
        assert len(set(sides)) == len(sides)
        assert set((await bumper.read()).sides) == held
    await bumper.close()


@virtual
async def test_a_side_that_is_pressed_already_at_opening_is_reported(
    board: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = board.pin(PIN_OF[Side.LEFT])
    monkeypatch.setattr(left, "_get_state", lambda: False)  # a mock pin follows its pull at opening; a switch wins
    bumper = await opened()
    assert (await bumper.read()).sides == (Side.LEFT,)
    assert (await bumper.read()).sides == (Side.LEFT,)


@virtual
async def test_presses_of_an_earlier_opening_are_forgotten(board: Any) -> None:
    bumper = await opened()
    press(board, Side.REAR)
    let_go(board, Side.REAR)
    await bumper.open()
    assert (await bumper.read()).sides == ()


@virtual
async def test_switches_to_3_3_volt_are_pressed_when_high(board: Any) -> None:
    bumper = await opened(BumperSettings(right=12, pull_up=False))
    assert (await bumper.read()).sides == ()
    board.pin(12).drive_high()
    assert (await bumper.read()).sides == (Side.RIGHT,)
