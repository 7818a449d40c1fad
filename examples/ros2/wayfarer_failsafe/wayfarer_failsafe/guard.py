"""Who drives, and when nobody does: wayfarer's detector and fail-safe over ROS messages. Pure: no ROS, no clock.

The planner's commands pass through unchanged until the detector says that the rover does not move as commanded, or
tilts. Then the escape handler drives until the rover is free. Nothing moves while the IMU, the odometry or the planner
is silent. If the handler does not get the rover out either, it stands and asks for a person.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import degrees, isfinite, nan
from typing import Any, NamedTuple

from wayfarer import EscapeSettings, FailSafe, StuckDetector, Vehicle, make_handler
from wayfarer.hal import CompassReading
from wayfarer_failsafe.messages import STANDSTILL, OdometrySum, Speeds, compass_reading, speeds_from, speeds_of

FORGIVEN_S = 60.0  # that the planner must drive before the time of earlier rescues is forgotten; chosen by us
NO_IMU = CompassReading(nan, nan, 0.0, 0.0, None)
STRAIGHT_RAD_S = 0.2  # a planner that turns more slowly than this goes where it wants to


class State(Enum):
    """What the node does; ``level`` is that of diagnostics: 0 OK, 1 WARN, 2 ERROR."""

    PLANNER = "the planner drives", 0
    DISABLED = "the planner drives, and the fail-safe is disabled", 1
    RESCUE = "the escape handler drives", 1
    IDLE = "stopped: no command from the planner", 0
    STOPPED = "stopped", 2
    GAVE_UP = "stopped: the rover is still stuck and needs a person; set enabled to false and to true to try again", 2

    def __init__(self, text: str, level: int) -> None:
        self.text, self.level = text, level


@dataclass(frozen=True, slots=True)
class GuardSettings:
    """The node's parameters, in metres, seconds and degrees.

    ``goal_heading_deg`` is clockwise from north, by the IMU's yaw; without it (NaN) the way out is where the planner
    last drove straight on. ``alone`` lets the handler drive on, and take over, while the planner is silent.
    """

    length_m: float = 0.6
    width_m: float = 0.5
    track_m: float = 0.6
    max_speed_m_s: float = 1.0
    cruise_m_s: float = 0.5
    algorithm: str = "forest-pledge"
    goal_heading_deg: float = nan
    stuck_s: float = 0.5
    tilt_deg: float = 20.0
    imu_timeout_s: float = 0.25
    odom_timeout_s: float = 0.4
    cmd_timeout_s: float = 0.5
    give_up_s: float = 300.0
    alone: bool = False


class Output(NamedTuple):
    """What to publish: speeds for the base, and what to tell people."""

    speeds: Speeds
    state: State
    text: str
    values: dict[str, str]


class Guard:
    """Takes messages when they come, and decides once per tick. Times are seconds on a clock that never goes back."""

    def __init__(self, settings: GuardSettings) -> None:
        self._settings = settings
        self.vehicle = Vehicle(settings.length_m, settings.width_m, settings.track_m, settings.max_speed_m_s)
        escape = EscapeSettings(cruise_m_s=settings.cruise_m_s, reverse_m_s=min(0.6, settings.cruise_m_s))
        self._handler = make_handler(settings.algorithm, vehicle=self.vehicle, settings=escape, seed=0)
        self._failsafe = FailSafe(self._handler, self.vehicle)
        self._detector = StuckDetector(
            self.vehicle, stuck_s=settings.stuck_s, tilt_deg=settings.tilt_deg,
            heading_stale_s=settings.imu_timeout_s, motion_stale_s=settings.odom_timeout_s,
        )  # fmt: skip
        self._odometry = OdometrySum()
        self._compass = NO_IMU
        self._command, self._command_t_s = STANDSTILL, float("-inf")
        self._applied, self._state = STANDSTILL, State.IDLE
        self._enabled, self._t_s = True, float("inf")
        self._goal_deg = settings.goal_heading_deg
        self._rescue_s, self._rescued_t_s = 0.0, float("-inf")
        self.takeovers = 0

    def take_imu(self, imu: Any, t_s: float) -> None:
        """Take a ``sensor_msgs/Imu``; one without an orientation counts as silence."""
        self._compass = compass_reading(imu, t_s) or self._compass

    def take_odometry(self, odometry: Any, t_s: float) -> None:
        """Take a ``nav_msgs/Odometry``; its speeds must not come from the wheels alone, which also turn in deep mud."""
        self._odometry.add(odometry, t_s)

    def take_command(self, twist: Any, t_s: float) -> None:
        """Take the planner's Twist or TwistStamped; one that is not a number stops the rover."""
        self._command, self._command_t_s = speeds_of(twist) or STANDSTILL, t_s

    def enable(self, enabled: bool) -> None:
        """Let the fail-safe take over, or never; from false to true it tries again after it gave up."""
        if enabled and not self._enabled:
            self._detector.reset()  # a person may have put it elsewhere
            self._failsafe, self._rescue_s = FailSafe(self._handler, self.vehicle), 0.0
        self._enabled = enabled

    def tick(self, t_s: float) -> Output:
        """Decide; at about 20 Hz."""
        dt_s, self._t_s = max(0.0, t_s - self._t_s), t_s
        imu, moved = self._compass, self._odometry.take()
        self._detector.update(
            t_s, imu.heading_deg, pitch_deg=imu.pitch_deg, roll_deg=imu.roll_deg,
            speed_m_s=self._applied.ahead_m_s, turn_deg_s=-degrees(self._applied.turn_rad_s),
            forward_m=None if moved is None else moved.forward_m if moved.quality else nan,
            right_m=moved.right_m if moved else 0.0, measured_t_s=moved.t_s if moved else None,
        )  # fmt: skip
        self._compass = NO_IMU  # until the next message
        speeds, state, text = self._decide(t_s, dt_s, moves=moved is not None and moved.forward_m > 0.0)
        self._applied, self._state = speeds, state
        return Output(speeds, state, text or state.text, self._values())

    def _decide(self, t_s: float, dt_s: float, *, moves: bool) -> tuple[Speeds, State, str]:
        """Return who drives and how, as long as nothing speaks against that anybody does."""
        silent = t_s - self._command_t_s > self._settings.cmd_timeout_s
        if not self._enabled:
            return (STANDSTILL, State.IDLE, "") if silent else (self._command, State.DISABLED, "")
        if trouble := self._trouble():
            return STANDSTILL, State.STOPPED, f"stopped: {trouble}"
        if silent and not (self._settings.alone and isfinite(self._command_t_s)):  # it has spoken once, at least
            return STANDSTILL, State.IDLE, ""
        if self._rescue_s > self._settings.give_up_s:
            return STANDSTILL, State.GAVE_UP, ""
        # The planner drives, or the escape handler if the planner is stuck or silent.
        heading_deg, anomalies, drove = self._detector.heading_deg, self._detector.anomalies, self._failsafe.drives
        assert heading_deg is not None  # else it is trouble
        self._note_goal(heading_deg, moves=moves and not anomalies)
        decision = self._failsafe.update(t_s, heading_deg, self._goal_deg, stuck=bool(anomalies), blind=silent)
        self.takeovers += self._failsafe.drives and not drove
        if decision is None:
            if t_s - self._rescued_t_s > FORGIVEN_S:
                self._rescue_s = 0.0
            return self._command, State.PLANNER, ""
        self._rescued_t_s = t_s
        self._rescue_s += dt_s
        found = ", ".join(anomaly.value for anomaly in anomalies)
        text = f"{State.RESCUE.text}: {decision.phase.value}{found and f' ({found})'}"
        return speeds_from(decision.wheels, self.vehicle), State.RESCUE, text

    def _trouble(self) -> str:
        """Say which sensor is missing or wrong, or that the rover lies on its side; empty if nothing is."""
        if self._detector.heading_deg is None:
            return "no orientation from the IMU yet"
        if not self._odometry.heard:
            return "no odometry yet"
        return self._detector.trouble.replace("compass", "IMU").replace("motion sensor", "odometry")

    def _note_goal(self, heading_deg: float, *, moves: bool) -> None:
        """Without a given goal, take the heading in which the planner drives straight on and the rover moves.

        Before there is one, it is the heading at the time.
        """
        if isfinite(self._settings.goal_heading_deg) or self._failsafe.drives:
            return
        straight = self._applied.ahead_m_s > 0.1 and abs(self._applied.turn_rad_s) < STRAIGHT_RAD_S
        if (straight and moves) or not isfinite(self._goal_deg):
            self._goal_deg = heading_deg

    def _values(self) -> dict[str, str]:
        """Return what diagnostics show."""
        return {
            "state": self._state.name.lower(),
            "takeovers": str(self.takeovers),
            "rescue_s": f"{self._rescue_s:.1f}",
            "anomalies": " ".join(anomaly.value for anomaly in self._detector.anomalies),
            "conditions": " ".join(self._detector.conditions),
            "heading_deg": f"{heading_deg:.1f}" if (heading_deg := self._detector.heading_deg) is not None else "",
            "goal_heading_deg": f"{self._goal_deg:.1f}" if isfinite(self._goal_deg) else "",
        }
