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

import pytest

import wayfarer
from tests.views.text.outing import outing
from wayfarer.config.rover_file import load_rover
from wayfarer.control.tick import TickRecord
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_log import GroundTruthLog, field_log
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.fieldlog import wording
from wayfarer.fieldlog.folders import run_folders
from wayfarer.fieldlog.lines import KEYS, KINDS, READINGS
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.schema import SCHEMA, Record
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import PositionFix
from wayfarer.safety.manual import ManualSample
from wayfarer.simhal.build_rover import device_depth
from wayfarer.simhal.drawn_ranges import Range
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.world import Slope
from wayfarer.simhal.mujoco.terrain import Terrains
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import GroundName, Physics
from wayfarer.simhal.world.slope import Slopes
from wayfarer.simhal.world.world import World
from wayfarer.views.text import summary

README = Path(__file__).resolve().parents[2] / "docs" / "reference" / "log.md"
CODE = Path(wayfarer.__file__).parent

Keys = dict[str, set[str]]


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
    return {name: words(row[1]) for row in sections()["event"] for name in words(row[0])}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Record]]:
    """What a daemon writes, a trial with touch, a receiver, and a disk that was full for a while."""
    folder = tmp_path_factory.mktemp("logs")
    with pytest.MonkeyPatch.context() as environment:
        for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"):
            environment.delenv(name, raising=False)
        environment.setenv("XDG_STATE_HOME", str(folder))
        asyncio.run(outing(folder / "logs", drive_s=0.5))
    trial = TrialSpec(3, "cv-pledge", generate_forest(1, 0, 0), 5, load_rover("sim"), budget_m=5.0)
    run_trial(trial, folder / "trial")
    fixes = FieldLog(Sink(folder / "receiver"), {})
    fixes.position(PositionFix(1.0, 50.9, -1.4, None))
    fixes.close("requested", "enough")
    harmed = FieldLog(Sink(folder / "harmed"), {})
    world = World(trial.forest, trial.rover.vehicle, Physics(), RandomStreams(0))
    GroundTruthLog(harmed, world).note(1.0, Fault(1.0, 2.0, "world", "slope", Slope(pitch_deg=20.0)), begins=True)
    harmed.close("requested", "enough")
    rigid, _ = field_log(
        replace(trial, terrains=Terrains()),
        folder / "mujoco",
        world,
        device_depth(world, RandomStreams(0), trial.rover),
    )
    rigid.close("requested", "enough")
    on_mud = replace(trial, budget_m=1.0, ground=GroundName.mud)
    run_trial(replace(on_mud, slopes=Slopes(Range(5.0, 5.0)), physics=Physics(blind_share=0.1)), folder / "mud")
    driven, tick = FieldLog(Sink(folder / "driven"), {}), TickRecord(1.0)
    tick.manual = ManualSample(1, 1.0, 0.0, 0.9)
    driven.tick(tick)
    driven.close("requested", "enough")
    places = {"daemon": run_folders(folder / "logs")[0]} | {
        name: folder / name for name in ("trial", "receiver", "harmed", "mujoco", "mud", "driven")
    }
    return {name: list(RunReader(place)) for name, place in places.items()}


def told_events() -> Keys:
    """The events that the code tells, with the keys of each: of calls of ``event``, now or as a callback."""
    found: Keys = {}
    texts = (path.read_text(encoding="utf-8") for path in CODE.rglob("*.py"))
    for text in (each for each in texts if ".event" in each or ".conclude(" in each):
        for call in ast.walk(ast.parse(text)):
            if isinstance(call, ast.Call):
                keys = {keyword.arg for keyword in call.keywords if keyword.arg}
                found |= {name: keys for part in after_event(call) for name in constants(part)}
    return found


def after_event(call: ast.Call) -> Iterator[ast.AST]:
    """What follows a method ``event``, or ``conclude`` of a tick, in a call: its first argument."""
    for before, part in pairwise([call.func, *call.args]):
        if isinstance(before, ast.Attribute) and before.attr in {"event", "conclude"}:
            yield part


def constants(node: ast.AST) -> Iterator[str]:
    """The texts that an argument may be."""
    if isinstance(node, ast.IfExp):
        yield from constants(node.body)
        yield from constants(node.orelse)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "event"])
def test_keys_that_runs_write_are_those_of_the_table(runs: dict[str, list[Record]], kind: str) -> None:
    names = ("daemon", "trial", "receiver", "harmed", "mujoco", "mud", "driven")
    real = [record for name in names for record in runs[name] if record["record"] == kind]
    assert {key for record in real for key in record} - documented("Every record") == documented(kind)


# Free: numbers of any size that say what ran, and what a third party's parts and algorithm say of themselves.
UNJUDGED = {
    "run": {"seed", "algorithm_seed", "ladder_seed", "calibration", "world"},
    "tick": {"counter_deg", "side", "turn_deg", "episodes", "blocked_turns", "turn_from_duty"},
    "event": {"parts"},
}


@pytest.mark.parametrize("kind", KINDS)
def test_reader_judges_every_key_of_the_table(kind: str) -> None:
    keys = set().union(*documented_events().values(), {"name"}) if kind == "event" else documented(kind)
    assert set(KEYS[kind]) == keys - UNJUDGED.get(kind, set())


def test_reader_judges_every_number_of_a_reading(runs: dict[str, list[Record]]) -> None:
    ticks = [record for records in runs.values() for record in records if record["record"] == "tick"]
    for name, keys in READINGS.items():
        assert {key for tick in ticks if tick[name] for key in tick[name]} <= set(keys)


def test_every_record_has_the_keys_that_every_record_has(runs: dict[str, list[Record]]) -> None:
    for record in (record for name in ("daemon", "trial", "receiver") for record in runs[name]):
        without = {"crc", *(["n"] if record["record"] == "run" else [])}  # the reader takes the checksum off
        assert set(record) >= documented("Every record") - without


def test_events_of_a_run_have_the_keys_of_the_table(runs: dict[str, list[Record]]) -> None:
    events = [record for record in runs["daemon"] if record["record"] == "event"]
    assert {event["name"] for event in events} >= {"armed", "mark", "hold", "resume", "goal", "disarmed", "health"}
    for event in events:
        assert set(event) - documented("Every record") - {"name"} == documented_events()[event["name"]]


def test_events_that_the_code_can_tell_are_those_of_the_table() -> None:
    written_by_older_versions = {"log_gap": {"dropped"}}
    assert told_events() | written_by_older_versions == documented_events()


def test_page_names_every_kind_of_record_and_the_version_of_the_schema() -> None:
    assert set(KINDS) <= words(next(row[1] for row in sections()["Every record"] if row[0] == "`record`"))
    assert next(row[1] for row in sections()["run"] if row[0] == "`schema`") == str(SCHEMA)


def test_tools_over_logs_know_only_events_that_there_are() -> None:
    known = wording.PERSON | wording.WARNINGS | wording.FAULTS | summary.FAILURES
    assert known <= set(documented_events())
    assert set(wording.SENTENCES) == set(documented_events())
