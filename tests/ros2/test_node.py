"""The node's glue, with stand-ins for rclpy and its messages: nobody has run it under ROS 2 yet."""

from __future__ import annotations

import ast
import signal
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
from wayfarer_failsafe.guard import GuardSettings

from tests.ros2.stack import imu, odometry, twist

PACKAGE = Path(__file__).parents[2] / "examples/ros2/wayfarer_failsafe"


class FakeNode:
    """What the glue uses of ``rclpy.node.Node``: topics and timers are kept, to be called by a test."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.parameters: dict[str, SimpleNamespace] = {}
        self.heard: dict[str, Callable[[Any], None]] = {}
        self.qos: dict[str, Any] = {}
        self.sent: dict[str, list[Any]] = {}
        self.told: list[tuple[str, str]] = []
        self.now_ns = 0

    def declare_parameter(self, name: str, value: Any) -> SimpleNamespace:
        return self.parameters.setdefault(name, SimpleNamespace(value=value))

    def get_parameter(self, name: str) -> SimpleNamespace:
        return self.parameters[name]

    def create_subscription(self, _kind: Any, topic: str, callback: Callable[[Any], None], qos: Any) -> None:
        self.heard[topic], self.qos[topic] = callback, qos

    def create_publisher(self, _kind: Any, topic: str, _qos: int) -> SimpleNamespace:
        return SimpleNamespace(publish=self.sent.setdefault(topic, []).append)

    def create_timer(self, period_s: float, callback: Callable[[], None], clock: Any) -> None:
        self.period_s, self.tick, self.clock = period_s, callback, clock

    def get_clock(self) -> SimpleNamespace:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: "now"))

    def get_logger(self) -> SimpleNamespace:
        levels = ("info", "warning", "error")
        return SimpleNamespace(**{level: lambda text, level=level: self.told.append((level, text)) for level in levels})


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    def stand_in(name: str, **content: Any) -> None:
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)

    def message(**fields: Any) -> SimpleNamespace:
        return SimpleNamespace(header=SimpleNamespace(), **fields)

    steady = SimpleNamespace(nanoseconds=0)
    stand_in("rclpy")
    stand_in(
        "rclpy.clock",
        Clock=lambda clock_type: SimpleNamespace(now=lambda: steady),
        ClockType=SimpleNamespace(STEADY_TIME=1),
    )
    stand_in("rclpy.node", Node=FakeNode)
    stand_in("rclpy.qos", qos_profile_sensor_data="best effort")
    stand_in("rclpy.signals", SignalHandlerOptions=SimpleNamespace(NO=0))
    stand_in("diagnostic_msgs.msg", DiagnosticArray=message, DiagnosticStatus=message, KeyValue=message)
    stand_in("geometry_msgs.msg", Twist=lambda: twist(0.0, 0.0), TwistStamped=type("TwistStamped", (), {}))
    stand_in("nav_msgs.msg", Odometry=None)
    stand_in("sensor_msgs.msg", Imu=None)
    monkeypatch.delitem(sys.modules, "wayfarer_failsafe.node", raising=False)
    made = import_module("wayfarer_failsafe.node").FailSafeNode()
    made.steady = steady
    yield made
    sys.modules.pop("wayfarer_failsafe.node")


def test_messages_go_in_and_a_twist_and_diagnostics_come_out(node: Any) -> None:
    for _ in range(30):
        node.steady.nanoseconds += 50_000_000
        node.heard["imu"](imu(90.0))
        node.heard["odom"](odometry(0.5))
        node.heard["cmd_vel_in"](twist(0.5, 0.1))
        node.tick()
    last, status = node.sent["cmd_vel_out"][-1], node.sent["/diagnostics"][-1].status[0]
    assert (last.linear.x, last.angular.z) == (0.5, 0.1)
    assert (status.level, status.message) == (b"\0", "the planner drives")
    assert {each.key: each.value for each in status.values}["heading_deg"] == "90.0"
    node.steady.nanoseconds += 700_000_000
    node.tick()
    assert (node.sent["cmd_vel_out"][-1].linear.x, node.sent["cmd_vel_out"][-1].angular.z) == (0.0, 0.0)
    assert node.told[-1][0] == "error"
    assert [text for level, text in node.told if level == "info"] == ["the planner drives"]
    assert len(node.sent["/diagnostics"]) == 3, "when the planner begins, after a second, when all fell silent"


def test_senses_are_heard_also_from_publishers_that_promise_best_effort_only(node: Any) -> None:
    """Who asks for reliable messages hears nothing of those, and is told nothing of it."""
    assert (node.qos["imu"], node.qos["odom"]) == ("best effort", "best effort")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_last_command_before_the_end_is_a_stop(
    node: Any, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    glue = sys.modules["wayfarer_failsafe.node"]
    rclpy = SimpleNamespace(init=lambda **_: None, spin=lambda _: signal.raise_signal(number), shutdown=lambda: None)
    node.destroy_node = lambda: None
    monkeypatch.setattr(glue, "rclpy", rclpy)
    monkeypatch.setattr(glue, "FailSafeNode", lambda: node)
    before = signal.getsignal(signal.SIGTERM)
    try:
        glue.main()
    finally:
        signal.signal(signal.SIGTERM, before)
    (last,) = node.sent["cmd_vel_out"]
    assert (last.linear.x, last.angular.z) == (0.0, 0.0)


def test_every_parameter_of_the_guard_is_the_nodes_and_stands_in_the_file(node: Any) -> None:
    names = {*GuardSettings.__dataclass_fields__, "enabled", "stamped"}
    assert set(node.parameters) == names
    text = (PACKAGE / "config/failsafe.yaml").read_text(encoding="utf-8")
    assert {line.split(":")[0].strip() for line in text.splitlines()[2:] if not line.strip().startswith("#")} == names


def test_package_names_the_same_things_everywhere() -> None:
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert package.findtext("name") == PACKAGE.name
    setup = (PACKAGE / "setup.py").read_text(encoding="utf-8")
    assert f'version="{package.findtext("version")}"' in setup
    for line in ("resource/{NAME}", "launch/failsafe.launch.py", "config/failsafe.yaml"):
        assert line in setup
        assert (PACKAGE / line.replace("{NAME}", PACKAGE.name)).exists()
    launch = ast.parse((PACKAGE / "launch/failsafe.launch.py").read_text(encoding="utf-8"))
    topics = next(ast.literal_eval(each.value) for each in launch.body if isinstance(each, ast.Assign))
    code = (PACKAGE / PACKAGE.name / "node.py").read_text(encoding="utf-8")
    assert all(f'"{topic}"' in code for topic in topics)
