"""The interface of an escape algorithm: its input, its output, and what it must guarantee.

An algorithm is pure: no clock, no I/O, no asyncio, no global randomness. Time comes in as ``Observation.t_s``, random
numbers from the ``random.Random`` that it was made with. The same observations give the same decisions, on a rover, in
a simulated forest and in a replay of a log.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final, Protocol, SupportsFloat

from wayfarer.hal import ContactReading, WheelCommand
from wayfarer.readings import Value

# The side of a turn is its sign: tau in the paper.
CLOCKWISE: Final = 1
COUNTER_CLOCKWISE: Final = -1


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


class Observation(Value):
    """What an algorithm sees in one control tick; it accepts any numbers, such as NumPy's, and converts them.

    ``t_s`` is seconds on any clock that does not go back. Headings are degrees clockwise, 0 to 360, all from the same
    north. ``pitch_deg`` is positive with the nose up, ``roll_deg`` with the right side down.
    ``travelled_m`` is the distance commanded so far; driving forwards and backwards both increase it. ``measured_m`` is
    the distance that the motion sensor saw, or the commanded one if the sensor is not usable; None if nothing
    measures it. ``covered_m`` is the better of the two. ``contact`` is None on a rover without a contact sensor.
    ``applied`` is the wheel command that was applied since the last tick, less what a slope takes up; None if that is
    not known.

    >>> seen = Observation(
    ...     t_s=0.05, heading_deg=12.0, pitch_deg=0.0, roll_deg=0.0, anomalies=(Anomaly.IMMOBILISED,), contact=None,
    ...     goal_heading_deg=0.0, travelled_m=0.02,
    ... )
    >>> seen.covered_m
    0.02
    """

    __match_args__ = (
        "t_s",
        "heading_deg",
        "pitch_deg",
        "roll_deg",
        "anomalies",
        "contact",
        "goal_heading_deg",
        "travelled_m",
        "measured_m",
        "applied",
    )

    def __init__(
        self,
        t_s: float,
        heading_deg: float,
        pitch_deg: float,
        roll_deg: float,
        anomalies: tuple[Anomaly, ...],
        contact: ContactReading | None,
        goal_heading_deg: float,
        travelled_m: float,
        measured_m: SupportsFloat | None = None,
        applied: WheelCommand | None = None,
    ) -> None:
        self.t_s: Final = float(t_s)
        self.heading_deg: Final = float(heading_deg)
        self.pitch_deg: Final = float(pitch_deg)
        self.roll_deg: Final = float(roll_deg)
        self.anomalies: Final = anomalies
        self.contact: Final = contact
        self.goal_heading_deg: Final = float(goal_heading_deg)
        self.travelled_m: Final = float(travelled_m)
        self.measured_m: Final[float | None] = (
            measured_m if measured_m is None or type(measured_m) is float else float(measured_m)
        )
        self.applied: Final = applied
        self.covered_m: Final = self.travelled_m if self.measured_m is None else self.measured_m


class Decision(Value):
    """What an algorithm wants; ``why`` is a fixed event name such as ``probe.unwound``, else the phase."""

    __match_args__ = ("wheels", "phase", "why")

    def __init__(self, wheels: WheelCommand, phase: Phase, why: str) -> None:
        self.wheels: Final = wheels
        self.phase: Final = phase
        self.why: Final = why


class EscapeHandler(Protocol):
    """One algorithm at work in one run. Every phase except ``FOLLOW`` ends, also if nothing moves."""

    def decide(self, observation: Observation) -> Decision:
        """Return the decision for this tick. Called once per tick with strictly increasing ``t_s``; never raises."""

    def reset(self) -> None:
        """Forget everything: a new mission begins."""

    def memory(self) -> Mapping[str, float | str]:
        """Return the inner state for the log and for replay: at least ``counter_deg`` and ``episodes``."""
