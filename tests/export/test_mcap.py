"""A log as an MCAP file, read back by another library and compared with the log."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from tests.export.logs import HEADER, of_kind, stamped, tick
from tests.export.readers import Exported, read
from tests.logview.records import Json, event, noted, write
from wayfarer.angles import wrap180
from wayfarer.config.rover_file import load_rover
from wayfarer.escape.api import Anomaly
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.export.mcap import write_mcap
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import AnyRecord, Board, Header, Tick, Truth
from wayfarer.simhal.world.generate import generate_forest

JSON_TYPES: dict[str, Any] = {"number": (int, float), "boolean": bool, "string": str}


@pytest.fixture(scope="module")
def trial_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a simulated trial with a few episodes; only to be read."""
    folder = tmp_path_factory.mktemp("trial")
    run_trial(TrialSpec(3, "forest-pledge", generate_forest(1, 0, 0), 5, load_rover("sim"), budget_m=25.0), folder)
    return folder


@pytest.fixture(scope="module")
def records(trial_log: Path) -> list[AnyRecord]:
    return list(RunReader(trial_log))


@pytest.fixture(scope="module")
def exported(trial_log: Path, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return export(trial_log, tmp_path_factory.mktemp("exported") / "run.mcap")


def export(run: Path, out: Path) -> Exported:
    with out.open("wb") as file:
        write_mcap(run, file)
    return read(out)


def round_trip(folder: Path, *records: Json) -> Exported:
    return export(write(folder, records), folder / "run.mcap")


def header_of(records: list[AnyRecord]) -> Header:
    header = records[0]
    assert isinstance(header, Header)
    return header


def nanoseconds(time_s: float) -> int:
    return round(time_s * 1e6) * 1000


@pytest.mark.parametrize(
    ("topic", "kind", "keys"),
    [
        ("/time", Tick, ["t_s", "n"]),
        ("/heading", Tick, ["heading_deg", "goal_heading_deg"]),
        ("/tilt", Tick, ["pitch_deg", "roll_deg"]),
        ("/phase", Tick, ["phase", "why", "level"]),
        ("/counter", Tick, ["counter_deg", "side", "turn_deg", "episodes", "blocked_turns", "turn_from_duty"]),
        ("/wheels", Tick, ["wanted_left", "wanted_right", "applied_left", "applied_right"]),
        ("/motion", Tick, ["travelled_m", "covered_m", "path_m"]),
        ("/battery", Board, ["battery_v"]),
        ("/truth_contact", Truth, ["slipping", "touching"]),
    ],
)
def test_every_record_has_its_message_with_its_time_and_values(
    exported: Exported, records: list[AnyRecord], topic: str, kind: type[AnyRecord], keys: list[str]
) -> None:
    told = of_kind(records, kind)
    assert told
    messages = exported.messages[topic]
    assert [time_ns for time_ns, _ in messages] == [nanoseconds(record.t_s) for record in told]
    assert [[value[key] for key in keys] for _, value in messages] == [
        [each.memory[key] if isinstance(each, Tick) and key in each.memory else getattr(each, key) for key in keys]
        for each in told
    ]


def test_derived_values_are_those_of_the_log(exported: Exported, records: list[AnyRecord]) -> None:
    ticks = of_kind(records, Tick)
    since = [round(record.t_s - records[0].t_s, 6) for record in ticks]
    assert [value["elapsed_s"] for _, value in exported.messages["/time"]] == since
    for record, (_, heading), (_, anomalies), (_, phase) in zip(
        ticks, *(exported.messages[topic] for topic in ("/heading", "/anomalies", "/phase")), strict=True
    ):
        assert record.goal_heading_deg is not None
        assert record.heading_deg is not None
        assert heading["error_deg"] == wrap180(record.goal_heading_deg - record.heading_deg)
        assert anomalies == {kind.value: kind.value in record.anomalies for kind in Anomaly}
        assert phase["cause"] == (record.cause or "none")
    assert any(any(value.values()) for _, value in exported.messages["/anomalies"])


def test_pose_of_every_tick_is_dead_reckoning_from_the_forests_start(
    exported: Exported, records: list[AnyRecord]
) -> None:
    ticks = of_kind(records, Tick)
    world = header_of(records).world
    assert world is not None
    east_m, north_m = world.start_m
    for each, (_, pose) in zip(ticks, exported.messages["/pose"], strict=True):
        assert each.place is not None
        assert pose["translation"] == {"x": each.place.east_m + east_m, "y": each.place.north_m + north_m, "z": 0.0}


def test_true_pose_and_paths_are_those_of_the_log(exported: Exported, records: list[AnyRecord]) -> None:
    truth = of_kind(records, Truth)
    places = [(pose["translation"]["x"], pose["translation"]["y"]) for _, pose in exported.messages["/truth"]]
    assert places == [(record.x_m, record.y_m) for record in truth]
    points = exported.messages["/truth_track"][-1].value["entities"][0]["lines"][0]["points"]
    drawn = [(point["x"], point["y"]) for point in points]
    assert drawn[0] == places[0]
    assert set(drawn) <= set(places)
    assert len(drawn) > 50


def test_every_path_message_is_the_whole_path_so_far(exported: Exported) -> None:
    for topic in ("/track", "/truth_track"):
        lengths = [len(message.value["entities"][0]["lines"][0]["points"]) for message in exported.messages[topic]]
        assert lengths == sorted(lengths)
        assert len({message.value["entities"][0]["id"] for message in exported.messages[topic]}) == 1


def test_forest_and_bodies_are_there_from_the_beginning(exported: Exported, records: list[AnyRecord]) -> None:
    world = header_of(records).world
    assert world is not None
    (forest,) = exported.messages["/forest"]
    assert len(forest.value["entities"][0]["cylinders"]) == len(world.trunks_m) + len(world.trees_m)
    (bodies,) = exported.messages["/rover"]
    assert [entity["frame_id"] for entity in bodies.value["entities"]] == ["rover", "truth"]
    assert forest.time_ns == bodies.time_ns == nanoseconds(records[0].t_s)


def test_messages_come_in_the_order_of_the_log(exported: Exported) -> None:
    times = [message.time_ns for _, message in exported.all]
    assert times == sorted(times)


def test_schemas_say_what_every_value_means(exported: Exported) -> None:
    plots = {topic: schema for topic, schema in exported.schemas.items() if schema.encoding == "jsonschema"}
    assert len(plots) == 10
    for topic, schema in plots.items():
        declared = json.loads(schema.data)
        assert declared["type"] == "object"
        assert declared["title"] == schema.name == f"wayfarer.{topic[1:]}"
        assert all(field["description"] for field in declared["properties"].values())
        for _, value in exported.messages[topic]:
            for name, found in value.items():
                assert isinstance(found, JSON_TYPES[declared["properties"][name]["type"]]), f"{topic}.{name}"


def test_well_known_schemas_are_used_where_panels_know_them(exported: Exported) -> None:
    names = {topic: schema.name for topic, schema in exported.schemas.items() if schema.encoding == "protobuf"}
    scenes = dict.fromkeys(("/forest", "/rover", "/track", "/truth_track"), "foxglove.SceneUpdate")
    poses = dict.fromkeys(("/pose", "/truth"), "foxglove.FrameTransform")
    assert names == {**scenes, **poses, "/log": "foxglove.Log"}


def test_file_says_what_ran(trial_log: Path, records: list[AnyRecord], tmp_path: Path) -> None:
    export(trial_log, tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as file:
        reader = make_reader(file)
        (metadata,), (rover,) = list(reader.iter_metadata()), list(reader.iter_attachments())
    told, header = metadata.metadata, header_of(records)
    assert metadata.name == "wayfarer"
    assert told["exported_by"] == f"wayfarer {told['wayfarer_version']}"
    assert (told["rover"], told["algorithm"]) == (header.rover, header.algorithm)
    assert (rover.name, rover.media_type) == ("rover.json", "application/json")
    assert json.loads(rover.data) == header.config


def test_bytes_are_the_same_each_time(trial_log: Path, tmp_path: Path) -> None:
    for name in "ab":
        export(trial_log, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_clock_that_was_set_does_not_tear_the_file_apart(tmp_path: Path) -> None:
    """The last record says when the run was; two hours are missing from what the clock said before."""
    found = round_trip(
        tmp_path,
        {**HEADER, "t_wall": 1_000_000.0},
        {**tick(100.05), "t_wall": 1_000_000.05},
        {**event("clock_step", 1.0, by_s=7200.0), "t_wall": 1_007_201.0},
        {**tick(101.0), "t_wall": 1_007_201.0},
    )
    assert [message.time_ns for message in found.messages["/pose"]] == [1_007_200_050_000_000, 1_007_201_000_000_000]


def test_times_beyond_those_of_foxglove_are_its_last(tmp_path: Path) -> None:
    late = {"t_wall": 9e9}  # in the year 2255
    found = round_trip(tmp_path, HEADER | late, tick(100.05) | late)
    (pose,) = found.messages["/pose"]
    assert pose.time_ns == (2**32 - 1) * 10**9
    assert pose.value["timestamp"] == {"seconds": 2**32 - 1, "nanos": 0}


def test_log_panel_tells_events_by_their_severity(tmp_path: Path) -> None:
    found = round_trip(
        tmp_path,
        HEADER,
        noted(1.0, "hit log"),
        tick(102.0, anomalies=["immobilised"]),
        tick(102.05, anomalies=["immobilised", "nose_up"], phase="back_off"),
        event("health", 3.0, "Held", "warning", level="hold", cause="compass_stale"),
        event("motors_failed", 4.0, "The motors did not answer: no answer", "error"),
        event("made_up_tomorrow", 5.0, "Made up"),
        stamped("fault", 105.5, target="compass", begins=True) | {"kind": "silence"},
        stamped("outcome", 106.0, reason="requested", text="stopped", dropped=0),
    )
    lines = [(message.value["level"], message.value["message"]) for message in found.messages["/log"]]
    info, warning, error = 2, 3, 4
    assert lines == [
        (info, "run of forestrover, forest-pledge, wayfarer 9.9"),
        (info, "Mark: hit log"),
        (warning, "Stalled while following the goal"),
        (warning, "Nose up while backing off"),
        (warning, "Held"),
        (error, "The motors did not answer: no answer"),
        (info, "Made up"),
        (warning, "a fault begins: compass silence"),
        (info, "The run has ended: stopped"),
    ]


def test_position_has_its_error_as_a_variance(tmp_path: Path) -> None:
    fix = {"latitude_deg": 51.5, "longitude_deg": -0.5}
    known, unknown = stamped("position", 101.0, **fix, error_m=3.0), stamped("position", 102.0, **fix, error_m=None)
    first, second = (message.value for message in round_trip(tmp_path, HEADER, known, unknown).messages["/location"])
    assert (first["latitude"], first["longitude"]) == (51.5, -0.5)
    assert first["position_covariance"] == [9.0, 0, 0, 0, 9.0, 0, 0, 0, 0]
    assert (first["position_covariance_type"], second["position_covariance_type"]) == (1, 0)


def test_computer_and_battery_leave_out_what_cannot_be_read(tmp_path: Path) -> None:
    found = round_trip(
        tmp_path,
        HEADER,
        stamped("computer", 101.0, cpu_c=51.5, throttled=None, load_1min=0.5, disk_free_mb=None, log_dropped=0),
        stamped("board", 102.0, battery_v=None, faults=["overheated", "short circuit"]),
    )
    assert found.messages["/computer"][0].value == {"cpu_c": 51.5, "load_1min": 0.5, "log_dropped": 0}
    assert found.messages["/battery"][0].value == {"faults": "overheated, short circuit"}


def test_another_algorithms_memory_breaks_nothing(tmp_path: Path) -> None:
    said = {"counter_deg": "three", "episodes": [1], "place": "home", "path_m": "long", "mood": {"a": 1}}
    found = round_trip(tmp_path, HEADER, tick(101.0, memory={**said, "side": None}), tick(101.5))
    assert "/counter" not in found.messages
    assert [message.value["translation"]["x"] for message in found.messages["/pose"]] == [1.0, 1.5]
    assert [message.value["path_m"] for message in found.messages["/motion"]] == [0.5, 0.75]
    (further,) = found.messages["/further"]
    assert further.value == said, "what no other channel has"
