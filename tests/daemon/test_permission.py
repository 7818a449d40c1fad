"""A permission to start wheels is fresh or void: whatever keeps a request waiting, nothing starts later."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

import msgspec
import pytest

from tests.daemon.played import DELAY_S, Run
from tests.kit.rover import Rig
from tests.virtual import virtual
from wayfarer.daemon.socket.protocol import STARTING, check, perform, read_line
from wayfarer.errors import WayfarerError
from wayfarer.hal import STOP
from wayfarer.safety.manual import LEASE_S
from wayfarer.safety.permission import PERMISSION_S
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

KEYS: dict[str, dict[str, object]] = {"arm": {"heading_deg": 0.0}, "resume": {}, "manual_begin": {"driver": "page"}}


def now_s() -> float:
    return asyncio.get_running_loop().time()


class Asking:
    """A client that asks a rover to start its wheels by one verb, as bytes; ``there`` is whether it still waits."""

    def __init__(self, run: Run, verb: str) -> None:
        self.run = run
        self.verb = verb
        self.there = True

    def line(self, at_s: object = None) -> bytes:
        """The request; by default of now."""
        return msgspec.json.encode({"do": self.verb, "asked_s": now_s() if at_s is None else at_s, **KEYS[self.verb]})

    async def send(self, line: bytes) -> dict[str, Any]:
        return dict(await perform(check(read_line(line)), self.run.commands, None, lambda: self.there))

    async def stop(self) -> None:
        """What a person does to stop it: who holds a mission holds it again."""
        await (self.run.commands.hold() if self.verb == "resume" else self.run.commands.disarm())

    def delay(self, for_s: float) -> None:
        """Have what is waited for before the start take so long: a disk that has frozen, a board."""

        async def open_slowly() -> None:
            await asyncio.sleep(for_s)
            await opens()

        motors = self.run.rig.motors
        opens = motors.open
        motors.open = open_slowly  # type: ignore[method-assign]


Way = Callable[[Asking], Awaitable[object]]


async def _asked_before_a_stop(it: Asking) -> None:
    line = it.line()
    await asyncio.sleep(0.1)
    await it.stop()
    await asyncio.sleep(0.1)
    await it.send(line)


async def _sent_again(it: Asking) -> None:
    """The wheels were started by these bytes once; they stopped by a person, and by themselves."""
    line = it.line()
    await it.send(line)
    await asyncio.sleep(0.1)
    await it.stop()
    await it.send(line)


async def _sent_again_after_a_fault(it: Asking) -> None:
    line = it.line()
    await it.send(line)
    if it.verb == "manual_begin":
        await asyncio.sleep(LEASE_S + 0.1)
    elif it.verb == "arm":
        it.run.supervisor.controller.disarm(now_s(), "fault: of the board")
    else:
        await it.run.commands.hold()
    await it.send(line)


async def _both_in_one_buffer(it: Asking) -> None:
    """Read at once, the stop first, though it was sent last: by another client."""
    line = it.line()
    await asyncio.sleep(0.01)
    await asyncio.gather(it.stop(), it.send(line))


# Of every verb.
WAYS: dict[str, Way] = {
    "no time": lambda it: it.send(msgspec.json.encode({"do": it.verb, **KEYS[it.verb]})),
    "null for a time": lambda it: it.send(it.line(0).replace(b":0,", b":null,").replace(b":0}", b":null}")),
    "a text for a time": lambda it: it.send(it.line("now")),
    "time zero": lambda it: it.send(it.line(0.0)),
    "as old as the limit": lambda it: it.send(it.line(now_s() - PERMISSION_S)),
    "a minute old": lambda it: it.send(it.line(max(0.0, now_s() - 60.0))),
    "from the future": lambda it: it.send(it.line(now_s() + 0.01)),
    "of another computer's clock": lambda it: it.send(it.line(1.7e9)),
    "asked before a stop": _asked_before_a_stop,
    "sent again": _sent_again,
    "sent again after it ended by itself": _sent_again_after_a_fault,
    "with a stop in one buffer": _both_in_one_buffer,
}


async def _gone(it: Asking) -> None:
    it.there = False
    await it.send(it.line())


async def _half_sent(it: Asking) -> None:
    line = it.line()
    await asyncio.sleep(PERMISSION_S)  # the other half comes when the client is woken
    await it.send(line)


async def _suspended(it: Asking) -> None:
    line = it.line()
    cast(VirtualLoop, asyncio.get_running_loop()).stall(PERMISSION_S)
    await asyncio.sleep(0.1)
    await it.send(line)


WAYS |= {"the client has gone": _gone, "half sent": _half_sent, "suspended while it waited": _suspended}


@pytest.fixture
def run(tmp_path: Path) -> Run:
    rig = Rig(tmp_path)
    rig.set(manual={"allowed": True})
    return Run(rig, after_s=5.0)


async def started(run: Run, verb: str, way: Way, within_s: float = DELAY_S + 1.0) -> None:
    """Try a way to start the wheels, on a rover whose state the verb is for, and assert that nothing starts."""
    it = Asking(run, verb)
    async with run:
        if verb == "resume":
            await run.arm()
            await run.commands.hold()
            await asyncio.sleep(0.1)
        before = run.mode
        with pytest.raises(WayfarerError) as refused:
            await way(it)
        assert "\n" not in str(refused.value)
        for _ in range(round(within_s / 0.1)):
            await asyncio.sleep(0.1)
            assert run.wheels == STOP
            assert (run.mode, run.supervisor.controller.held) == (before, verb == "resume")


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("verb", sorted(STARTING))
@virtual
async def test_nothing_starts(run: Run, verb: str, way: str) -> None:
    await started(run, verb, WAYS[way])


# -- while it is checked -----------------------------------------------------------------------------------------------


async def _too_slow(it: Asking) -> None:
    it.delay(8.0)
    await it.send(it.line())


async def _goes_unnoticed(it: Asking) -> None:
    """The daemon does not read that the client has closed before the checks are over."""
    it.delay(1.0)
    asyncio.get_running_loop().call_later(0.5, setattr, it, "there", False)
    await it.send(it.line())


async def _goes(it: Asking) -> None:
    it.delay(1.0)
    asking = asyncio.ensure_future(it.send(it.line()))
    await asyncio.sleep(0.5)
    assert (await it.run.status())["being_checked"]
    asking.cancel()  # as the server does
    with suppress(asyncio.CancelledError):
        await asking
    assert not (await it.run.status())["being_checked"], "another one may ask at once"
    raise WayfarerError("it has gone")


async def _suspended_meanwhile(it: Asking) -> None:
    it.delay(1.0)
    loop = cast(VirtualLoop, asyncio.get_running_loop())
    loop.call_later(0.5, loop.stall, PERMISSION_S)
    await it.send(it.line())


async def _old_already(it: Asking) -> None:
    it.delay(1.0)
    await it.send(it.line(now_s() - PERMISSION_S + 0.5))


WHILE_CHECKED: dict[str, Way] = {
    "a disk that answers after 8 s": _too_slow,
    "the client goes, unnoticed": _goes_unnoticed,
    "the client goes": _goes,
    "suspended": _suspended_meanwhile,
    "fresh before the checks, and not after them": _old_already,
}


@pytest.mark.parametrize("way", WHILE_CHECKED)
@pytest.mark.parametrize("verb", ["arm", "manual_begin"])
@virtual
async def test_nothing_starts_after_checks_that_somebody_has_ceased_to_wait_for(run: Run, verb: str, way: str) -> None:
    await started(run, verb, WHILE_CHECKED[way], 10.0 + DELAY_S)


@virtual
async def test_refusal_comes_while_the_client_still_waits_for_it(run: Run) -> None:
    """Whatever hangs: no client may say that an arming has failed which happens later."""
    it = Asking(run, "arm")
    it.delay(60.0)
    async with run:
        began_s = now_s()
        with pytest.raises(WayfarerError, match=r"longer than 4 s.*ask again"):
            await it.send(it.line())
        assert now_s() - began_s == pytest.approx(PERMISSION_S)


# -- during the start delay --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("still_s", "mode"), [(PERMISSION_S + 0.5, "disarmed"), (1.0, "armed")])
@virtual
async def test_daemon_that_stood_still_during_the_start_delay_is_disarmed(run: Run, still_s: float, mode: str) -> None:
    it = Asking(run, "arm")
    async with run:
        await it.send(it.line())
        await asyncio.sleep(0.5)
        cast(VirtualLoop, asyncio.get_running_loop()).stall(still_s)
        await asyncio.sleep(DELAY_S + 1.0)
        assert run.mode == mode
        assert (run.wheels == STOP) == (mode == "disarmed")
        if mode == "disarmed":
            assert "was suspended" in run.supervisor.controller.why_disarmed


@virtual
async def test_fresh_permission_starts_the_wheels(run: Run) -> None:
    async with run:
        await Asking(run, "arm").send(Asking(run, "arm").line(now_s() - PERMISSION_S + 0.1))
        await asyncio.sleep(DELAY_S + 1.0)
        assert run.wheels != STOP
        await run.commands.hold()
        await asyncio.sleep(0.1)
        await Asking(run, "resume").send(Asking(run, "resume").line())
        await asyncio.sleep(1.0)
        assert run.wheels != STOP


@virtual
async def test_stops_need_no_time_and_nobody_who_waits(run: Run) -> None:
    async with run:
        await run.arm()
        for do in ("hold", "disarm", "stop"):
            await perform(check({"do": do}), run.commands, None, lambda: False)
            assert run.wheels == STOP
