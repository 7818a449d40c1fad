"""Driving by hand over the control socket's commands: who may, what ends it, and who cannot take the wheels."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from tests.daemon.played import DELAY_S, Run, played
from tests.kit.rover import Rig
from tests.virtual import asked, virtual
from wayfarer.daemon.socket.protocol import STARTING, Details, RequestRefused, check, perform, read_line
from wayfarer.errors import NotArmed, NotResponding, WayfarerError
from wayfarer.hal import STOP, MotorHealth, WheelCommand

EVERY_S = 0.05


class Hand:
    """A person who drives a rover through its commands, line by line as a client of the socket would."""

    lease = 0
    seq = 0

    def __init__(self, run: Run) -> None:
        self.run = run
        self.task: asyncio.Task[None] | None = None

    async def ask(self, **request: object) -> Details:
        starts = {"asked_s": asked().at_s} if request["do"] in STARTING else {}
        return await self.line(msgspec.json.encode(starts | request))

    async def line(self, line: bytes) -> Details:
        return await perform(check(read_line(line)), self.run.commands, None, lambda: True)

    def sample(self, forward: float = -1.0, **other: Any) -> dict[str, Any]:
        """A sample that would be taken, but for ``other``."""
        now_s = asyncio.get_running_loop().time()
        told = {"do": "manual_drive", "lease": self.lease, "seq": self.seq + 1, "forward": forward, "turn": 0.0}
        return told | {"sent_s": now_s} | other

    async def send(self, forward: float) -> Details:
        told = await self.ask(**self.sample(forward))
        self.seq += 1
        return told

    async def begin(self, driver: str = "keys") -> Hand:
        await asyncio.sleep(0.001)  # what is asked at the time of a stop was asked before it
        self.lease = int(str((await self.ask(do="manual_begin", driver=driver))["lease"]))
        self.seq = 0
        await self.send(0.0)
        await asyncio.sleep(0.1)
        return self

    async def hold_key(self, forward: float = 0.5, for_s: float = 0.5) -> None:
        for _ in range(round(for_s / EVERY_S)):
            await self.send(forward)
            await asyncio.sleep(EVERY_S)


@pytest.fixture
def run(tmp_path: Path) -> Run:
    rig = Rig(tmp_path)
    rig.set(manual={"allowed": True})
    return Run(rig)


@pytest.fixture
def hand(run: Run) -> Hand:
    return Hand(run)


def goes(wheels: WheelCommand, way: float) -> bool:
    return wheels.left * way > 0.1 < wheels.right * way


@played
async def test_person_drives_a_disarmed_rover_and_it_is_disarmed_again(run: Run, hand: Hand) -> None:
    await hand.begin()
    assert (run.mode, run.wheels) == ("manual", STOP)
    await hand.hold_key()
    assert goes(run.wheels, 1.0)
    told = await run.status()
    assert (told["mode"], told["phase"], told["why_disarmed"]) == ("manual", "manual", None)
    assert await hand.send(0.0) == {"wheels": list(run.wheels), "why_not": ""}
    assert await hand.ask(do="manual_end", lease=hand.lease) == {"mode": "disarmed"}
    assert run.wheels == STOP
    await asyncio.sleep(1.0)
    assert run.wheels == STOP


@played
async def test_mission_goes_on_after_a_person_has_driven(run: Run, hand: Hand) -> None:
    await run.arm()
    mission = run.supervisor.controller.mission
    lease = (await hand.ask(do="manual_begin", driver="page"))["lease"]
    assert run.wheels == STOP, "it stops before the person has touched anything"
    hand.lease = int(str(lease))
    await hand.hold_key(0.0, 0.1)
    await hand.hold_key(-0.5)
    assert goes(run.wheels, -1.0)
    assert await hand.ask(do="manual_end", lease=lease) == {"mode": "armed"}
    await asyncio.sleep(1.0)
    assert (run.wheels, (await run.status())["held"]) == (STOP, True)
    await run.commands.resume(asked())
    await asyncio.sleep(1.0)
    assert goes(run.wheels, 1.0)
    assert run.supervisor.controller.mission is mission


@played
async def test_client_that_is_killed_stops_the_wheels_within_the_deadman_and_a_tick(run: Run, hand: Hand) -> None:
    await hand.begin()
    await hand.hold_key()
    now = asyncio.get_running_loop().time
    last_s = now() - EVERY_S  # of its last sample
    await asyncio.sleep(last_s + 0.25 - now())
    assert goes(run.wheels, 1.0)
    await asyncio.sleep(last_s + 0.3 + 0.05 + 0.001 - now())
    assert run.wheels == STOP
    await asyncio.sleep(2.0)
    assert run.mode == "disarmed"


@played
async def test_client_that_floods_holds_up_no_tick_and_drives_no_longer(run: Run, hand: Hand) -> None:
    await hand.begin()
    taken, ticks = 0, len(run.log.ticks)
    for number in range(4000):
        request = hand.sample(0.5, seq=number % 50 + 2, sent_s=0.5)
        try:
            await hand.ask(**request)
            taken += 1
        except RequestRefused:
            pass
        await asyncio.sleep(0.0005)
    assert (taken, run.wheels) == (0, STOP)
    assert len(run.log.ticks) - ticks == pytest.approx(40, abs=2)
    assert len(run.log.events) < 10, "no sample writes an event"


@pytest.mark.parametrize("by", ["disarm", "hold", "stop"])
@played
async def test_anybody_can_stop_a_person_who_drives(run: Run, hand: Hand, by: str) -> None:
    await hand.begin()
    await hand.hold_key()
    halts = run.rig.motors.halts
    told = await getattr(run.commands, by)()
    assert run.rig.motors.halts > halts
    assert run.wheels == STOP
    assert by != "hold" or told == {"held": False}
    with pytest.raises(RequestRefused):
        for _ in range(5):  # the client does not know yet
            await hand.send(0.5)
            await asyncio.sleep(EVERY_S)
    assert run.wheels == STOP


# -- twenty ways to take the wheels that fail -------------------------------------------------------------------------

Way = Callable[[Hand], Awaitable[object]]


async def _old_lease(hand: Hand) -> object:
    old = hand.lease
    await hand.ask(do="manual_end", lease=old)
    await asyncio.sleep(0.1)
    await hand.begin()
    await hand.hold_key()
    return await hand.ask(**hand.sample(lease=old))


WHILE_ANOTHER_DRIVES: dict[str, Way] = {
    "a second client": lambda hand: hand.ask(do="manual_begin", driver="page"),
    "arming": lambda hand: hand.ask(do="arm"),
    "a new goal": lambda hand: hand.ask(do="goal", heading_deg=180.0),
    "resuming": lambda hand: hand.ask(do="resume"),
    "a guessed lease": lambda hand: hand.ask(**hand.sample(lease=hand.lease ^ 1)),
    "lease 0": lambda hand: hand.ask(**hand.sample(lease=0)),
    "no lease": lambda hand: hand.ask(**{key: value for key, value in hand.sample().items() if key != "lease"}),
    "an old lease": _old_lease,
    "ending it with a guessed lease": lambda hand: hand.ask(do="manual_end", lease=1),
    "a repeated sample": lambda hand: hand.ask(**hand.sample(seq=hand.seq)),
    "an old number": lambda hand: hand.ask(**hand.sample(seq=1)),
    "an old time": lambda hand: hand.ask(**hand.sample(sent_s=asyncio.get_running_loop().time() - 0.31)),
    "the future": lambda hand: hand.ask(**hand.sample(sent_s=asyncio.get_running_loop().time() + 0.1)),
    "time zero": lambda hand: hand.ask(**hand.sample(sent_s=0)),
    "no number": lambda hand: hand.line(msgspec.json.encode(hand.sample()).replace(b"-1.0", b"NaN")),
    "no number, without the socket": lambda hand: hand.run.commands.manual_drive(
        hand.lease, hand.seq + 1, float("nan"), 0.0, asyncio.get_running_loop().time()
    ),
    "infinity": lambda hand: hand.line(msgspec.json.encode(hand.sample()).replace(b"-1.0", b"1e999")),
    "more than full": lambda hand: hand.ask(**hand.sample(forward=-1.5)),
    "true": lambda hand: hand.ask(**hand.sample(forward=True)),
    "a text": lambda hand: hand.ask(**hand.sample() | {"forward": "-1"}),
    "a number that is a fraction": lambda hand: hand.ask(**hand.sample(seq=hand.seq + 0.5)),
    "a key more": lambda hand: hand.ask(**hand.sample(force=True)),
    "a driver who says too much": lambda hand: hand.ask(do="manual_begin", driver="x\n" * 30),
}


@pytest.mark.parametrize("way", WHILE_ANOTHER_DRIVES)
@played
async def test_wheels_cannot_be_taken_from_a_person_who_drives(run: Run, hand: Hand, way: str) -> None:
    await hand.begin()
    await hand.hold_key()
    with pytest.raises(WayfarerError):
        await WHILE_ANOTHER_DRIVES[way](hand)
    await hand.hold_key(for_s=0.2)
    assert run.mode == "manual"
    assert goes(run.wheels, 1.0), "the person drives on ahead"


async def _after(ends: Way, hand: Hand) -> None:
    """Drive, let something end it, and go on as if nothing had happened; one may not begin again, either."""
    await hand.begin()
    await hand.hold_key()
    await ends(hand)
    await hand.send(0.5)


async def _fault(hand: Hand) -> None:
    for _ in range(80):  # said twice; the board is asked once a second
        hand.run.rig.motors.health_now = MotorHealth(12.0, ("motor A: drive fault",))
        await hand.send(0.5)
        await asyncio.sleep(EVERY_S)
    raise RequestRefused("it stands, and the person is told why" if hand.run.wheels == STOP else "")


async def _replayed(hand: Hand) -> None:
    """Lines that somebody has recorded are sent again, in their order, after the person has ended."""
    await hand.begin()
    lines = []
    for _ in range(10):
        lines.append(msgspec.json.encode(hand.sample(0.5)))
        await hand.line(lines[-1])
        hand.seq += 1
        await asyncio.sleep(EVERY_S)
    await hand.ask(do="manual_end", lease=hand.lease)
    for line in lines:
        with pytest.raises(RequestRefused):
            await hand.line(line)
    await hand.begin()
    for line in lines:
        await hand.line(line)


async def _while_checked(hand: Hand) -> None:
    hand.run.rig.motors.open = lambda: asyncio.sleep(1.0)  # type: ignore[method-assign]
    arming = asyncio.create_task(hand.ask(do="arm"))
    await asyncio.sleep(0.5)
    try:
        await hand.begin()
    finally:
        await arming


async def _disarmed_meanwhile(hand: Hand) -> None:
    hand.run.rig.motors.open = lambda: asyncio.sleep(1.0)  # type: ignore[method-assign]
    begins = asyncio.create_task(hand.begin())
    await asyncio.sleep(0.5)
    await hand.ask(do="disarm")
    await begins


async def _while_arming(hand: Hand) -> None:
    await hand.ask(do="arm")
    await hand.begin()


async def _often(hand: Hand) -> None:
    for _ in range(20):
        await hand.begin()
        await hand.ask(do="manual_end", lease=hand.lease)


WHERE_NOBODY_DRIVES: dict[str, Way] = {
    "without beginning": lambda hand: hand.send(1.0),
    "after disarming": lambda hand: _after(lambda it: it.ask(do="disarm"), hand),
    "after a hold": lambda hand: _after(lambda it: it.ask(do="hold"), hand),
    "after its end": lambda hand: _after(lambda it: it.ask(do="manual_end", lease=it.lease), hand),
    "after a silence": lambda hand: _after(lambda _: asyncio.sleep(2.1), hand),
    "during a fault of the board": lambda hand: _after(_fault, hand),
    "with lines of before": _replayed,
    "while the rover is checked": _while_checked,
    "while it is disarmed during the check": _disarmed_meanwhile,
    "while it arms": _while_arming,
    "too often": _often,
}


@pytest.mark.parametrize("way", WHERE_NOBODY_DRIVES)
@played
async def test_wheels_cannot_be_taken_where_nobody_may_drive(run: Run, hand: Hand, way: str) -> None:
    with pytest.raises((RequestRefused, NotArmed)) as refused:
        await WHERE_NOBODY_DRIVES[way](hand)
    assert str(refused.value)
    await run.commands.disarm()
    await asyncio.sleep(DELAY_S + 1.0)
    assert run.wheels == STOP


@virtual
async def test_nobody_drives_where_the_rover_file_does_not_allow_it(tmp_path: Path) -> None:
    async with Run(Rig(tmp_path)) as run:
        with pytest.raises(
            RequestRefused, match=r"not allowed: set allowed = true in .manual. .* wayfarer run --manual"
        ):
            await Hand(run).begin()
        assert run.mode == "disarmed"


@pytest.mark.parametrize(
    ("state", "text"),
    [
        ({"health_now": MotorHealth(12.0, ("motor A: drive fault",))}, "motor faults: "),
        ({"deadman_s": None}, "cannot stop the wheels by itself"),
        ({"dead": True}, "no answer"),
    ],
)
@played
async def test_motors_are_checked_as_before_arming(run: Run, hand: Hand, state: dict[str, Any], text: str) -> None:
    vars(run.rig.motors).update(state)
    with pytest.raises(RequestRefused, match=text):
        await hand.begin()
    assert run.mode == "disarmed"


@played
async def test_dead_compass_keeps_nobody_from_driving(run: Run, hand: Hand) -> None:
    run.rig.compass.dead, run.rig.compass.error = True, NotResponding("no answer")
    await asyncio.sleep(6.0)
    await hand.begin()
    await hand.hold_key()
    assert goes(run.wheels, 1.0)
