"""The field log: what a trial writes can be read back, and nothing that goes wrong in it reaches the rover."""

from __future__ import annotations

import json
from collections.abc import Mapping
from fractions import Fraction
from math import isnan
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import structlog
from structlog.testing import capture_logs

from tests.fieldlog.lines import standing
from tests.kit.logs import read_log
from wayfarer.config.rover_file import load_rover
from wayfarer.daemon.socket.protocol import WHOLE_MAX, check
from wayfarer.escape.api import Decision, Phase
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.record import AnyRecord, Event, Tick
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import CompassReading, MotionReading, WheelCommand
from wayfarer.logview.terminal import print_json
from wayfarer.safety.manual import ManualSample
from wayfarer.simhal.world.generate import generate_forest

SPEC = TrialSpec(3, "cv-pledge", generate_forest(1, 0, 0), 5, load_rover("sim"), budget_m=10.0)
BOOT_S = 1.7e9  # what a computer without a clock of its own believes until it finds the right time


def records(folder: Path) -> list[dict[str, Any]]:
    return [{"dropped": 0, **json.loads(line)} for line in (folder / "run.00001.jsonl").read_bytes().splitlines()]


def test_log_of_a_trial_begins_with_what_ran_and_ends_with_how_it_ended(tmp_path: Path) -> None:
    result = run_trial(SPEC, tmp_path)
    first, *_, last = found = records(tmp_path)
    assert (first["record"], first["algorithm"], first["seed"]) == ("run", "cv-pledge", 5)
    assert (last["record"], last["reason"], last["dropped"]) == ("outcome", result.outcome, 0)
    assert sum(record["record"] == "tick" for record in found) == result.ticks
    assert [record["t_s"] for record in found] == sorted(record["t_s"] for record in found)


def test_same_trial_writes_the_same_bytes_and_is_not_changed_by_its_log(tmp_path: Path) -> None:
    results = [run_trial(SPEC), run_trial(SPEC, tmp_path / "a"), run_trial(SPEC, tmp_path / "b")]
    assert results[0] == results[1] == results[2]
    assert (tmp_path / "a" / "run.00001.jsonl").read_bytes() == (tmp_path / "b" / "run.00001.jsonl").read_bytes()


def test_each_record_says_its_kind_in_its_bytes(tmp_path: Path) -> None:
    """A Struct that is compiled loses its tag, and says nothing of that."""
    run_trial(SPEC, tmp_path)
    kinds = {line[: line.index(b",")] for line in (tmp_path / "run.00001.jsonl").read_bytes().splitlines()}
    assert kinds == {b'{"record":"%s"' % kind for kind in (b"run", b"tick", b"event", b"board", b"truth", b"outcome")}


class Unspeakable:
    def __repr__(self) -> str:
        raise KeyError("a third party's")


def test_detail_that_is_no_json_is_told_by_its_repr_and_one_that_cannot_be_is_dropped(tmp_path: Path) -> None:
    log = FieldLog(Sink(tmp_path), {})
    log.logger.info("mark", t_s=1.0, text="Mark", what=Path("a"))
    log.logger.info("mark", t_s=2.0, text="Mark", what=Unspeakable())
    log.close("requested", "enough")
    assert [record.get("data") for record in records(tmp_path)[1:]] == [{"what": repr(Path("a"))}, None]
    assert records(tmp_path)[-1]["dropped"] == 1


def test_event_has_its_sentence_its_severity_and_the_context_that_was_bound(tmp_path: Path) -> None:
    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s)
    log.bind(run="00017-now")
    log.logger.info("arming", t_s=1.0, text="Arming", goal_heading_deg=None)
    log.bind(mission=2)
    log.logger.error("motors_failed", t_s=2.0, text="The motors did not answer: no power", error="no power")
    log.close("requested", "enough")
    _, arming, failed, _ = RunReader(tmp_path)
    assert arming == Event(n=1, t_s=1.0, elapsed_s=1.0, t_wall=1.0, name="arming", text="Arming", run="00017-now")
    assert isinstance(failed, Event)
    assert (failed.severity, failed.run, failed.mission, failed.data) == (
        "error", "00017-now", 2, {"error": "no power"},
    )  # fmt: skip


def test_events_of_a_tick_can_be_captured_as_those_of_any_structlog_logger(tmp_path: Path) -> None:
    hour_s = 0.0
    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s + hour_s)
    log.logger = structlog.get_logger()
    log.bind(mission=2)
    hour_s = 3600.0
    with capture_logs() as captured:
        log.tick(standing())
    text = "The computer's clock was set by +3600 s"
    assert captured == [
        {"event": "clock_step", "t_s": 1.0, "text": text, "by_s": 3600.0, "mission": 2, "log_level": "warning"}
    ]


def test_what_cannot_be_written_is_dropped_and_counted(tmp_path: Path) -> None:
    def fails() -> Mapping[str, float | str]:
        raise KeyError("a third party's memory")

    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s)
    log.tick(standing(memory=fails))
    log.tick(standing())
    log.close("requested", "enough")
    assert [record["record"] for record in records(tmp_path)] == ["run", "tick", "outcome"]
    assert records(tmp_path)[-1]["dropped"] == 1
    assert [record["n"] for record in records(tmp_path)[1:]] == [2, 3], "a reader sees that one is missing"


def test_every_viewer_sees_every_record_in_order_and_one_that_fails_costs_nobody_anything(tmp_path: Path) -> None:
    shown: list[AnyRecord] = []

    def failing(record: AnyRecord) -> None:
        if isinstance(record, Tick):
            raise RuntimeError("a bug in a viewer")

    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s, viewers=[failing, shown.append])
    log.tick(standing())
    log.tick(standing())
    log.close("requested", "enough")
    assert shown == list(RunReader(tmp_path))
    names = [record.get("name") for record in records(tmp_path)]
    assert names.count("viewer_failed") == 1


def test_memory_with_keys_of_the_log_costs_no_record(tmp_path: Path) -> None:
    """A third party's algorithm may remember anything."""
    log = FieldLog(Sink(tmp_path), {})
    kept: dict[str, float | str] = {"record": "x", "n": "x", "t_s": "x", "level": 2.0, "mood": "x"}
    log.tick(standing(memory=lambda: kept))
    log.close("requested", "enough")
    reader = RunReader(tmp_path)
    _, tick, _ = reader
    assert reader.damage == Damage()
    assert isinstance(tick, Tick)
    assert (tick.n, tick.level, tick.memory) == (1, "well", kept)


def nested(depth: int, text: str) -> dict[str, Any]:
    memory: dict[str, Any] = {"why": text}
    for _ in range(depth):
        memory = {"deeper": memory}
    return memory


@pytest.mark.parametrize("text", ["big", "Größe"])
@pytest.mark.parametrize("depth", [10, 98, 99, 300, 500, 700, 900, 2000])
def test_memory_of_any_depth_raises_nothing_into_the_tick_nor_into_a_reader(
    tmp_path: Path, depth: int, text: str
) -> None:
    shown: list[AnyRecord] = []
    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s, viewers=[shown.append])
    log.tick(standing(memory=lambda: nested(depth, text)))
    log.tick(standing())
    log.close("requested", "enough")
    reader = RunReader(tmp_path)
    assert list(reader) == shown
    assert sum(isinstance(record, Tick) for record in shown) == (2 if depth < 99 else 1)
    for record in shown:
        print_json(record)


class Own(str):
    """A third party's text."""


@pytest.mark.parametrize("value", [np.float32(0.5), np.float64(0.5), np.int64(1), Fraction(1, 2), 1, float("nan")])
def test_number_of_another_library_is_a_number_in_the_log(tmp_path: Path, value: Any) -> None:
    """An algorithm, or the driver of a camera, may compute with NumPy."""
    tick = standing(memory=lambda: {"x": value})
    tick.decision = Decision(WheelCommand(value, value), Phase.FOLLOW, Own("follow"))
    tick.motion, tick.compass = MotionReading(1.0, value, value, value), CompassReading(1.0, value, value, value, None)
    log = FieldLog(Sink(tmp_path), {})
    log.tick(tick)
    log.close("requested", "enough")
    reader = RunReader(tmp_path)
    _, told, _ = reader
    assert isinstance(told, Tick) and told.motion is not None and told.compass is not None
    wanted = None if isnan(value) else float(value)
    assert [told.wanted_left, told.motion.forward_m, told.compass.heading_deg, told.memory["x"]] == [wanted] * 4
    assert told.why == "follow"


def test_text_with_half_a_character_costs_no_record(tmp_path: Path) -> None:
    """The name of a file need not be UTF-8, and an error names it."""
    log = FieldLog(Sink(tmp_path), {})
    log.logger.warning("sensor_failed", t_s=1.0, text="The camera failed: \udcff", error="\udcff", counts={"\ud800": 1})
    log.tick(standing(memory=lambda: {"\ud800": "\ud800"}))
    log.close("requested", "\ud800")
    reader = RunReader(tmp_path)
    _, failed, tick, _ = reader
    assert reader.damage == Damage()
    assert isinstance(failed, Event) and failed.data == {"error": r"\udcff", "counts": {r"\ud800": 1}}
    assert isinstance(tick, Tick) and tick.memory == {r"\ud800": r"\ud800"}


@pytest.mark.parametrize("sent_s", [0.0, 1e9, 1e12])
def test_sample_of_any_time_that_a_client_may_send_costs_no_tick(tmp_path: Path, sent_s: float) -> None:
    tick = standing()
    fields = {"lease": 1, "seq": WHOLE_MAX, "forward": -1.0, "turn": 1.0, "sent_s": sent_s}
    sample = check({"do": "manual_drive", **fields}).keys
    tick.manual = ManualSample(*(sample[key] for key in ManualSample._fields))
    log = FieldLog(Sink(tmp_path), {})
    log.tick(tick)
    log.close("requested", "enough")
    _, told, _ = RunReader(tmp_path)
    assert isinstance(told, Tick) and told.manual is not None
    assert told.manual.sent_s == sent_s


@pytest.mark.parametrize("text", ["\x1b[2J", "\u202e", "a\x9bb", "\x07"])
def test_no_text_of_a_log_can_command_a_terminal(tmp_path: Path, text: str) -> None:
    shown: list[AnyRecord] = []
    log = FieldLog(Sink(tmp_path), {"rover": text}, wall=lambda t_s: t_s, viewers=[shown.append])
    log.logger.info("mark", t_s=1.0, text=f"Mark: {text}", note=[{"deep": text}])
    log.tick(standing(memory=lambda: {text: text}))
    log.close("requested", text)
    assert len(shown) == 4
    assert all(text not in str(msgspec.to_builtins(record)) for record in shown)
    assert all(ascii(text)[1:-1] in str(msgspec.to_builtins(record)).replace("\\\\", "\\") for record in shown)
    assert shown == list(RunReader(tmp_path)), "and a viewer has what a reader has"


@pytest.mark.parametrize("step_s", [3 * 3600.0, -3 * 3600.0, 86_400.0 * 400])
def test_clock_that_is_set_is_an_event_between_records_in_their_order(tmp_path: Path, step_s: float) -> None:
    """It changes neither the order of a log nor its numbers."""
    wall_offset_s = BOOT_S
    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s + wall_offset_s)
    for t_s in (0.0, 0.5, 1.0, 1.5, 2.0):
        if t_s == 1.0:
            wall_offset_s += step_s
        log.tick(standing(t_s))
    log.close("requested", "enough")
    _, *found = read_log(tmp_path)
    assert [record.get("name", record["record"]) for record in found] == [
        "tick", "tick", "clock_step", "tick", "tick", "tick", "outcome",
    ]  # fmt: skip
    assert [record["n"] for record in found] == [1, 2, 3, 4, 5, 6, 7]
    assert [record["t_s"] for record in found] == [0.0, 0.5, 1.0, 1.0, 1.5, 2.0, 2.0]
    assert found[2]["by_s"] == step_s
    assert [record["t_wall"] - record["t_s"] - BOOT_S for record in found] == [0.0, 0.0, *[step_s] * 5]


def test_clock_that_is_slewed_is_no_event(tmp_path: Path) -> None:
    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: BOOT_S + 1.0005 * t_s)
    for second in range(1000):
        log.tick(standing(float(second)))
    log.close("requested", "enough")
    assert {record["record"] for record in read_log(tmp_path)} == {"run", "tick", "outcome"}
