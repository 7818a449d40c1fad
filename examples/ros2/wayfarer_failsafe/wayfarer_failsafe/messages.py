"""ROS messages to wayfarer's readings and back; pure, and without ROS: any object with the message's fields will do.

ROS (REP 103): x ahead, y left, z up; a yaw counts counter-clockwise from east, a pitch is positive nose down.
wayfarer: a heading counts clockwise from north, a pitch is positive nose up. A roll is right side down in both.
A fixed error of the yaw (magnetic declination, or an IMU that begins at 0) does not matter: goal and heading share it.
"""

from __future__ import annotations

from math import asin, atan2, degrees, isfinite
from typing import Any, NamedTuple

from wayfarer.angles import clamp
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import CompassReading, MotionReading, WheelCommand

UNKNOWN_VARIANCE = 1e3  # (m/s)^2: filters mark a speed that nothing measures with such a variance, or a larger one


class Speeds(NamedTuple):
    """What a Twist asks of a base that cannot go sideways: m/s ahead, and rad/s counter-clockwise."""

    ahead_m_s: float
    turn_rad_s: float


STANDSTILL = Speeds(0.0, 0.0)


def compass_reading(imu: Any, t_s: float) -> CompassReading | None:
    """Return the attitude in a ``sensor_msgs/Imu``; None if it has none (its covariance begins with -1)."""
    q = imu.orientation
    size = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if imu.orientation_covariance[0] == -1.0 or not 0.5 < size < 2.0:  # a unit quaternion, or nothing
        return None
    roll = atan2(2.0 * (q.w * q.x + q.y * q.z), size - 2.0 * (q.x * q.x + q.y * q.y))
    pitch = asin(clamp(2.0 * (q.w * q.y - q.z * q.x) / size, -1.0, 1.0))
    yaw = atan2(2.0 * (q.w * q.z + q.x * q.y), size - 2.0 * (q.y * q.y + q.z * q.z))
    return CompassReading(t_s, (90.0 - degrees(yaw)) % 360.0, -degrees(pitch), degrees(roll), None)


class OdometrySum:
    """Adds up the speeds of ``nav_msgs/Odometry`` between two ticks; times are those at which messages came."""

    def __init__(self) -> None:
        self._came_s: float | None = None
        self._forward_m = self._right_m = 0.0
        self._sure_s = self._span_s = 0.0

    @property
    def heard(self) -> bool:
        """Whether a message ever came."""
        return self._came_s is not None

    def add(self, odometry: Any, t_s: float) -> None:
        """Take a message: its speed is taken as that since the message before, at most a second.

        One whose speed is not a number counts as silence.
        """
        moved = odometry.twist
        ahead_m_s, left_m_s = moved.twist.linear.x, moved.twist.linear.y
        if not isfinite(ahead_m_s + left_m_s):
            return
        before_s, self._came_s = self._came_s, t_s
        if before_s is None or not before_s < t_s <= before_s + 1.0:
            return
        dt_s = t_s - before_s
        self._span_s += dt_s
        if 0.0 <= moved.covariance[0] < UNKNOWN_VARIANCE:
            self._forward_m += ahead_m_s * dt_s
            self._right_m -= left_m_s * dt_s
            self._sure_s += dt_s

    def take(self) -> MotionReading | None:
        """Return the way since the last call, None without a message; an unknown speed does not count as 0."""
        if self._came_s is None or self._span_s == 0.0:
            return None
        sure = 1.0 if self._sure_s >= 0.5 * self._span_s else 0.0
        reading = MotionReading(self._came_s, self._forward_m, self._right_m, sure)
        self._forward_m = self._right_m = self._sure_s = self._span_s = 0.0
        return reading


def speeds_of(twist: Any) -> Speeds | None:
    """Return what a ``geometry_msgs/Twist`` or ``TwistStamped`` asks for; None if that is not a number."""
    twist = getattr(twist, "twist", twist)
    speeds = Speeds(twist.linear.x, twist.angular.z)
    return speeds if isfinite(sum(speeds)) else None


def write_speeds(twist: Any, speeds: Speeds) -> None:
    """Fill in a Twist or TwistStamped whose other speeds are zero."""
    twist = getattr(twist, "twist", twist)
    twist.linear.x, twist.angular.z = speeds


def wheels_of(speeds: Speeds, vehicle: Vehicle) -> WheelCommand:
    """Return the duties of both sides that give these speeds on ideal ground."""
    return vehicle.mix(speeds.ahead_m_s, -speeds.turn_rad_s)


def speeds_from(wheels: WheelCommand, vehicle: Vehicle) -> Speeds:
    """Return the speeds of duties: the inverse of ``wheels_of``."""
    left, right = wheels
    return Speeds(
        (left + right) / 2.0 * vehicle.max_speed_m_s, (right - left) * vehicle.max_speed_m_s / vehicle.track_m
    )
