"""However a run ends, and whatever hangs, the wheels stop first and the parts are closed."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from contextlib import nullcontext, suppress
from typing import Any
from unittest.mock import AsyncMock, Mock

import pytest

from tests.kit.workshop import (
    PARTS,
    Compass,
    Contact,
    Light,
    Position,
    Workshop,
    assert_wheels_stopped_first,
    breaking,
    drive,
)
from tests.virtual import virtual
from wayfarer.control import shutdown
from wayfarer.control.run_log import RunLog
from wayfarer.control.shutdown import run_uncancellable
from wayfarer.control.supervisor import Supervisor
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, CompassReading, WheelCommand
from wayfarer.safety.mission import RunEnd

ENDS_WITHIN_S = 2.0  # after a request, a signal or a bug: what systemd and a person may rely on


async def test_nothing_that_fails_in_the_words_for_the_end_keeps_the_wheels_from_being_stopped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def no_memory(_reason: str) -> str:
        raise MemoryError

    monkeypatch.setattr(shutdown, "disarmed_text", no_memory)
    motors = AsyncMock(halt=Mock(), read_back=AsyncMock(return_value=STOP))
    with pytest.raises(MemoryError):
        await shutdown.Shutdown(motors, (motors,), RunLog()).end(RunEnd("requested", "enough"))
    assert [name for name, *_ in motors.mock_calls] == ["stop", "read_back", "close"]


# -- the end, whatever hangs -------------------------------------------------------------------------------------


def test_stop_that_never_returns_is_sent_without_waiting_and_the_run_ends_soon(shop: Workshop) -> None:
    end = drive(shop, {0.5: lambda _: shop.silent.add("motors.stopping")}, for_s=1.0)
    assert end.reason == "requested"
    assert shop.wheels == STOP
    assert shop.times("motors.halt")[0] < 1.5
    assert max(shop.times("motors.drive")) < shop.times("motors.halt")[0]
    assert {f"{part}.close" for part in PARTS} <= set(shop.done)
    assert shop.named("stop_not_confirmed")[0] == {"part": "motors", "error": "not finished within 0.3 s"}
    assert shop.times("log.close")[0] < 1.0 + ENDS_WITHIN_S


@pytest.mark.parametrize("part", sorted(PARTS))
def test_part_whose_close_never_returns_is_told_and_the_others_are_closed(shop: Workshop, part: str) -> None:
    shop.silent.add(f"{part}.closing")
    assert drive(shop).reason == "requested"
    assert {f"{other}.close" for other in PARTS} - set(shop.done) == {f"{part}.close"}
    assert shop.named("close_hangs") == [{"part": part}]
    assert shop.outcome == [("requested", "enough")]
    assert shop.times("log.close")[0] < 1.0 + ENDS_WITHIN_S


def test_run_ends_soon_even_if_nothing_of_a_fully_equipped_rover_lets_go(shop: Workshop) -> None:
    parts: dict[str, Any] = {
        "contact": Contact(shop, "contact"),
        "position": Position(shop, "position"),
        "light": Light(shop, "light"),
    }
    shop.silent = {"motors.stopping", *(f"{part}.closing" for part in PARTS | set(parts))}
    drive(shop, algorithm="cv-pledge", **parts)
    assert len(shop.named("close_hangs")) == 6
    assert shop.wheels == STOP
    assert shop.times("log.close")[0] < 1.0 + ENDS_WITHIN_S


# -- bugs and cancellation ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", ["compass.read", "motion.read", "motors.drive", "handler.decide", "log.tick"])
def test_bug_anywhere_stops_the_wheels_then_closes_the_parts_then_shows_itself(shop: Workshop, place: str) -> None:
    with pytest.raises(ExceptionGroup) as caught:
        drive(shop, {0.5: breaking(shop, place)})
    assert caught.group_contains(RuntimeError, match=f"bug in {place}")
    assert shop.times("motors.stop")[0] == pytest.approx(0.5, abs=0.051)
    assert_wheels_stopped_first(shop)
    assert shop.outcome[0][0] == "failed"
    assert f"bug in {place}" in shop.outcome[0][1]


@pytest.mark.parametrize("place", ["log.event", "motors.stop", "compass.close", "motion.close"])
def test_broken_promise_while_stopping_leaves_no_part_open(shop: Workshop, place: str) -> None:
    """None of these may raise; one that does must not keep the others from being closed."""
    with suppress(RuntimeError, ExceptionGroup):
        drive(shop, {0.5: breaking(shop, place)})
    assert shop.wheels == STOP
    assert {f"{part}.close" for part in PARTS} <= set(shop.done)


@pytest.mark.parametrize("again", [False, True], ids=["once", "again at every later point"])
def test_cancellation_at_any_point_stops_the_wheels_and_closes_the_parts(again: bool) -> None:
    whole = Workshop()
    drive(whole, for_s=0.12)
    for at in range(1, whole.points + 1):
        shop = Workshop()
        shop.cancel_at = range(at, 1000) if again else range(at, at + 1)
        with pytest.raises(asyncio.CancelledError):
            drive(shop, for_s=0.12)
        assert_wheels_stopped_first(shop)


def test_control_task_cancelled_before_its_first_step_leaves_the_wheels_stopped(
    shop: Workshop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such a task runs none of its own code, not even its ``finally``."""
    create_task = asyncio.create_task

    def cancel_control(work: Coroutine[Any, Any, Any], **options: Any) -> asyncio.Task[Any]:
        task = create_task(work, **options)
        if task.get_name() == "control":
            task.cancel()
        return task

    monkeypatch.setattr(asyncio, "create_task", cancel_control)
    shop.wheels = WheelCommand(0.3, 0.3)
    with pytest.raises(asyncio.CancelledError):
        drive(shop)
    assert "motors.drive" not in shop.done
    assert_wheels_stopped_first(shop)


@pytest.mark.parametrize("t_s", [0.001, 0.03, 0.05, 0.0501, 0.099])
def test_cancellation_while_everything_sleeps(shop: Workshop, t_s: float) -> None:
    with pytest.raises(asyncio.CancelledError):
        drive(shop, {t_s: lambda _: shop.run is not None and shop.run.cancel()})
    assert_wheels_stopped_first(shop)
    assert shop.times("motors.stop")[0] == pytest.approx(t_s, abs=1e-6)
    assert shop.outcome[0][0] == "failed"


@pytest.mark.parametrize("cancelled", [False, True])
def test_run_that_is_ended_or_cancelled_while_a_part_opens_ends_at_once(shop: Workshop, cancelled: bool) -> None:
    shop.silent.add("motion.open")

    def end(it: Supervisor) -> None:
        assert shop.run is not None
        shop.run.cancel() if cancelled else it.finish("signal", "SIGTERM")

    with pytest.raises(asyncio.CancelledError) if cancelled else nullcontext():
        assert drive(shop, {0.5: end}).reason == "signal"
    assert shop.times("log.close")[0] == pytest.approx(0.5, abs=0.01)
    assert_wheels_stopped_first(shop)


@pytest.mark.parametrize(
    ("answer", "doubt"),
    [
        (None, None),
        (STOP, None),
        (WheelCommand(0.3, 0.0), "the board still reports 0.30 and 0.00"),
        (NotResponding("no answer"), "no answer"),
    ],
)
def test_stop_that_the_board_does_not_confirm_is_sent_again_and_told(
    shop: Workshop, answer: Any, doubt: str | None
) -> None:
    """If the wheels were not stopped, the daemon leaves the record of what it drives to stop-motors."""
    runs: list[Supervisor] = []
    drive(shop, {0.3: runs.append, 0.999: lambda _: setattr(shop, "answer", answer)})
    assert [run.wheels_stopped for run in runs] == [doubt is None]
    assert ("motors.halt" in shop.done) is (doubt is not None)
    assert [told["error"] for told in shop.named("stop_not_confirmed")][:1] == ([] if doubt is None else [doubt])
    assert shop.named("wheels_stopped") == [{"reason": "requested"}]


@virtual
async def test_work_that_fails_in_the_moment_of_a_cancellation_shows_its_own_error() -> None:
    async def fail() -> None:
        stopping.cancel()
        raise ZeroDivisionError

    stopping = asyncio.create_task(run_uncancellable(fail()))
    with pytest.raises(ZeroDivisionError):
        await stopping


class ClingingCompass(Compass):
    """Finishes its transfer, however long that takes, before it lets itself be cancelled; the first one is quick."""

    async def read(self) -> CompassReading:
        try:
            await asyncio.sleep(0.03 if "compass.read" in self.shop.done else 0.0)
            return await super().read()
        except asyncio.CancelledError:
            await asyncio.sleep(30.0)
            raise


def test_wheels_stop_at_once_even_if_a_sensor_does_not_let_go(shop: Workshop, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.kit.workshop.Compass", ClingingCompass)
    drive(shop, for_s=1.0)
    assert shop.times("motors.stop")[0] == pytest.approx(1.0, abs=0.1)
    assert shop.times("compass.close")[0] > 30.0
