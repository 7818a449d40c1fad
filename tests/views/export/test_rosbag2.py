"""A run as a rosbag2, read back by rosbags and by the mcap library with its decoder of ROS 2 messages."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from math import cos, degrees, hypot, isnan, radians, sin
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag2, QosDurability
from rosbags.rosbag2 import Reader

from tests.views.test_enu import Vector, body_axis
from tests.views.text.records import BEGAN_WALL_S, HEADER, drive, event, outcome, record, tick, write
from wayfarer.errors import BadInput
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Tick
from wayfarer.views.enu import enu_rotation
from wayfarer.views.export.export import ExportFormat, export
from wayfarer.views.export.wall_time import nanoseconds

TYPES = {
    "/imu/data": "sensor_msgs/msg/Imu",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/fix": "sensor_msgs/msg/NavSatFix",
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/rosout": "rcl_interfaces/msg/Log",
}
VEHICLE = {"max_speed_m_s": 1.0, "track_m": 0.5}
Messages = dict[str, list[tuple[int, Any]]]


def by_rosbags(bag: Path) -> Messages:
    """The messages of each topic with their times, nanoseconds."""
    found: Messages = defaultdict(list)
    with AnyReader([bag]) as reader:
        assert {topic: each.msgtype for topic, each in reader.topics.items()} == TYPES
        for connection, time_ns, data in reader.messages():
            found[connection.topic].append((time_ns, reader.deserialize(data, connection.msgtype)))
    return found


def by_mcap(bag: Path) -> Messages:
    found: Messages = defaultdict(list)
    with (bag / f"{bag.name}.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found[channel.topic].append((message.log_time, decoded))
    return found


def exported(folder: Path, *records: Record) -> Messages:
    bag, header = folder / "17.rosbag2", HEADER | {"config": {"vehicle": VEHICLE}}
    assert export(write(folder / "run", [header, *records]), ExportFormat.rosbag2, bag, overwrite=False) == Damage()
    return by_mcap(bag)


def compass(t_s: float, heading_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Record:
    """What a tick has of a reading; the log's clock began at 100 s."""
    tilt = {"pitch_deg": pitch_deg, "roll_deg": roll_deg, "calibration": 3}
    return {"t_s": 100.0 + t_s, "heading_deg": heading_deg, **tilt}


def turned(q: Any, axis: Vector) -> Vector:
    """A body's axis in the map."""
    return body_axis([q.x, q.y, q.z, q.w], axis)


def test_two_readers_read_the_same_of_a_whole_run(trial_log: Path, tmp_path: Path) -> None:
    bag = tmp_path / "17.rosbag2"
    assert export(trial_log, ExportFormat.rosbag2, bag, overwrite=False) == Damage()
    assert {each.name for each in bag.iterdir()} == {"metadata.yaml", "17.rosbag2.mcap"}
    first, second = by_rosbags(bag), by_mcap(bag)
    assert first.keys() == second.keys() == TYPES.keys() - {"/fix"}, "it has no receiver"
    for topic in first:
        assert [time_ns for time_ns, _ in first[topic]] == [time_ns for time_ns, _ in second[topic]]
    for (_, one), (_, other) in zip(first["/odom"], second["/odom"], strict=True):
        assert (one.pose.pose.position.x, one.twist.twist.angular.z) == (
            other.pose.pose.position.x, other.twist.twist.angular.z,
        )  # fmt: skip


def test_odometry_is_dead_reckoning_and_its_twist_adds_up_to_it(trial_log: Path, tmp_path: Path) -> None:
    bag = tmp_path / "17.rosbag2"
    export(trial_log, ExportFormat.rosbag2, bag, overwrite=False)
    fold = RunFold()
    told = [event for each in RunReader(trial_log) for event in fold.take(each)]
    places = [event.place for event in told if isinstance(event, Tick) and event.place]
    messages = [message for _, message in by_mcap(bag)["/odom"]]
    assert len(messages) == len(places) - 1
    transforms = [message.transforms for _, message in by_mcap(bag)["/tf"]]
    assert len(transforms) == len(places)
    for (before, place), odometry in zip(pairwise(places), messages, strict=True):
        position, dt_s = odometry.pose.pose.position, place.t_s - before.t_s
        assert (position.x, position.y, position.z) == (place.east_m, place.north_m, 0.0)
        twist = odometry.twist.twist
        ahead = turned(odometry.pose.pose.orientation, (1.0, 0.0, 0.0))
        level = hypot(ahead[0], ahead[1])
        assert (ahead[0] / level, ahead[1] / level) == pytest.approx(
            (sin(radians(place.heading_deg)), cos(radians(place.heading_deg)))
        )
        moved_m = hypot(place.north_m - before.north_m, place.east_m - before.east_m)
        assert hypot(twist.linear.x, twist.linear.y) * dt_s == pytest.approx(moved_m, abs=1e-9)
        turned_deg = (before.heading_deg - place.heading_deg + 180.0) % 360.0 - 180.0
        assert degrees(twist.angular.z) * dt_s == pytest.approx(turned_deg, abs=1e-6)
        assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")


def test_odometry_begins_again_after_missing_records(tmp_path: Path) -> None:
    messages = exported(tmp_path, *drive(0.0, 0.2), *drive(5.0, 5.2, heading_deg=90.0))["/odom"]
    assert len(messages) == 3 + 3
    forward = messages[-1][1].twist.twist.linear
    assert (forward.x, forward.y) == pytest.approx((0.5, 0.0))


def test_orientation_is_the_compass_s(tmp_path: Path) -> None:
    reading = compass(1.0, 123.0, pitch_deg=30.0, roll_deg=-20.0)
    ((_, imu),) = exported(tmp_path, tick(1.0, compass=reading))["/imu/data"]
    q = imu.orientation
    assert (q.x, q.y, q.z, q.w) == pytest.approx(enu_rotation(123.0, 30.0, -20.0), abs=1e-12)
    assert (imu.header.frame_id, list(imu.orientation_covariance)) == ("imu_link", [0.0] * 9)
    assert imu.angular_velocity_covariance[0] == imu.linear_acceleration_covariance[0] == -1.0


def test_frames_are_a_tree_from_the_map_to_the_sensors(tmp_path: Path) -> None:
    """Static frames come first, and are latched: a listener that starts late gets them too."""
    found = exported(tmp_path, *drive(0.0, 1.0, heading_deg=90.0))
    ((static_ns, static),) = found["/tf_static"]
    assert {(each.header.frame_id, each.child_frame_id) for each in static.transforms} == {
        ("map", "odom"), ("base_link", "imu_link"), ("base_link", "gps_link"),
    }  # fmt: skip
    moved = [(time_ns, *message.transforms) for time_ns, message in found["/tf"]]
    assert {(each.header.frame_id, each.child_frame_id) for _, each in moved} == {("odom", "base_link")}
    assert static_ns <= moved[0][0]
    last, odometry = moved[-1][1].transform, found["/odom"][-1][1].pose.pose
    assert (last.translation.x, last.translation.y) == (odometry.position.x, odometry.position.y)
    assert last.translation.x == pytest.approx(0.5, abs=0.03)
    assert turned(last.rotation, (1.0, 0.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)
    with Reader(tmp_path / "17.rosbag2") as reader:
        offered = {
            each.topic: each.ext.offered_qos_profiles
            for each in reader.connections
            if isinstance(each.ext, ConnectionExtRosbag2)
        }
    assert "    rover: minirover\n" in (tmp_path / "17.rosbag2" / "metadata.yaml").read_text(encoding="utf-8")
    (latched,) = offered.pop("/tf_static")
    assert latched.durability is QosDurability.TRANSIENT_LOCAL
    assert not any(offered.values())


def test_doubt_of_odometry_grows_with_the_path_and_what_is_not_measured_is_no_certainty(tmp_path: Path) -> None:
    messages = [message for _, message in exported(tmp_path, *drive(0.0, 2.0))["/odom"]]
    first, last = (list(each.pose.covariance)[::7] for each in (messages[0], messages[-1]))
    assert first[0] < last[0] == last[1] == pytest.approx((0.2 * 1.0) ** 2, rel=0.1)
    assert first[2:5] == last[2:5] == [1e6] * 3
    assert first[5] == last[5] == pytest.approx(0.04)


def test_events_and_anomalies_are_told_with_their_severity(tmp_path: Path) -> None:
    found = exported(
        tmp_path,
        event("mark", 1.0, text="hit log"),
        tick(2.0, anomalies=["immobilised"]),
        event("motors_failed", 3.0, error="no answer"),
        outcome(4.0),
    )["/rosout"]
    info, warning, error = 20, 30, 40
    assert [(each.level, each.name) for _, each in found] == [
        (info, "wayfarer.run"),
        (info, "wayfarer.mark"),
        (warning, "wayfarer.anomaly"),
        (error, "wayfarer.motors_failed"),
        (info, "wayfarer.outcome"),
    ]
    assert found[1][1].msg == "Mark: hit log"
    assert found[2][1].stamp.sec == BEGAN_WALL_S + 2


def test_each_reading_of_the_compass_is_told_once_at_its_time(tmp_path: Path) -> None:
    old, new = compass(0.9, 10.0), compass(1.9, 20.0)
    silent = compass(2.9, 30.0) | {"heading_deg": None}
    ticks = [tick(1.0, compass=old), tick(1.5, compass=old), tick(2.0, compass=new), tick(3.0, compass=silent)]
    found = exported(tmp_path, *ticks)["/imu/data"]
    assert [time_ns for time_ns, _ in found] == [round((BEGAN_WALL_S + t_s) * 1e9) for t_s in (1.0, 2.0)]
    assert [(imu.header.stamp.sec, imu.header.stamp.nanosec) for _, imu in found] == [
        (BEGAN_WALL_S, 900_000_000), (BEGAN_WALL_S + 1, 900_000_000),
    ]  # fmt: skip


def test_fix_has_its_error_as_a_variance(tmp_path: Path) -> None:
    place = {"latitude_deg": 51.5, "longitude_deg": -0.5}
    known, unknown = record("position", 0.5, **place, error_m=3.0), record("position", 1.5, **place, error_m=None)
    nowhere = record("position", 2.0, latitude_deg=None, longitude_deg=1.0, error_m=1.0)
    first, second = (message for _, message in exported(tmp_path, known, unknown, nowhere, tick(3.0))["/fix"])
    assert (first.latitude, first.longitude, isnan(first.altitude), first.status.status) == (51.5, -0.5, True, 0)
    assert list(first.position_covariance) == [9.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0]
    assert (first.position_covariance_type, second.position_covariance_type) == (1, 0)
    assert first.header.stamp.sec == BEGAN_WALL_S


def test_command_is_what_the_duties_mean_on_ideal_ground(tmp_path: Path) -> None:
    """Full duty is 1 m/s; on a track of 0.5 m, wheels at 0.25 and -0.25 m/s turn the body by 1 rad/s."""
    duties = [(0.5, 0.5), (-0.25, 0.25), (None, 0.5)]
    ticks = [tick(t_s, applied_left=left, applied_right=right) for t_s, (left, right) in enumerate(duties)]
    found = [message for _, message in exported(tmp_path, *ticks)["/cmd_vel"]]
    assert [(each.linear.x, each.linear.y, each.angular.z) for each in found] == [(0.5, 0.0, 0.0), (0.0, 0.0, 1.0)]


def test_command_needs_to_know_the_rover(tmp_path: Path) -> None:
    bag = tmp_path / "17.rosbag2"
    export(write(tmp_path / "run", [HEADER, tick(0.0)]), ExportFormat.rosbag2, bag, overwrite=False)
    assert "/cmd_vel" not in by_mcap(bag), "its rover file says no track"


def test_diagnostics_have_level_cause_and_elapsed_s(tmp_path: Path) -> None:
    levels = [("well", None), ("degrade", "battery_low"), ("hold", "compass_stale"), ("made_up", "tomorrow")]
    ticks = [tick(t_s, level=level, cause=cause, n=t_s + 1) for t_s, (level, cause) in enumerate(levels)]
    found = [message.status[0] for _, message in exported(tmp_path, *ticks)["/diagnostics"]]
    assert [each.level for each in found] == [0, 1, 2, 3]
    assert [each.message for each in found[::2]] == [
        "No faults", "Wheels held until this clears: the compass is silent",
    ]  # fmt: skip
    values = {each.key: each.value for each in found[2].values}
    assert values == {
        "elapsed_s": "2.000", "n": "3", "level": "hold", "cause": "compass_stale", "phase": "follow", "anomalies": "",
    }  # fmt: skip
    assert {(each.name, each.hardware_id) for each in found} == {("wayfarer: gate", "minirover")}


def test_no_time_is_before_1970() -> None:
    assert nanoseconds(-1.0) == 0


def test_times_beyond_those_of_ros_are_its_last(tmp_path: Path) -> None:
    late = tick(0.0) | {"t_wall": 9e9}
    ((time_ns, message),) = exported(tmp_path, late)["/diagnostics"]
    assert (time_ns, message.header.stamp.sec) == ((2**31 - 1) * 10**9, 2**31 - 1)


def test_same_log_gives_the_same_bytes(tmp_path: Path) -> None:
    records = [*drive(0.0, 1.0), event("mark", 1.0, text="here"), outcome(1.0)]
    for folder in (tmp_path / "a", tmp_path / "b"):
        exported(folder, *records)
    one, other = (
        {each.name: each.read_bytes() for each in (tmp_path / name / "17.rosbag2").iterdir()} for name in "ab"
    )
    assert one == other


@pytest.mark.parametrize("there", ["file", "folder", "link"])
def test_what_is_there_is_never_replaced(tmp_path: Path, there: str) -> None:
    out = tmp_path / "out"
    if there == "file":
        out.write_text("old", encoding="utf-8")
    elif there == "folder":
        out.mkdir()
    else:
        out.symlink_to(tmp_path / "nowhere")
    with pytest.raises(BadInput, match=r"^[^\n]*out exists already, and a folder is never replaced[^\n]*$"):
        export(write(tmp_path / "run", [HEADER, tick(0.0)]), ExportFormat.rosbag2, out, overwrite=True)
    assert {each.name for each in tmp_path.iterdir()} == {"run", "out"}
    assert not list(tmp_path.glob("out/*"))
