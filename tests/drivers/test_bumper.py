"""Bumper switches: which sides, and no press lost between two reads."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.drivers.bumper import Bumper, BumperSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import ContactSensor, Side
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.testing import check_contact_sensor

gpiozero = pytest.importorskip("gpiozero")

pytestmark = pytest.mark.usefixtures("board")

PIN_OF = {Side.FRONT: 5, Side.LEFT: 6, Side.RIGHT: 12, Side.REAR: 13}
ALL_ROUND = BumperSettings(front=5, left=6, right=12, rear=13)


def bumper_on(settings: BumperSettings = ALL_ROUND) -> Bumper:
    return Bumper(settings, FakeBuses())


@asynccontextmanager
async def opened(settings: BumperSettings = ALL_ROUND) -> AsyncIterator[Bumper]:
    bumper = bumper_on(settings)
    await bumper.open()
    try:
        yield bumper
    finally:
        await bumper.close()


def run(main: Coroutine[Any, Any, None]) -> None:
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(main)


def press(board: Any, side: Side) -> None:
    board.pin(PIN_OF[side]).drive_low()


def let_go(board: Any, side: Side) -> None:
    board.pin(PIN_OF[side]).drive_high()


def test_keeps_the_promises_of_a_contact_sensor() -> None:
    other = gpiozero.LED(26)
    assert isinstance(bumper_on(), ContactSensor)
    run(check_contact_sensor(bumper_on, lambda: bumper_on(BumperSettings(front=5, rear=26))))
    other.close()


@given(
    touches=st.lists(
        st.tuples(
            st.sets(st.sampled_from(Side)),  # pressed and let go between two reads
            st.sets(st.sampled_from(Side)),  # held over the read
        ),
        max_size=8,
    )
)
def test_every_press_is_reported_once_let_go_and_as_long_as_it_is_held(
    board: Any, touches: list[tuple[set[Side], set[Side]]]
) -> None:
    async def main() -> None:
        held: set[Side] = set()
        async with opened() as bumper:
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

    run(main())


def test_a_side_that_is_pressed_already_at_opening_is_reported(board: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        left = board.pin(PIN_OF[Side.LEFT])
        monkeypatch.setattr(left, "_get_state", lambda: False)  # a mock pin follows its pull at opening; a switch wins
        async with opened() as bumper:
            assert (await bumper.read()).sides == (Side.LEFT,)
            assert (await bumper.read()).sides == (Side.LEFT,)

    run(main())


def test_presses_of_an_earlier_opening_are_forgotten(board: Any) -> None:
    async def main() -> None:
        async with opened() as bumper:
            press(board, Side.REAR)
            let_go(board, Side.REAR)
            await bumper.open()
            assert (await bumper.read()).sides == ()

    run(main())


def test_switches_to_3_3_volt_are_pressed_when_high(board: Any) -> None:
    async def main() -> None:
        async with opened(BumperSettings(right=12, pull_up=False)) as bumper:
            assert (await bumper.read()).sides == ()
            board.pin(12).drive_high()
            assert (await bumper.read()).sides == (Side.RIGHT,)

    run(main())


def test_reads_before_open_say_so_and_do_not_say_free() -> None:
    async def main() -> None:
        with pytest.raises(NotResponding, match="bumper on GPIO 5, 6, 12, 13: not open"):
            await bumper_on().read()

    run(main())


def test_a_pin_that_fails_is_named() -> None:
    async def main() -> None:
        async with opened() as bumper:
            bumper._switches[Side.LEFT].close()
            with pytest.raises(NotResponding, match="the pins failed"):
                await bumper.read()

    run(main())


def test_a_bumper_without_a_switch_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one side"):
        BumperSettings()
