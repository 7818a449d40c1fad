"""The messages of a rosbag2: standard ones, with the definitions of ROS 2 Humble; later ones have the same bytes.

Axes and frames are those of REP 103 and REP 105: ``map`` and ``odom`` are where the log begins, ``base_link`` is the
rover. Readings are in the rover's axes already, and no log says where compass and receiver sit: ``imu_link`` and
``gps_link`` are at ``base_link``. Headings, and so the yaw of all orientations, count from magnetic north: 0 is
magnetic east.

* ``/imu/data``: each reading of the compass. Turn rate and acceleration are not measured, so that the first element of
  their covariance is -1. That of the orientation is all zero: not known. Both are as the message's definition says.
* ``/odom``: dead reckoning at each tick, from where the log begins. Its twist is the motion from one tick to the next.
  That message has no value for "unknown", and filters read zeros as certain: its covariances are ``DOUBT``, growing
  with the path, and ``UNMEASURED`` for height, roll and pitch.
* ``/tf``: the same place and orientation as a transform; ``/tf_static``: the frames that do not move.
* ``/fix``: the receiver; ``error_m`` is taken as the standard deviation to the north and to the east.
* ``/cmd_vel``: what the duties that the motors took mean on ideal ground.
* ``/diagnostics``: the gate's level and its cause at each tick, with ``elapsed_s``.
* ``/rosout``: events and anomalies in words. A warning: the rover drives on; an error: it stops.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import nan, radians
from typing import Any, Final, NamedTuple

import numpy as np
from rosbags.typesys.stores import ros2_humble as ros

from wayfarer.angles import displacement_m, wrap180
from wayfarer.fieldlog.dead_reckoning import GAP_S, ReckonedPose
from wayfarer.fieldlog.fields import number, table
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Fix, Tick
from wayfarer.fieldlog.typed import Header as RunHeader
from wayfarer.fieldlog.vocabulary import in_words, level_text
from wayfarer.fieldlog.wording import Tone
from wayfarer.views.enu import enu_rotation
from wayfarer.views.export.wall_time import SECOND_NS, nanoseconds
from wayfarer.views.receiver_fit import FREEDOM
from wayfarer.views.text.log_lines import log_lines

Time = ros.builtin_interfaces__msg__Time
DiagnosticArray = ros.diagnostic_msgs__msg__DiagnosticArray
DiagnosticStatus = ros.diagnostic_msgs__msg__DiagnosticStatus
KeyValue = ros.diagnostic_msgs__msg__KeyValue
Point = ros.geometry_msgs__msg__Point
Pose = ros.geometry_msgs__msg__Pose
PoseWithCovariance = ros.geometry_msgs__msg__PoseWithCovariance
Log = ros.rcl_interfaces__msg__Log
Quaternion = ros.geometry_msgs__msg__Quaternion
TFMessage = ros.tf2_msgs__msg__TFMessage
Transform = ros.geometry_msgs__msg__Transform
TransformStamped = ros.geometry_msgs__msg__TransformStamped
Twist = ros.geometry_msgs__msg__Twist
TwistWithCovariance = ros.geometry_msgs__msg__TwistWithCovariance
Vector3 = ros.geometry_msgs__msg__Vector3
Odometry = ros.nav_msgs__msg__Odometry
Imu = ros.sensor_msgs__msg__Imu
NavSatFix = ros.sensor_msgs__msg__NavSatFix
NavSatStatus = ros.sensor_msgs__msg__NavSatStatus
Header = ros.std_msgs__msg__Header

TF_STATIC = "/tf_static"
TOPICS: dict[str, Any] = {
    "/imu/data": Imu,
    "/odom": Odometry,
    "/tf": TFMessage,
    TF_STATIC: TFMessage,
    "/fix": NavSatFix,
    "/cmd_vel": Twist,
    "/diagnostics": DiagnosticArray,
    "/rosout": Log,
}
MAP, ODOM, BODY, COMPASS, RECEIVER = "map", "odom", "base_link", "imu_link", "gps_link"
LOG_LEVELS = {Tone.WARNING: Log.WARN, Tone.FAULT: Log.ERROR}
# Diagnostics know three levels: a rover that drives on is not in error.
DIAGNOSTIC_LEVELS = {
    "well": DiagnosticStatus.OK,
    "note": DiagnosticStatus.WARN,
    "degrade": DiagnosticStatus.WARN,
    "hold": DiagnosticStatus.ERROR,
    "fault": DiagnosticStatus.ERROR,
}
UNKNOWN_3 = np.zeros(9)  # a covariance of Imu
NOT_MEASURED_3 = np.array([-1.0] + [0.0] * 8)
SERVICE_UNKNOWN = 0  # as the definition of NavSatStatus calls it since ROS 2 Jazzy
ZERO = Vector3(0.0, 0.0, 0.0)
# Standard deviations of dead reckoning: of the path's length, of the heading in radians, of speeds in m/s and rad/s.
DOUBT: Final = FREEDOM
UNMEASURED: Final = 1e6  # a variance that filters take as "nothing is known"


class Stamped(NamedTuple):
    """A message with its topic and its time, seconds since 1970."""

    topic: str
    time_s: float
    message: Any


class RosMessages:
    """Makes messages of the records of one run, given in their order.

    Args:
        zero_s: the time since 1970 at which the log's clock was zero.
    """

    def __init__(self, zero_s: float) -> None:
        self._zero_s = zero_s
        self._fold = RunFold()
        self._began = False

    @property
    def header(self) -> RunHeader:
        """Return what ran."""
        return self._fold.state.header

    def take(self, record: Record) -> Iterator[Stamped]:
        """Give the messages of the next record."""
        time_s = self._zero_s + record["t_s"]
        if not self._began:
            self._began = True
            yield Stamped(TF_STATIC, time_s, _static_frames(time_s))
        for event in self._fold.take(record):
            match event:
                case Fix():
                    yield Stamped("/fix", time_s, _nav_sat_fix(event, time_s))
                case Tick():
                    yield from (Stamped("/imu/data", time_s, imu) for imu in self._imus(event))
                    yield from (Stamped("/odom", time_s, odometry) for odometry in _odometries(event, time_s))
                    yield from (Stamped("/tf", time_s, moved) for moved in _transforms(event, time_s))
                    yield from (Stamped("/cmd_vel", time_s, twist) for twist in self._commands(event))
                    yield Stamped("/diagnostics", time_s, self._diagnostics(event, time_s))
                case _:
                    for name, text, tone in log_lines(event):
                        level = LOG_LEVELS.get(tone, Log.INFO)
                        log = Log(_time(time_s), level, f"wayfarer.{name}", text, "", "", 0)
                        yield Stamped("/rosout", time_s, log)

    def _imus(self, tick: Tick) -> Iterator[Imu]:
        """Give what the compass said, once for each reading; a tick has the newest, however old it is."""
        compass = table(tick.record, "compass")
        heading_deg = number(compass, "heading_deg")
        if "compass" not in tick.fresh or heading_deg is None:
            return
        rotation = _rotation(heading_deg, number(compass, "pitch_deg"), number(compass, "roll_deg"))
        header = _header(self._zero_s + compass["t_s"], COMPASS)
        yield Imu(header, rotation, UNKNOWN_3, ZERO, NOT_MEASURED_3, ZERO, NOT_MEASURED_3)

    def _commands(self, tick: Tick) -> Iterator[Twist]:
        """Give the speeds of the duties, where the log says what rover it is."""
        header, left, right = self._fold.state.header, tick.applied_left, tick.applied_right
        speed_m_s, track_m = header.setting("vehicle", "max_speed_m_s"), header.setting("vehicle", "track_m")
        if speed_m_s is not None and track_m and left is not None and right is not None:
            yield _twist((left + right) / 2.0 * speed_m_s, 0.0, (right - left) * speed_m_s / track_m)

    def _diagnostics(self, tick: Tick, time_s: float) -> DiagnosticArray:
        level, cause = tick.level or "unknown", tick.cause
        values = {
            "elapsed_s": f"{tick.elapsed_s:.3f}",
            "n": str(tick.n),
            "level": level,
            "cause": cause or "",
            "phase": tick.phase or "",
            "anomalies": " ".join(tick.anomalies),
        }
        status = DiagnosticStatus(
            level=DIAGNOSTIC_LEVELS.get(level, DiagnosticStatus.STALE),
            name="wayfarer: gate",
            message=": ".join(filter(None, [level_text(level, cause), in_words(cause or "")])),
            hardware_id=self._fold.state.header.rover or "",
            values=[KeyValue(key, value) for key, value in values.items()],
        )
        return DiagnosticArray(_header(time_s, ""), [status])


def _odometries(tick: Tick, time_s: float) -> Iterator[Odometry]:
    """Give where the rover is; not where nothing is known of how it came there."""
    before, place = tick.before, tick.place
    if before is None or place is None or not 0.0 < tick.period_s <= GAP_S:
        return
    pose = Pose(Point(place.east_m, place.north_m, 0.0), _rotation(place.heading_deg, tick.pitch_deg, tick.roll_deg))
    where = PoseWithCovariance(pose, _planar_covariance(DOUBT * tick.path_m, DOUBT))
    moved = TwistWithCovariance(_moved(before, place), _planar_covariance(DOUBT, DOUBT))
    yield Odometry(_header(time_s, ODOM), BODY, where, moved)


def _planar_covariance(along_sigma: float, turn_sigma: float) -> Any:
    """Return the covariance of what is known along x and y and about z, row by row, from standard deviations."""
    variance, turn_variance = along_sigma**2, turn_sigma**2
    return np.diag([variance, variance, UNMEASURED, UNMEASURED, UNMEASURED, turn_variance]).ravel()


def _transforms(tick: Tick, time_s: float) -> Iterator[TFMessage]:
    if (place := tick.place) is not None:
        rotation = _rotation(place.heading_deg, tick.pitch_deg, tick.roll_deg)
        yield TFMessage([_transform(time_s, ODOM, BODY, Vector3(place.east_m, place.north_m, 0.0), rotation)])


def _static_frames(time_s: float) -> TFMessage:
    frames = ((MAP, ODOM), (BODY, COMPASS), (BODY, RECEIVER))
    level = Quaternion(0.0, 0.0, 0.0, 1.0)
    return TFMessage([_transform(time_s, parent, child, ZERO, level) for parent, child in frames])


def _transform(time_s: float, parent: str, child: str, moved_m: Vector3, rotation: Quaternion) -> TransformStamped:
    return TransformStamped(_header(time_s, parent), child, Transform(moved_m, rotation))


def _time(time_s: float) -> Time:
    return Time(*divmod(nanoseconds(time_s), SECOND_NS))


def _header(time_s: float, frame: str) -> Header:
    return Header(_time(time_s), frame)


def _rotation(heading_deg: float, pitch_deg: float | None, roll_deg: float | None) -> Quaternion:
    """Return an orientation; a tilt that is not known is none."""
    return Quaternion(*enu_rotation(heading_deg, pitch_deg or 0.0, roll_deg or 0.0))


def _moved(before: ReckonedPose, now: ReckonedPose) -> Twist:
    """Return the mean speeds between two poses, in the rover's axes."""
    dt_s = now.t_s - before.t_s
    forward_m, right_m = displacement_m(-now.heading_deg, now.north_m - before.north_m, now.east_m - before.east_m)
    turned_rad = -radians(wrap180(now.heading_deg - before.heading_deg))
    return _twist(forward_m / dt_s, -right_m / dt_s, turned_rad / dt_s)


def _twist(forward_m_s: float, left_m_s: float, turn_rad_s: float) -> Twist:
    return Twist(Vector3(forward_m_s, left_m_s, 0.0), Vector3(0.0, 0.0, turn_rad_s))


def _nav_sat_fix(fix: Fix, time_s: float) -> NavSatFix:
    """Return what the receiver said; of the height it says nothing."""
    variance_m2 = (fix.error_m or 0.0) ** 2
    return NavSatFix(
        _header(time_s, RECEIVER),
        NavSatStatus(NavSatStatus.STATUS_FIX, SERVICE_UNKNOWN),
        fix.latitude_deg,
        fix.longitude_deg,
        nan,
        np.diag([variance_m2, variance_m2, 0.0]).ravel(),
        NavSatFix.COVARIANCE_TYPE_APPROXIMATED if variance_m2 else NavSatFix.COVARIANCE_TYPE_UNKNOWN,
    )
