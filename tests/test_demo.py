"""The demo is a trial: what its page asks for changes the pace, and nothing else unless it asks the rover itself."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import Awaitable, Callable, Coroutine
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from tests.virtual import asked
from wayfarer import demo as module
from wayfarer.config.rover_file import load_rover
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.demo import Demo, DemoTrial, ForwardedCommands
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.trial import TrialResult, run_trial
from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import AnyRecord, Event, Outcome
from wayfarer.logview.narrator import Console

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")
from wayfarer.remote.live.server import LivePage

SEED, TRIAL = 45, 0  # over after two episodes, in less than a minute
FAST = 1000.0


class Site:
    """A demo without a browser, and the trial that it told the end of."""

    def __init__(self, folder: Path, speed: float) -> None:
        self.ended: list[DemoTrial] = []
        self.folder = folder
        self.demo = Demo("forest-pledge", SEED, TRIAL, speed, folder, self.ended.append)
        self.page = LivePage("127.0.0.1", 0, "token", demo=self.demo)
        self.rover: Any = ForwardedCommands(self.demo)

    def run(self, during: Callable[[Site], Awaitable[None]]) -> None:
        """Run the demo while something happens."""

        async def both() -> None:
            async with asyncio.timeout(30.0), asyncio.TaskGroup() as group:
                group.create_task(self.demo.run(self.page))
                group.create_task(during(self))  # type: ignore[arg-type]

        asyncio.run(both())

    @property
    def log(self) -> list[AnyRecord]:
        return list(RunReader(next(self.folder.iterdir())))

    @property
    def outcome(self) -> Outcome:
        last = self.log[-1]
        assert isinstance(last, Outcome)
        return last

    async def until(self, holds: Callable[[], object]) -> None:
        while not holds():  # noqa: ASYNC110 - anything
            await asyncio.sleep(0.005)

    @property
    def t_s(self) -> float:
        """The time of the trial as the page has it."""
        return float(self.page._model.state()["t_s"])


@pytest.fixture(autouse=True)
def leave_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LOOK_S", 0.01)
    monkeypatch.setattr(module, "LEFT_S", 0.05)  # nobody has the page open


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path, FAST)


def trial(log: Path) -> TrialResult:
    campaign = Campaign(("forest-pledge",), 1, load_rover("sim"), SEED)
    return run_trial(campaign.spec(Task("forest-pledge", TRIAL), campaign.make_forest(TRIAL)), log)


async def see(site: Site) -> None:
    site.demo.seen()


@pytest.mark.parametrize("speed", [FAST, 200.0])
def test_demo_is_the_trial_to_the_last_byte_at_any_speed(tmp_path: Path, speed: float) -> None:
    async def disturb(site: Site) -> None:
        await see(site)
        await site.until(lambda: site.t_s > 10.0)
        site.demo.pause(True)
        await asyncio.sleep(0.1)
        site.demo.run_at(speed)

    site = Site(tmp_path / "demo", speed)
    site.run(disturb)
    (ended,) = site.ended
    assert ended.result == trial(tmp_path / "trial")
    assert (ended.folder / "run.00001.jsonl").read_bytes() == (tmp_path / "trial" / "run.00001.jsonl").read_bytes()


def test_page_console_and_log_tell_one_way_and_one_time(site: Site, capfd: pytest.CaptureFixture[str]) -> None:
    from wayfarer.logview.summary import distance_line, summarise

    site.run(see)
    (ended,) = site.ended
    told, summary = site.page._model.state(), summarise(site.log)
    assert told["way_m"] == summary.driven_m == ended.state.driven_m == round(ended.result.path_m, 3)
    assert told["time_text"] == duration_text(summary.lasted_s)
    assert summary.lasted_s == ended.state.elapsed_s == pytest.approx(ended.result.time_s, abs=0.05)
    assert distance_line(summary).startswith(f"{summary.driven_m:.1f} m driven")
    assert f"{duration_text(summary.lasted_s, 1)}  The run has ended" in capfd.readouterr().err


def test_trial_begins_when_somebody_sees_the_page(site: Site) -> None:
    async def look(site: Site) -> None:
        await site.until(lambda: site.page._model.snapshot()["about"])
        await asyncio.sleep(0.1)
        assert site.t_s == 0.0
        assert site.demo.now().paused
        site.demo.seen()

    site.run(look)
    assert site.ended


def test_page_stays_after_the_trial_while_somebody_has_it_open(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LivePage, "is_watched", property(lambda _: not left))
    left: list[bool] = []

    async def look(site: Site) -> None:
        await see(site)
        await site.until(lambda: site.ended)
        await asyncio.sleep(0.2)
        with pytest.raises(RequestRefused, match="the run has ended"):
            await site.rover.hold()
        left.append(True)

    site.run(look)
    assert left


def test_trial_waits_for_a_page_that_is_slower(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    logged: list[Any] = []
    shown: list[Any] = []
    ahead: list[int] = []

    def show(_page: LivePage, record: Any) -> None:
        time.sleep(0.0005)  # noqa: TID251 - a page that takes its time
        shown.append(record)
        ahead.append(len(logged) - len(shown))

    monkeypatch.setattr(module, "AHEAD", 20)
    monkeypatch.setattr(Console, "show", lambda _console, record: logged.append(record))
    monkeypatch.setattr(LivePage, "show", show)
    site.run(see)
    assert shown == logged, "none is left out"
    assert 10 < max(ahead) <= 21


def test_what_the_page_asks_of_the_rover_is_done_also_in_a_pause(tmp_path: Path) -> None:
    async def ask(site: Site) -> None:
        await see(site)
        await site.until(lambda: site.t_s > 3.0)
        site.demo.pause(True)
        await site.rover.mark(text="noted in a pause")
        assert site.demo.now().paused
        with pytest.raises(RequestRefused, match="not held"):
            await site.rover.resume(asked=asked())
        await site.rover.hold()
        assert not site.demo.now().paused, "what it does takes time"
        await site.until(lambda: site.page._model.state()["held"])
        await site.rover.resume(asked=asked())
        site.demo.pause(True)
        await site.rover.stop()

    site = Site(tmp_path, 20.0)
    site.run(ask)
    names = [record.name for record in site.log if isinstance(record, Event)]
    assert [name for name in names if name in {"mark", "hold", "resume", "wheels_stopped"}] == [
        "mark", "hold", "resume", "wheels_stopped",
    ]  # fmt: skip
    assert site.outcome.reason == "requested"


def test_command_that_the_end_of_the_trial_overtakes_is_refused(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    def overtaken(work: Coroutine[Any, Any, Any], _loop: object) -> Future[Any]:
        """Do what the end of a loop does to a task that has not begun."""
        work.close()
        answer: Future[Any] = Future()
        answer.cancel()
        return answer

    async def ask(site: Site) -> None:
        await see(site)
        await site.until(lambda: site.t_s > 1.0)
        with pytest.raises(RequestRefused, match="the run has just ended"):
            await site.rover.mark(text="too late")
        refused.append(True)  # a task that was cancelled would end the demo without an error

    refused: list[bool] = []
    monkeypatch.setattr(asyncio, "run_coroutine_threadsafe", overtaken)
    site.run(ask)
    assert refused


def test_command_without_a_trial_is_refused(site: Site) -> None:
    with pytest.raises(RequestRefused, match="the run has ended"):
        asyncio.run(site.rover.stop())
    site.page.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_a_pause_the_trial_and_the_demo(tmp_path: Path, number: signal.Signals) -> None:
    async def end(site: Site) -> None:
        await see(site)
        await site.until(lambda: site.t_s > 1.0)
        site.demo.pause(True)
        os.kill(os.getpid(), number)

    site = Site(tmp_path, 6.0)
    site.run(end)
    assert [each.state.ended and each.state.ended.text for each in site.ended] == [f"ended by {number.name}"]


def test_signal_before_there_is_a_trial_ends_the_demo_and_no_pause_keeps_it(site: Site) -> None:
    async def end(site: Site) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        await site.until(lambda: site.demo._signal)
        site.demo.pause(True)

    site.run(end)
    assert site.outcome.reason == "signal"


def test_signal_after_the_trial_ends_the_demo(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LivePage, "is_watched", True)

    async def end(site: Site) -> None:
        await see(site)
        await site.until(lambda: site.ended)
        os.kill(os.getpid(), signal.SIGTERM)

    site.run(end)
    assert site.outcome.reason == "escaped"


def test_error_beside_the_trial_ends_it_too(tmp_path: Path) -> None:
    async def fail(site: Site) -> None:
        await see(site)
        await site.until(lambda: site.t_s > 1.0)
        site.demo.pause(True)
        raise ZeroDivisionError

    site = Site(tmp_path, 6.0)
    with pytest.raises(ExceptionGroup):
        site.run(fail)
    assert site.outcome.text == "ended by an error"
