"""Another stack without ROS: the messages of ``rosbags``, a planner, and wayfarer's simulated rover as its base."""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np
from rosbags.typesys.stores import ros2_humble as ros
from wayfarer_failsafe.guard import Guard, GuardSettings, Output, State
from wayfarer_failsafe.messages import STANDSTILL, Speeds, wheels_of, write_speeds

from wayfarer.config.rover_file import load_rover
from wayfarer.export.mcap_scene import enu_rotation
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FLOW_M_PER_COUNT, FlowSensorModel, HeadingSensorModel
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

PERIOD_S = 0.05
VEHICLE = load_rover("sim").vehicle
SETTINGS = GuardSettings(
    length_m=VEHICLE.length_m, width_m=VEHICLE.width_m, track_m=VEHICLE.track_m, max_speed_m_s=VEHICLE.max_speed_m_s,
    cruise_m_s=1.0,
)  # fmt: skip

Vector3 = ros.geometry_msgs__msg__Vector3
HEADER = ros.std_msgs__msg__Header(ros.builtin_interfaces__msg__Time(0, 0), "base_link")


def imu(heading_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0, covariance: float = 0.0) -> Any:
    q, none = ros.geometry_msgs__msg__Quaternion(*enu_rotation(heading_deg, pitch_deg, roll_deg)), np.zeros(9)
    known = np.array([covariance] + [0.0] * 8)
    return ros.sensor_msgs__msg__Imu(HEADER, q, known, Vector3(0.0, 0.0, 0.0), none, Vector3(0.0, 0.0, 0.0), none)


def odometry(ahead_m_s: float, left_m_s: float = 0.0, variance: float = 0.01) -> Any:
    origin = ros.geometry_msgs__msg__Pose(
        ros.geometry_msgs__msg__Point(0.0, 0.0, 0.0), ros.geometry_msgs__msg__Quaternion(0.0, 0.0, 0.0, 1.0)
    )
    pose = ros.geometry_msgs__msg__PoseWithCovariance(origin, np.zeros(36))
    moved = ros.geometry_msgs__msg__TwistWithCovariance(twist(ahead_m_s, 0.0, left_m_s), np.full(36, variance))
    return ros.nav_msgs__msg__Odometry(HEADER, "base_link", pose, moved)


def twist(ahead_m_s: float, turn_rad_s: float, left_m_s: float = 0.0) -> Any:
    return ros.geometry_msgs__msg__Twist(Vector3(ahead_m_s, left_m_s, 0.0), Vector3(0.0, 0.0, turn_rad_s))


class Base:
    """The simulated rover behind ROS messages: an IMU, odometry that does not come from the wheels, and a Twist."""

    def __init__(self, forest: int) -> None:
        streams = RandomStreams(forest)
        self.world = World(generate_forest(forest, noise=0, seed=0), VEHICLE, Physics(), streams)
        self._compass, self._flow = HeadingSensorModel(self.world, streams), FlowSensorModel(self.world, streams)

    @property
    def is_out(self) -> bool:
        return not (0.0 <= self.world.x_m <= 50.0 and 0.0 <= self.world.y_m <= 50.0)

    def messages(self, t_s: float) -> tuple[Any, Any]:
        attitude_deg = (tenths / 10.0 for tenths in self._compass.sample(t_s))  # heading, pitch, roll
        forward, right = self._flow.sample(t_s)
        speeds_m_s = (counts * FLOW_M_PER_COUNT / PERIOD_S for counts in (forward, -right))
        return imu(*attitude_deg), odometry(*speeds_m_s)

    def obey(self, message: Any) -> None:
        speeds = Speeds(message.linear.x, message.angular.z)
        self.world.command(*wheels_of(speeds, VEHICLE))


class Planner:
    """Steers for the goal in the north at 1 m/s, by the IMU; it knows nothing of trunks."""

    def plan(self, heading_deg: float) -> Any:
        error_deg = (heading_deg + 180.0) % 360.0 - 180.0  # clockwise of the goal: turn counter-clockwise
        return twist(1.0 if abs(error_deg) < 60.0 else 0.0, 3.0 * radians(error_deg))


def drive(forest: int, guard: Guard | None, time_s: float = 600.0) -> tuple[bool, float, list[Output]]:
    """Drive until out of the forest or out of time: whether it is out, when, and what the guard said."""
    base, planner, t_s, said = Base(forest), Planner(), 0.0, []
    while t_s < time_s and not base.is_out:
        seen, moved = base.messages(t_s)
        command = planner.plan(base.world.heading_rad * 180.0 / np.pi)
        if guard is not None:
            guard.take_imu(seen, t_s)
            guard.take_odometry(moved, t_s)
            guard.take_command(command, t_s)
            said.append(guard.tick(t_s))
            command = twist(*STANDSTILL)
            write_speeds(command, said[-1].speeds)
        base.obey(command)
        t_s += PERIOD_S
    return base.is_out, t_s, said


if __name__ == "__main__":
    for number in range(10):
        guard = Guard(SETTINGS)
        alone, alone_s, _ = drive(number, None)
        out, out_s, said = drive(number, guard)
        rescued_s = PERIOD_S * sum(each.state is State.RESCUE for each in said)
        print(f"{number}: alone out {alone} at {alone_s:.0f} s, with the node out {out} at {out_s:.0f} s,", end=" ")
        print(f"{guard.takeovers} takeovers, {rescued_s:.0f} s of rescue")
