"""Starts the fail-safe with its parameters, between the planner's ``cmd_vel_nav`` and the base's ``cmd_vel``."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

TOPICS = {"imu": "/imu/data", "odom": "/odometry/filtered", "cmd_vel_in": "/cmd_vel_nav", "cmd_vel_out": "/cmd_vel"}


def generate_launch_description() -> LaunchDescription:
    """Return the node, with an argument for each topic and one for the parameters' file."""
    parameters = Path(get_package_share_directory("wayfarer_failsafe")) / "config" / "failsafe.yaml"
    arguments = [DeclareLaunchArgument(name, default_value=topic) for name, topic in TOPICS.items()]
    node = Node(
        package="wayfarer_failsafe",
        executable="failsafe",
        name="wayfarer_failsafe",
        parameters=[LaunchConfiguration("parameters")],
        remappings=[(name, LaunchConfiguration(name)) for name in TOPICS],
        output="screen",
    )
    return LaunchDescription([*arguments, DeclareLaunchArgument("parameters", default_value=str(parameters)), node])
