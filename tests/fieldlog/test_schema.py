"""The schema in ``docs/reference/log.md``: what runs write is in its tables, and what is in its tables is written."""

from __future__ import annotations

import ast
import asyncio
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import pytest

import wayfarer
from tests.kit.logs import read_log
from tests.logview.outing import outing
from wayfarer.config.own_file import used
from wayfarer.config.rover_file import load_rover
from wayfarer.control.tick import TickRecord
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_log import GroundTruthLog, field_log
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.fieldlog import wording
from wayfarer.fieldlog.folders import run_folders
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.record import KINDS, SCHEMA, Compass, Contact, Manual, Motion, Record, Wheels
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import CompassReading, ContactReading, MotionReading, PositionFix, WheelReading
from wayfarer.logview import summary
from wayfarer.readings import Value
from wayfarer.safety.manual import ManualSample
from wayfarer.simhal.build_rover import device_depth
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.world import Slope
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import GroundName, Physics, Terrain
from wayfarer.simhal.world.world import World

README = Path(__file__).resolve().parents[2] / "docs" / "reference" / "log.md"
CODE = Path(wayfarer.__file__).parent

Json = dict[str, Any]
Keys = dict[str, set[str]]
OF_EVENT = {"name", "text", "severity", "run", "mission"}
BESIDE = {"t_s", *OF_EVENT - {"name"}}
TOTALS = {"mission_s", "mission_m", "mission_anomalies", "mission_ended"}
# Told with all that is kept of it; of one that was cut off the totals are not known.
OF_LAST_MISSION = {
    "last_mission": {"last_run", "armed_t_wall", *TOTALS}, "unclean_shutdown": {"last_run", "armed_t_wall"},
}  # fmt: skip
# What no run here has: a Raspberry Pi, a real receiver, a calibration.
UNSAID = {
    "run": {"calibration", "simulated", "dry_run", "mujoco"},
    "board": {"faults"},
    "computer": {"cpu_c", "throttled", "disk_read_only", "disk_memory", "log_dropped"},
    "position": {"utc_s", "error_m"},
    "outcome": {"dropped"},
}
EVERY = set(Record.__struct_fields__)


@cache
def sections() -> dict[str, list[list[str]]]:
    """The rows of each table of the schema, as cells, by the word that its heading begins with."""
    found: dict[str, list[list[str]]] = defaultdict(list)
    title = ""
    for line in README.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            title = line.removeprefix("## ").partition(":")[0].strip("`")
        elif line.startswith("| `"):
            found[title].append([cell.strip() for cell in line.strip("|").split("|")])
    return found


def words(cell: str) -> set[str]:
    return set(re.findall(r"`(\w+)`", cell))


def documented(kind: str) -> set[str]:
    return {key for row in sections()[kind] for key in words(row[0])}


def documented_events() -> Keys:
    return {name: words(row[1]) for row in sections()["Events"] for name in words(row[0])}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Json]]:
    """What a daemon writes, a trial with touch, and a receiver."""
    folder = tmp_path_factory.mktemp("logs")
    with pytest.MonkeyPatch.context() as environment:
        for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"):
            environment.delenv(name, raising=False)
        environment.setenv("XDG_STATE_HOME", str(folder))
        asyncio.run(outing(folder / "logs", drive_s=0.5))
    trial = TrialSpec(3, "cv-pledge", generate_forest(1, 0, 0), 5, load_rover("sim"), budget_m=25.0)
    run_trial(trial, folder / "trial")
    fixes = FieldLog(Sink(folder / "receiver"), {})
    fixes.position(PositionFix(1.0, 50.9, -1.4, None))
    fixes.close("requested", "enough")
    harmed = FieldLog(Sink(folder / "harmed"), {})
    world = World(trial.forest, trial.rover.vehicle, Physics(), RandomStreams(0))
    GroundTruthLog(harmed, world).note(1.0, Fault(1.0, 2.0, "world", "slope", Slope(pitch_deg=20.0)), begins=True)
    harmed.close("requested", "enough")
    rigid, _ = field_log(
        replace(trial, terrain=Terrain()),
        folder / "mujoco",
        world,
        device_depth(world, RandomStreams(0), trial.rover),
    )
    rigid.close("requested", "enough")
    on_mud = replace(trial, budget_m=1.0, ground=GroundName.mud)
    (mine := folder / "mine.py").touch()
    own = used({"mine.py:It": f"{mine}:It"})
    run_trial(replace(on_mud, physics=Physics(slope_deg=5.0, blind_share=0.1), files=own), folder / "mud")
    driven, tick = FieldLog(Sink(folder / "driven"), {}), TickRecord(1.0)
    tick.manual = ManualSample(1, 1.0, 0.0, 0.9)
    tick.rims = WheelReading(1.0, 0.01, None, 0.5, 0.0)
    driven.tick(tick)
    driven.close("requested", "enough")
    places = {"daemon": run_folders(folder / "logs")[0]} | {
        name: folder / name for name in ("trial", "receiver", "harmed", "mujoco", "mud", "driven")
    }
    return {name: read_log(place) for name, place in places.items()}


def told_events() -> Keys:
    """The events that the code tells, with the keys of each: of calls of a logger, now or as a callback."""
    found: Keys = {}
    texts = (path.read_text(encoding="utf-8") for path in CODE.rglob("*.py"))
    for text in (each for each in texts if ".logger" in each or ".conclude(" in each):
        for call in ast.walk(ast.parse(text)):
            if isinstance(call, ast.Call):
                keys = {keyword.arg for keyword in call.keywords if keyword.arg} - BESIDE
                found |= {name: keys for part in event_of(call) for name in constants(part)}
    return found


def event_of(call: ast.Call) -> Iterator[ast.AST]:
    """What follows a logger's method, or ``conclude`` of a tick and its severity, in a call: the name of an event."""
    for before, part in pairwise([call.func, *call.args]):
        if isinstance(before, ast.Attribute) and "logger." in ast.unparse(before):
            yield part
    if isinstance(call.func, ast.Attribute) and call.func.attr == "conclude":
        yield call.args[1]


def constants(node: ast.AST) -> Iterator[str]:
    """The texts that an argument may be."""
    if isinstance(node, ast.IfExp):
        yield from constants(node.body)
        yield from constants(node.orelse)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "event"])
def test_table_has_every_key_of_a_kind(kind: str) -> None:
    assert set(KINDS[kind].__struct_fields__) - EVERY == documented(kind)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "event"])
def test_every_key_of_a_kind_is_written_by_some_run(runs: dict[str, list[Json]], kind: str) -> None:
    real = [record for records in runs.values() for record in records if record["record"] == kind]
    said = {key for record in real for key, value in record.items() if value not in (None, (), {}, [])}
    assert documented(kind) - said <= UNSAID.get(kind, set())


def test_table_of_every_record_is_that_of_the_base() -> None:
    assert documented("Every record") == {"record", *EVERY}


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (Compass, CompassReading),
        (Motion, MotionReading),
        (Contact, ContactReading),
        (Wheels, WheelReading),
        (Manual, ManualSample),
    ],
)
def test_reading_in_the_log_has_the_fields_of_the_reading(ours: type[msgspec.Struct], theirs: type[Value]) -> None:
    assert ours.__struct_fields__ == theirs.__match_args__


def test_events_of_a_run_have_the_keys_of_the_table(runs: dict[str, list[Json]]) -> None:
    events = [record for record in runs["daemon"] if record["record"] == "event"]
    assert {event["name"] for event in events} >= {"armed", "mark", "hold", "resume", "goal", "disarmed", "health"}
    for event in events:
        assert set(event) - EVERY - {"record", *OF_EVENT} <= documented_events()[event["name"]]
        assert event["text"] != event["name"]
        assert event["run"]


def test_events_that_the_code_can_tell_are_those_of_the_table() -> None:
    assert told_events() | OF_LAST_MISSION == documented_events()


def test_page_names_every_kind_of_record_and_the_version_of_the_schema() -> None:
    assert set(KINDS) <= words(next(row[1] for row in sections()["Every record"] if row[0] == "`record`"))
    assert next(row[1] for row in sections()["run"] if row[0] == "`schema`") == str(SCHEMA)


def test_tools_over_logs_know_only_events_that_there_are() -> None:
    assert set(documented_events()) >= wording.PERSON | summary.FAILURES
