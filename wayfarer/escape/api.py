"""The interface of an escape algorithm: its input, its output, and what it must guarantee.

An algorithm is pure: no clock, no I/O, no asyncio, no global randomness. Time comes in as ``Observation.t_s``, chance
from the ``random.Random`` it was made with. The same observations give the same decisions, on a rover, in a simulated
forest and in a replay of a log.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, NamedTuple, Protocol

from annotated_types import Interval

from wayfarer.hal import ContactReading, WheelCommand
from wayfarer.setting_ranges import Degrees, DegreesPerSecond, Gain, Metres, MetresPerSecond


class Anomaly(Enum):
    """The signs by which a blind rover notices an obstacle, in the order of the log, not of severity.

    >>> Anomaly("nose_up") is Anomaly.NOSE_UP
    True
    """

    IMMOBILISED = "immobilised"
    NOSE_UP = "nose_up"
    NOSE_DOWN = "nose_down"
    RIGHT_DOWN = "right_down"
    LEFT_DOWN = "left_down"
    TOUCHED = "touched"


class Phase(Enum):
    """What the rover is doing."""

    FOLLOW = "follow"
    BACK_OFF = "back_off"
    TURN_AWAY = "turn_away"
    PROBE = "probe"
    STRIDE = "stride"
    HALT = "halt"
    MANUAL = "manual"  # a person drives; no algorithm is ever in it


class Observation(NamedTuple):
    """What an algorithm sees in one control tick.

    ``t_s`` is seconds on any clock that does not go back. Headings are degrees clockwise, 0 to 360, all from the same
    north. ``pitch_deg`` is positive with the nose up, ``roll_deg`` with the right side down.
    ``travelled_m`` is the distance commanded so far; driving forwards and backwards both increase it. ``measured_m`` is
    the distance that the motion sensor saw, or the commanded one where the sensor is not usable; None where nothing
    measures it. ``contact`` is None on a rover without a contact sensor. ``applied`` is the wheel command that was
    applied since the last tick, after the gate's limits; None where that is not known.

    >>> seen = Observation(
    ...     t_s=0.05, heading_deg=12.0, pitch_deg=0.0, roll_deg=0.0, anomalies=(Anomaly.IMMOBILISED,), contact=None,
    ...     goal_heading_deg=0.0, travelled_m=0.02,
    ... )
    >>> seen.covered_m
    0.02
    """

    t_s: float
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    anomalies: tuple[Anomaly, ...]
    contact: ContactReading | None
    goal_heading_deg: float
    travelled_m: float
    measured_m: float | None = None
    applied: WheelCommand | None = None

    @property
    def covered_m(self) -> float:
        """The best estimate of the distance covered so far."""
        return self.travelled_m if self.measured_m is None else self.measured_m


class Decision(NamedTuple):
    """What an algorithm wants; ``why`` is a fixed event name such as ``probe.unwound``, else the phase."""

    wheels: WheelCommand
    phase: Phase
    why: str


class EscapeHandler(Protocol):
    """One algorithm at work in one run."""

    def decide(self, observation: Observation) -> Decision:
        """Return the decision for this tick. Called once a tick with strictly increasing ``t_s``; never raises."""

    def reset(self) -> None:
        """Forget everything: a new mission begins."""

    def memory(self) -> Mapping[str, float | str]:
        """Return the inner state for the log and for replay: at least ``counter_deg`` and ``episodes``."""


@dataclass(frozen=True, slots=True)
class Vehicle:
    """What the decision logic knows of the body.

    >>> Vehicle(length_m=0.6, width_m=0.5, track_m=0.6, max_speed_m_s=1.2).mix(speed_m_s=0.6, turn_rad_s=0.0)
    WheelCommand(left=0.5, right=0.5)
    """

    length_m: Metres
    """Length of the body, with its bumpers and wheels."""
    width_m: Metres
    """Width of the body, with its wheels."""
    track_m: Metres
    """Effective track for turning: a skid-steered rover slips sideways and turns as if its wheels stood further apart
    than they do. About the width and a quarter."""
    max_speed_m_s: MetresPerSecond
    """Speed at full duty on flat ground."""
    turn_from_duty: Annotated[float, Interval(ge=0, lt=1)] = 0.0
    """Half the difference of the two sides' duties from which the body begins to turn on the spot, as a share of full
    duty. 0 = not measured; it is learnt while driving, from this value on."""

    def mix(self, speed_m_s: float, turn_rad_s: float) -> WheelCommand:
        """Return the wheel duties for a forward speed and a clockwise turn rate.

        Where that asks for more than full duty, both sides are scaled down together: the curve keeps its shape.
        """
        lead_m_s = turn_rad_s * self.track_m / 2
        left_m_s, right_m_s = speed_m_s + lead_m_s, speed_m_s - lead_m_s
        full_m_s = max(self.max_speed_m_s, abs(left_m_s), abs(right_m_s))
        return WheelCommand(left_m_s / full_m_s, right_m_s / full_m_s)


@dataclass(frozen=True, slots=True)
class EscapeSettings:
    """The numbers of the manoeuvres.

    The distances are those of the paper's released simulator, so that its results can be compared: reverse 0.15 m,
    straight 0.6 m, then an arc of 5 degrees every 0.1 m (radius 1.15 m), strides of the Lévy walk 0.6 to 10 m.
    The turn angle, the 5 degree reset and the 20 degree compatibility are from the paper, section III.

    >>> EscapeSettings(cruise_m_s=0.5).turn_angle_deg
    30.0
    """

    cruise_m_s: MetresPerSecond = 1.0
    """Speed of all driving ahead. The released field code drives with 0.3 of full duty."""
    reverse_m_s: MetresPerSecond = 0.6
    """Speed of backing off."""
    turn_deg_s: DegreesPerSecond = 180.0
    """Fastest turn."""
    turn_min_deg_s: DegreesPerSecond = 30.0
    """Slowest turn, near the end of its angle."""
    turn_p: Gain = 6.0
    """Gain of a turn: deg/s per degree that is left."""
    turn_within_deg: Degrees = 3.0
    """A turn is done when so little is left."""
    back_off_m: Metres = 0.15
    """How far the rover backs off from what stopped it."""
    turn_angle_deg: Degrees = 30.0
    """Angle of the turn away from it."""
    probe_straight_m: Metres = 0.6
    """A probe begins with this straight piece."""
    probe_radius_m: Metres = 1.15
    """Radius of the arc by which a probe goes on, back towards the obstacle."""
    reset_within_deg: Degrees = 5.0
    """A probe is done, and the counter C is forgotten, when the heading is so near the goal."""
    compatible_within_deg: Degrees = 20.0
    """An obstacle whose axis is so near the goal heading is compatible with it (OO-Pledge)."""
    react_stride_m: Metres = 0.6
    """Stride of the algorithms that only react."""
    levy_stride_min_m: Metres = 0.6
    """Shortest stride of a Lévy walk."""
    levy_stride_max_m: Metres = 10.0
    """Longest stride of a Lévy walk."""
    levy_turn_min_deg: Degrees = 10.0
    """Smallest turn of a Lévy walk."""
    levy_turn_max_deg: Degrees = 50.0
    """Largest turn of a Lévy walk."""
    heading_p: Gain = 3.0
    """Gain of the heading loop: deg/s per degree of error."""
    heading_i: Gain = 0.2
    """Its integral gain: deg/s per degree of error and second."""
    heading_d: Gain = 0.0
    """Its derivative gain: deg/s per deg/s of error."""
    pivot_beyond_deg: Degrees = 60.0
    """A heading that is further from the goal after a half turn's time makes the rover back off."""

    def __post_init__(self) -> None:
        if self.levy_stride_min_m > self.levy_stride_max_m or self.levy_turn_min_deg > self.levy_turn_max_deg:
            raise ValueError("levy_stride_min_m and levy_turn_min_deg must not exceed their _max_")
