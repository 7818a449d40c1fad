"""Messages of ROS 2, as rosbags has them, to wayfarer's readings and back."""

from __future__ import annotations

from math import nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys.stores import ros2_humble as ros
from wayfarer_failsafe.messages import (
    OdometrySum,
    Speeds,
    compass_reading,
    speeds_from,
    speeds_of,
    wheels_of,
    write_speeds,
)

from tests.ros2.stack import HEADER, VEHICLE, imu, odometry, twist
from wayfarer.angles import wrap180
from wayfarer.hal import WheelCommand


@given(st.floats(0.0, 359.9), st.floats(-80.0, 80.0), st.floats(-179.0, 179.0))
def test_attitude_is_that_of_the_message(heading_deg: float, pitch_deg: float, roll_deg: float) -> None:
    """Heading clockwise from north, nose up and right side down are positive; the message is written by REP 103."""
    reading = compass_reading(imu(heading_deg, pitch_deg, roll_deg), 5.0)
    assert reading is not None
    assert wrap180(reading.heading_deg - heading_deg) == pytest.approx(0.0, abs=1e-6)
    assert (reading.t_s, reading.pitch_deg, reading.roll_deg) == pytest.approx((5.0, pitch_deg, roll_deg), abs=1e-6)


def test_imu_without_an_orientation_has_none() -> None:
    assert compass_reading(imu(10.0, covariance=-1.0), 0.0) is None
    empty = imu(10.0)
    empty.orientation = ros.geometry_msgs__msg__Quaternion(0.0, 0.0, 0.0, 0.0)
    assert compass_reading(empty, 0.0) is None
    empty.orientation = ros.geometry_msgs__msg__Quaternion(nan, 0.0, 0.0, 1.0)
    assert compass_reading(empty, 0.0) is None


def test_odometry_is_added_up_until_it_is_taken() -> None:
    moved = OdometrySum()
    assert moved.take() is None
    for count in range(5):
        moved.add(odometry(0.5, left_m_s=-0.1), 0.02 * count)
    reading = moved.take()
    assert reading is not None
    assert reading == pytest.approx((0.08, 0.04, 0.008, 1.0, True))
    assert moved.take() is None


@pytest.mark.parametrize("unknown", [odometry(0.0, variance=1e6), odometry(0.0, variance=-1.0)])
def test_speed_that_nobody_knows_is_no_standstill(unknown: object) -> None:
    moved = OdometrySum()
    moved.add(odometry(0.5), 0.0)
    moved.add(unknown, 0.05)
    reading = moved.take()
    assert reading is not None
    assert reading.quality == 0.0


def test_odometry_that_is_no_number_counts_as_silence() -> None:
    moved = OdometrySum()
    moved.add(odometry(nan), 0.0)
    assert not moved.heard
    moved.add(odometry(0.5), 0.05)
    moved.add(odometry(0.5, left_m_s=nan), 0.1)
    assert moved.take() is None


def test_silence_between_two_messages_is_not_driven() -> None:
    moved = OdometrySum()
    moved.add(odometry(1.0), 0.0)
    moved.add(odometry(1.0), 7.0)
    assert moved.take() is None


def test_turn_to_the_left_is_counter_clockwise() -> None:
    left, right = wheels_of(Speeds(0.0, 1.0), VEHICLE)
    assert left == -right < 0.0
    assert speeds_from(WheelCommand(0.5, 0.5), VEHICLE) == (0.5 * VEHICLE.max_speed_m_s, 0.0)
    assert speeds_from(WheelCommand(0.2, -0.2), VEHICLE).turn_rad_s < 0.0


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_duties_and_speeds_are_each_others_inverse(left: float, right: float) -> None:
    assert wheels_of(speeds_from(WheelCommand(left, right), VEHICLE), VEHICLE) == pytest.approx((left, right), abs=1e-9)


def test_twist_is_read_and_written_with_and_without_a_stamp() -> None:
    for message in (twist(0.3, -pi), ros.geometry_msgs__msg__TwistStamped(HEADER, twist(0.3, -pi))):
        assert speeds_of(message) == (0.3, -pi)
        write_speeds(message, Speeds(0.1, 0.2))
        assert speeds_of(message) == (0.1, 0.2)
    assert speeds_of(twist(nan, 0.0)) is None
