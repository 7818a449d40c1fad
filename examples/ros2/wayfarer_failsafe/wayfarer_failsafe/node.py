"""The ROS 2 node: topics and parameters around ``guard.Guard``, which decides. It has not run under ROS 2 yet."""

import signal
from dataclasses import fields

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu

from wayfarer_failsafe.guard import Guard, GuardSettings, Output, State
from wayfarer_failsafe.messages import STANDSTILL, Speeds, write_speeds

PERIOD_S = 0.05
TELL_S = 1.0  # diagnostics at least so often; a change is sent at once


class FailSafeNode(Node):
    """Subscribes to ``imu``, ``odom`` and ``cmd_vel_in``, and publishes ``cmd_vel_out`` and ``/diagnostics``."""

    def __init__(self) -> None:
        super().__init__("wayfarer_failsafe")
        given = {each.name: self.declare_parameter(each.name, each.default).value for each in fields(GuardSettings)}
        self.declare_parameter("enabled", True)
        self._twist = TwistStamped if self.declare_parameter("stamped", False).value else Twist
        self._guard = Guard(GuardSettings(**given))
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)  # a wall clock, or a simulated one, may jump
        self._told: tuple[State | None, float] = (None, 0.0)
        guard = self._guard
        heard = qos_profile_sensor_data  # best effort: it hears reliable publishers and those of their best effort
        self.create_subscription(Imu, "imu", lambda m: guard.take_imu(m, self._now_s()), heard)
        self.create_subscription(Odometry, "odom", lambda m: guard.take_odometry(m, self._now_s()), heard)
        self.create_subscription(self._twist, "cmd_vel_in", lambda m: guard.take_command(m, self._now_s()), 1)
        self._wheels = self.create_publisher(self._twist, "cmd_vel_out", 1)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(PERIOD_S, self._tick, clock=self._clock)

    def stop(self) -> None:
        """Publish zero speeds."""
        self._publish(STANDSTILL)

    def _now_s(self) -> float:
        return self._clock.now().nanoseconds * 1e-9

    def _tick(self) -> None:
        self._guard.enable(self.get_parameter("enabled").value)
        now_s = self._now_s()
        output = self._guard.tick(now_s)
        self._publish(output.speeds)
        state, told_s = self._told
        if output.state is not state or now_s - told_s >= TELL_S:
            self._told = (output.state, now_s)
            self._tell(output)
            if output.state is not state:
                self._log(output)

    def _log(self, output: Output) -> None:
        """Tell the operator by /rosout; each severity has a separate line, because rclpy lets none of them change."""
        if output.state.level == 0:
            self.get_logger().info(output.text)
        elif output.state.level == 1:
            self.get_logger().warning(output.text)
        else:
            self.get_logger().error(output.text)

    def _publish(self, speeds: Speeds) -> None:
        message = self._twist()
        if isinstance(message, TwistStamped):
            message.header.stamp, message.header.frame_id = self.get_clock().now().to_msg(), "base_link"
        write_speeds(message, speeds)
        self._wheels.publish(message)

    def _tell(self, output: Output) -> None:
        status = DiagnosticStatus(level=bytes([output.state.level]), name="wayfarer_failsafe", message=output.text)
        status.values = [KeyValue(key=key, value=value) for key, value in output.values.items()]
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def main() -> None:
    """Run the node until SIGINT or SIGTERM; its last command is a stop."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # rclpy's own would take the publishers down first
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # systemd and containers end a node by it
    node = FailSafeNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.stop()
        node.destroy_node()
        rclpy.shutdown()
