"""Faults: each kind changes what the field code reads or is told, and leaves nothing behind when it ends."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path
from random import Random
from typing import Any

import pytest

from tests.config.rover_texts import load, rover_toml
from tests.virtual import asked, virtual
from wayfarer.config.factory import assemble
from wayfarer.config.rover_file import RoverConfig, laid_over, load_rover
from wayfarer.control.supervisor import first_cause
from wayfarer.errors import BadInput, NotResponding, WrongPart
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.hal import CompassReading
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.faults.bus import AllFF, BusFault, FlippedBits, Hang, LateBytes, LostBytes, Nack
from wayfarer.simhal.faults.injector import Injector
from wayfarer.simhal.faults.kinds import BEGINS_S as DEFAULT_BEGINS_S
from wayfarer.simhal.faults.kinds import KINDS, Fault, misfit, misplaced, parse_fault, parts_of
from wayfarer.simhal.faults.readings import Becomes, Drifts, FaultyPart, Frozen, LateAnswer, Saturated
from wayfarer.simhal.faults.wires import SERIAL, FaultySerial, FaultyWire, WiredPart, wired_part
from wayfarer.simhal.faults.wires import Hang as BusThatHangs
from wayfarer.simhal.faults.world import DeadBand, Drive, Slope
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.physics import Depth
from wayfarer.testing.faults import first_difference
from wayfarer.testing.scenario_run import RunRecorder

# Driving, with all that is read every so often read several times before the fault begins.
BEGINS_S, LASTS_S, ENDS_S = 3.0, 2.0, 5.5
RECEIVER: dict[str, Any] = {"parts": {"position": {"driver": "gpsd"}}, "safety": {"start_delay_s": 0.0}}
SERIAL_ROVER = "forestrover, with parts that answer on a serial line"
ON_SERIAL_LINES = {"compass": {"driver": "bno055", "port": "/dev/ttyAMA1"}, "motors": {"driver": "roboclaw"}}
# Parameters with which a kind does something within two seconds of driving ahead, if its defaults do not.
PARAMS: dict[tuple[str, str], Any] = {
    ("slope", "world"): Slope(pitch_deg=10.0),
    ("drive", "world"): Drive(left_gain=0.5),
    ("dead_band", "world"): DeadBand(duty=0.5),
    ("saturated", "motion"): Saturated(limit=0.01),
    ("lost_bytes", "motors"): LostBytes(chance=0.5),
    ("late_answer", "motors"): LateAnswer(by_s=0.12),
}
OF = {"compass": "heading_deg", "motion": "forward_m", "position": "latitude_deg"}
PARTS = ("compass", "motion", "motors", "position")  # a bumper in a clearing touches nothing
READ_AT_OPENING = {("motion", "wrong_id"), ("motors", "wrong_id")}


@cache
def with_receiver(rover: str) -> RoverConfig:
    if rover == SERIAL_ROVER:
        other = with_receiver("forestrover")
        return other.model_copy(update={"name": rover, "parts": other.parts | ON_SERIAL_LINES})
    return laid_over(load_rover(rover), RECEIVER)


def config_for(fault: Fault) -> RoverConfig:
    """Return a rover to which the fault can happen."""
    names = ("minirover", "forestrover") if fault.kind in {"battery", "undervoltage"} else ("forestrover", "minirover")
    configs = [with_receiver(name) for name in (*names, SERIAL_ROVER)]
    if not isinstance(fault.params, BusFault):
        return configs[0]
    return next(config for config in configs if misplaced(fault, config) is None)


def cases() -> list[Fault]:
    return [
        Fault(BEGINS_S, LASTS_S, target, name, params_of(name, target))
        for name, kind in KINDS.items()
        for target in kind.targets
        if target in (*PARTS, "world", "process")
    ]


def params_of(name: str, target: str) -> Any:
    params = PARAMS.get((name, target), KINDS[name]())
    if hasattr(params, "of") and target in OF:
        params = replace(params, of=OF[target])
    return params


@virtual
async def run(
    config: RoverConfig, fault: Fault | None, look: Callable[[TrialSetup], object]
) -> tuple[RunRecorder, list[object]]:
    """Drive ahead in a clearing; look at the stage before the fault begins, and after it has ended."""
    monitor, looks, loop = RunRecorder(), [], asyncio.get_running_loop()
    given = () if fault is None else (fault,)
    setup = TrialSetup(
        TrialSpec(0, "forest-pledge", CLEARING, 1, config, depth=Depth.BUS, faults=given), lambda *_: monitor
    )
    monitor.follow(setup)
    if setup.injector is not None:
        setup.injector.start(setup.world, setup.supervisor.inbox.put_power, [monitor.note])
    running = asyncio.ensure_future(setup.supervisor.run())
    await asyncio.sleep(1.0)
    await setup.supervisor.arm(asked(), 0.0)
    for at_s in (BEGINS_S - 0.001, BEGINS_S + LASTS_S + 0.001):
        await asyncio.sleep(at_s - loop.time())
        looks.append(look(setup))
    loop.call_later(ENDS_S - loop.time(), setup.supervisor.finish, "requested", "enough was seen")
    try:
        await running
    except Exception as error:
        monitor.event("ended", loop.time(), error=repr(first_cause(error)))
    if setup.injector is not None:
        setup.injector.end()
    return monitor, looks


@cache
def run_well(rover: str) -> RunRecorder:
    return run(with_receiver(rover), None, lambda _: None)[0]


def tampering(fault: Fault, config: RoverConfig) -> Callable[[TrialSetup], object]:
    """Return what tells everything that a fault may have changed, in a stage's injection, chips and world."""

    def look(setup: TrialSetup) -> object:
        assert setup.injector is not None
        world, part = setup.world, getattr(setup.rover, fault.target, None)
        state: list[object] = [
            world.body_faults,
            round(world.field_deg, 6),
            (world.ground_pitch_deg, world.ground_roll_deg, world.battery_v),
            world.after_step.__qualname__,
        ]
        if isinstance(part, FaultyPart):
            state += [list(part.changes), part.silent, part.crash, part.answers_after_s]
        if isinstance(fault.params, BusFault):
            place = wired_part(fault.target, config, setup.injector.buses)
            state += [list(place.wire.answers), list(place.wire.writes), list(place.wire.unheard)]
            state += [vars(place.hang)["_hangs"], list(getattr(place.chip, "shows", []))]
            state += [getattr(place.chip, name, None) for name in ("squal", "shutter", "calibration", "drive_faults")]
        return repr(state)

    return look


@pytest.mark.parametrize(
    "fault",
    [fault for fault in cases() if (fault.target, fault.kind) not in READ_AT_OPENING],
    ids=lambda fault: f"{fault.target}-{fault.kind}",
)
def test_kind_changes_something_and_leaves_nothing_behind(fault: Fault) -> None:
    config = config_for(fault)
    faulty, (before, after) = run(config, fault, tampering(fault, config))
    difference = first_difference(faulty, run_well(config.name))
    assert difference is not None
    assert difference.t_s >= BEGINS_S
    assert before == after


@pytest.mark.parametrize("target", ["motion", "motors"])
@virtual
async def test_part_that_says_it_is_another_does_not_open(target: str) -> None:
    fault = Fault(BEGINS_S, LASTS_S, target, "wrong_id")
    opened: list[str] = []
    setup = TrialSetup(
        TrialSpec(0, "forest-pledge", CLEARING, 1, config_for(fault), depth=Depth.BUS, faults=(fault,)),
        lambda *_: RunRecorder(),
    )
    assert setup.injector is not None
    setup.injector.start(setup.world, setup.supervisor.inbox.put_power)
    for at_s in (1.0, BEGINS_S + 0.1, BEGINS_S + LASTS_S + 0.1):
        await asyncio.sleep(at_s - asyncio.get_running_loop().time())
        try:
            await getattr(setup.rover, target).open()
            opened.append("opens")
        except WrongPart:
            opened.append("is another")
    setup.injector.end()
    assert opened == ["opens", "is another", "opens"]


def test_every_kind_is_tried() -> None:
    assert {fault.kind for fault in cases()} == set(KINDS)


@pytest.mark.parametrize("fault", cases(), ids=lambda fault: f"{fault.target}-{fault.kind}")
@virtual
async def test_fault_that_lasts_is_ended_with_the_run(fault: Fault) -> None:
    config, noted = config_for(fault), []
    spec = TrialSpec(0, "forest-pledge", CLEARING, 1, config, depth=Depth.BUS, faults=(fault,))
    setup = TrialSetup(spec, lambda *_: RunRecorder())
    injector, look = setup.injector, tampering(fault, config)
    assert injector is not None
    before = look(setup)
    injector.start(setup.world, setup.supervisor.inbox.put_power, [lambda _, fault, *, begins: noted.append(begins)])
    await asyncio.sleep(BEGINS_S + 0.5)
    injector.end()
    await asyncio.sleep(LASTS_S)
    assert look(setup) == before
    assert noted == [True]


def test_fault_of_a_part_that_the_rover_has_not_is_refused() -> None:
    with pytest.raises(BadInput, match=r"rover 'minirover': 'lost_bytes' does not apply to driver = \"thunderborg\""):
        injector_of("minirover", Fault(1.0, 1.0, "motors", "lost_bytes"))
    with pytest.raises(BadInput, match=r"rover 'minirover' has no contact"):
        injector_of("minirover", Fault(1.0, 1.0, "contact", "silent"))


def injector_of(rover: str, fault: Fault) -> None:
    config = load_rover(rover)
    Injector((fault,), config, 0).instrument(assemble(config, FakeBuses()))


@virtual
async def test_frozen_part_repeats_what_it_said_last() -> None:
    part = FaultyPart(FakeCompass())
    last = await part.read()
    with Frozen().effect(part, Random(0)):
        again = await part.read()
    assert again.heading_deg == last.heading_deg
    assert again.t_s > last.t_s
    assert (await part.read()).heading_deg != last.heading_deg


@virtual
async def test_late_answer_carries_the_time_at_which_it_was_given() -> None:
    part, loop = FaultyPart(FakeCompass()), asyncio.get_running_loop()
    with LateAnswer(by_s=0.2).effect(part, Random(0)):
        await part.read()
    assert loop.time() == pytest.approx(0.2)


@virtual
async def test_drift_begins_at_nothing_and_grows() -> None:
    part = FaultyPart(FakeCompass())
    with Drifts(per_s=100.0).effect(part, Random(0)):
        readings = [await part.read() for _ in range(3)]
    assert [reading.heading_deg for reading in readings] == [0.0, 101.0, 202.0]


@virtual
async def test_so_many_transfers_are_lost_and_no_more() -> None:
    wire = FaultyWire("a bus")
    place = WiredPart("", None, "", None, wire, BusThatHangs("a bus"))
    with Nack(most=2).effect(place, Random(0)):
        for _ in range(2):
            with pytest.raises(NotResponding):
                wire.check()
        wire.check()


@virtual
async def test_transfer_on_a_hanging_bus_ends_at_its_deadline_and_happens_late() -> None:
    hang, done, loop = BusThatHangs("a bus"), [], asyncio.get_running_loop()
    hang.begin()
    with pytest.raises(NotResponding, match=r"a transfer did not end within 0\.1 s"):
        await hang.carry(lambda: done.append("first"))
    assert loop.time() == pytest.approx(0.1)
    with pytest.raises(NotResponding, match=r"an earlier transfer still hangs"):
        await hang.carry(lambda: done.append("second"))
    hang.post(lambda: done.append("stop"))
    assert done == []
    hang.end()
    assert done == ["first", "stop"]


class Answers:
    """A chip on a serial line that answers with what it heard."""

    def receive(self, data: bytes) -> bytes:
        return data


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (Nack(), r"a port: no complete answer within 0\.05 s, nothing came"),
        (AllFF(), "FF FF FF FF"),
        (FlippedBits(), "(?!01 02 03 04)(.. ){3}.."),
        (LostBytes(chance=0.5), r"a port: no complete answer within 0\.05 s, only (.. ?){1,3} came"),
        (Hang(), r"a port: a transfer did not end within 0\.1 s"),
        (LateBytes(by_s=0.03), "01 02 03 04"),
        (LateBytes(), r"a port: no complete answer within 0\.05 s, nothing came"),
    ],
)
@virtual
async def test_answer_on_a_serial_line_can_fail_in_every_way(fault: BusFault, says: str) -> None:
    port = FaultySerial("a port")
    port.attach(Answers())
    place = WiredPart("", None, SERIAL, port.chip, port.wire, port.hang)

    async def said() -> str:
        try:
            return (await port.exchange(bytes((1, 2, 3, 4)), lambda came: 4 - len(came))).hex(" ").upper()
        except NotResponding as error:
            return str(error)

    with fault.effect(place, Random(0)):
        assert re.fullmatch(says, text := await said()), text
    assert await said() == "01 02 03 04"


@virtual
async def test_late_answer_is_taken_for_that_to_the_next_question() -> None:
    """As on a real line: only a checksum over question and answer tells them apart."""
    port, loop = FaultySerial("a port"), asyncio.get_running_loop()
    port.attach(Answers())
    with LateBytes(by_s=0.06).effect(WiredPart("", None, SERIAL, port.chip, port.wire, port.hang), Random(0)):
        with pytest.raises(NotResponding):
            await port.exchange(b"\x01", lambda came: 1 - len(came))
        assert await port.exchange(b"\x02", lambda came: 1 - len(came)) == b"\x01"
        assert loop.time() == pytest.approx(0.06)
        await asyncio.sleep(0.2)
        with pytest.raises(NotResponding):
            await port.exchange(b"\x03", lambda came: 1 - len(came))


class FakeCompass:
    """A compass that turns by a degree each time it is read, once a second."""

    name = "compass"

    def __init__(self) -> None:
        self._reads = 0

    async def read(self) -> CompassReading:
        self._reads += 1
        return CompassReading(float(self._reads), self._reads - 1.0, 0.0, 0.0, 3)


# -- the option --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("silent:compass", Fault(DEFAULT_BEGINS_S, inf, "compass", "silent")),
        ("silent:compass@20", Fault(20.0, inf, "compass", "silent")),
        ("silent:compass@20.5+3", Fault(20.5, 3.0, "compass", "silent")),
        ("nack:motors@0+0.25", Fault(0.0, 0.25, "motors", "nack")),
        ("snag@7", Fault(7.0, inf, "world", "snag")),
        ("becomes", Fault(DEFAULT_BEGINS_S, inf, "motion", "becomes", Becomes("quality"))),
        ("drive", Fault(DEFAULT_BEGINS_S, inf, "world", "drive", Drive(left_gain=0.0, right_gain=1.0))),
        ("slope", Fault(DEFAULT_BEGINS_S, inf, "world", "slope", Slope(pitch_deg=25.0))),
    ],
)
def test_option_is_a_fault_of_its_kind(text: str, fault: Fault) -> None:
    assert parse_fault(text) == fault


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_can_be_asked_for_at_each_of_its_parts(name: str) -> None:
    for part in parts_of(KINDS[name](**KINDS[name].typical)):
        assert parse_fault(f"{name}:{part}").target == part


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("silnt:compass", "unknown kind of fault 'silnt': did you mean silent?"),
        ("", "unknown kind of fault ''"),
        ("silent:compas", "unknown part for --fault silent 'compas': did you mean compass?"),
        ("silent", "--fault silent: name the part: silent:compass, silent:motion, silent:contact"),
        ("offset:motion", "known: compass"),
        ("silent:compass@soon", "'soon' is not a time from 0 to 1,000,000 s"),
        ("silent:compass@", "'' is not a time"),
        ("silent:compass@5+", "'' is not a time"),
        ("silent:compass@-1", "'-1' is not a time"),
        ("silent:compass@nan", "'nan' is not a time"),
        ("silent:compass@5+inf", "'inf' is not a time"),
        ("silent:compass@5+0", "must last longer than 0 s"),
    ],
)
def test_option_that_is_no_fault_is_refused(text: str, says: str) -> None:
    with pytest.raises(BadInput) as refused:
        parse_fault(text)
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("text", "rover", "depth", "says"),
    [
        ("nack:compass", "sim", Depth.DEVICE, 'it needs depth "bus"'),
        ("silent:contact", "minirover", Depth.DEVICE, "no [parts.contact]"),
        ("same_picture", "forestrover", Depth.BUS, 'does not apply to driver = "pmw3901"'),
        ("silent:compass", "minirover", Depth.DEVICE, None),
        ("nack:compass", "minirover", Depth.BUS, None),
    ],
)
def test_rover_and_depth_decide_what_can_happen(text: str, rover: str, depth: Depth, says: str | None) -> None:
    why = misfit(parse_fault(text), load_rover(rover), depth)
    assert why == says or (says and says in (why or ""))


def test_rover_without_parts_in_its_file_has_all_but_a_receiver(tmp_path: Path) -> None:
    bare = load(tmp_path, rover_toml())
    assert misfit(parse_fault("silent:contact"), bare, Depth.DEVICE) is None
    assert misfit(parse_fault("silent:position"), bare, Depth.DEVICE) == "rover 'test' has no [parts.position]"
