"""Faults as data: kind, target, begin and end; and the table of all kinds.

A fault is injected at one of four layers, and the field code cannot tell that it was:

* ``world``: what happens to the body and around it;
* ``reading``: what a driver hands on, whatever the part said;
* ``bus``: what the wires carry and the chips answer; needs bus depth, where the real drivers are asked;
* ``process``: what happens to the daemon and the computer under it.

Faults that need a real process (a full disk, a signal) are not here: ``tests/system`` injects them into the daemon.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from typing import Annotated, Any, Literal

from annotated_types import Interval

from wayfarer.setting_ranges import Fraction, SignedDegrees

DriveGain = Annotated[float, Interval(ge=-1, le=2)]
Delay = Annotated[float, Interval(gt=0, le=60)]
Byte = Annotated[int, Interval(ge=0, le=255)]


class Layer(StrEnum):
    """Where a fault is injected."""

    WORLD = "world"
    READING = "reading"
    BUS = "bus"
    PROCESS = "process"


@dataclass(frozen=True, slots=True)
class NoParameters:
    """A kind without parameters."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that goes wrong from ``at_s`` on for ``for_s`` seconds (infinite: to the end of the run).

    ``at_s`` is seconds from the start of the run. ``target`` is a part (``compass``), or the ``world`` or the
    ``process`` itself. ``params`` is the kind's own dataclass, one of ``KINDS``.
    """

    at_s: float
    for_s: float
    target: str
    kind: str
    params: Any = field(default_factory=NoParameters)

    def __str__(self) -> str:
        """Return the fault as a person would write it down."""
        lasting = "" if self.for_s == inf else f" for {self.for_s:g} s"
        return f"{self.target} {self.kind}{lasting} from {self.at_s:g} s on"


# -- world -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class MagneticAnomaly:
    """Iron nearby bends the field: the heading is off by ``bias_deg``, reached evenly over ``ramp_s``."""

    bias_deg: SignedDegrees = 20.0
    ramp_s: Annotated[float, Interval(ge=0, le=3600)] = 0.0


@dataclass(frozen=True, slots=True)
class MotorField:
    """The motors' current bends the field: the heading is off by ``bias_deg`` at full duty, in proportion below."""

    bias_deg: SignedDegrees = 15.0


@dataclass(frozen=True, slots=True)
class Slope:
    """The ground tilts the body, nose up and right side down positive; 180 is upside down."""

    pitch_deg: SignedDegrees = 0.0
    roll_deg: SignedDegrees = 0.0


@dataclass(frozen=True, slots=True)
class Shove:
    """Something moves the body ahead at ``speed_m_s``, independent of its wheels: a slope, or motors that run away."""

    speed_m_s: Annotated[float, Interval(ge=-2, le=2)] = 0.5


@dataclass(frozen=True, slots=True)
class Drive:
    """The sides turn ``left_gain`` and ``right_gain`` times as fast as commanded: 0 dead, -1 wired the wrong way."""

    left_gain: DriveGain = 1.0
    right_gain: DriveGain = 1.0


@dataclass(frozen=True, slots=True)
class DeadBand:
    """Motors that do not turn below a duty."""

    duty: Fraction = 0.2


@dataclass(frozen=True, slots=True)
class Battery:
    """A battery at ``volts``."""

    volts: Annotated[float, Interval(ge=0, le=36)] = 9.5


# -- reading ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Offset:
    """A value that is off by ``by``, in the unit of the reading's own field."""

    of: str = "heading_deg"
    by: float = 90.0


@dataclass(frozen=True, slots=True)
class Jumps:
    """A value that is off by ``by`` in one reading of ``every``, and right in between."""

    of: str = "heading_deg"
    by: float = 90.0
    every: Annotated[int, Interval(ge=1, le=1000)] = 2


@dataclass(frozen=True, slots=True)
class Noise:
    """A value with normal noise of ``sd`` on it."""

    of: str = "heading_deg"
    sd: Annotated[float, Interval(ge=0)] = 3.0


@dataclass(frozen=True, slots=True)
class Drifts:
    """A value that drifts away, further by ``per_s`` each second, in the unit of the reading's own field."""

    of: str = "heading_deg"
    per_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Negated:
    """A value of the wrong sign: a part that is mounted the other way round, or set so."""

    of: str = "heading_deg"


@dataclass(frozen=True, slots=True)
class Becomes:
    """A value that is ``value``, independent of the measured value."""

    of: str = "quality"
    value: float = 0.0


@dataclass(frozen=True, slots=True)
class Garbage:
    """Every number of a reading is random, possibly out of range, infinite or NaN; this happens with ``chance``."""

    chance: Fraction = 1.0


@dataclass(frozen=True, slots=True)
class NotANumber:
    """A value is NaN or infinite."""

    of: str = "heading_deg"
    value: Literal["nan", "inf", "-inf"] = "nan"


@dataclass(frozen=True, slots=True)
class Delayed:
    """Readings that are handed on ``by_s`` late, with the time at which they were taken."""

    by_s: Delay = 0.2


@dataclass(frozen=True, slots=True)
class LateAnswer:
    """A part that takes ``by_s`` to answer."""

    by_s: Delay = 0.05


@dataclass(frozen=True, slots=True)
class Saturated:
    """A value that never leaves -limit..limit."""

    of: str = "forward_m"
    limit: Annotated[float, Interval(gt=0)] = 0.037


# -- bus -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Lost:
    """Transfers that are not acknowledged: the share ``chance`` of them, and no more than ``most`` in all."""

    chance: Fraction = 1.0
    most: Annotated[int, Interval(ge=1, le=1_000_000)] = 1_000_000


@dataclass(frozen=True, slots=True)
class LostBytes:
    """Written bytes that never arrive: the share ``chance`` of them."""

    chance: Fraction = 0.1


@dataclass(frozen=True, slots=True)
class FlippedBits:
    """``bits`` of each answer are the wrong way round, in the share ``chance`` of answers.

    To a part that only listens it happens to what is written.
    """

    bits: Annotated[int, Interval(ge=1, le=64)] = 1
    chance: Fraction = 1.0


@dataclass(frozen=True, slots=True)
class Spikes:
    """One answer in ``every`` says that the ground moved ahead by ``counts``, independent of the motion."""

    counts: Annotated[int, Interval(ge=1, le=32_767)] = 469
    every: Annotated[int, Interval(ge=1, le=1000)] = 10


@dataclass(frozen=True, slots=True)
class Shifted:
    """Answers shifted by so many bits: clock stretching that the bus master does not understand gives such."""

    bits: Annotated[int, Interval(ge=1, le=16)] = 8


@dataclass(frozen=True, slots=True)
class WrongId:
    """A part that says it is another."""

    says: Byte = 0x2A


# -- process ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LoopStall:
    """Something blocks the event loop; or the clock jumps, which looks the same."""

    by_s: Annotated[float, Interval(gt=0, le=3600)] = 0.5


@dataclass(frozen=True, slots=True)
class Undervoltage:
    """The computer's supply sags ``times``, each half of ``every_s`` long."""

    times: Annotated[int, Interval(ge=1, le=1000)] = 1
    every_s: Annotated[float, Interval(ge=2, le=3600)] = 10.0


@dataclass(frozen=True, slots=True)
class FaultKind:
    """A row of the table of kinds: what it is, at which layer, to what it can happen, and its parameters."""

    layer: Layer
    about: str
    targets: tuple[str, ...]
    params: type = NoParameters


_SENSES = ("compass", "motion", "contact", "position")
_PARTS = (*_SENSES, "motors")
_ON_A_BUS = ("compass", "motion", "motors")
_WORLD, _PROCESS = ("world",), ("process",)

KINDS: Mapping[str, FaultKind] = {
    "slip": FaultKind(Layer.WORLD, "the wheels lose their grip until they pull back", _WORLD),
    "snag": FaultKind(Layer.WORLD, "something holds the body", _WORLD),
    "magnetic_anomaly": FaultKind(Layer.WORLD, "iron nearby distorts the magnetic field", _WORLD, MagneticAnomaly),
    "motor_field": FaultKind(Layer.WORLD, "the motors' current distorts the magnetic field", _WORLD, MotorField),
    "slope": FaultKind(Layer.WORLD, "the ground tilts the body", _WORLD, Slope),
    "shove": FaultKind(Layer.WORLD, "an outside force moves the body", _WORLD, Shove),
    "drive": FaultKind(Layer.WORLD, "a side is weak, dead or wired the wrong way", _WORLD, Drive),
    "dead_band": FaultKind(Layer.WORLD, "motors do not turn at a low duty", _WORLD, DeadBand),
    "battery": FaultKind(Layer.WORLD, "the battery's voltage", _WORLD, Battery),
    "silent": FaultKind(Layer.READING, "the part does not answer", _PARTS),
    "frozen": FaultKind(Layer.READING, "the last reading is repeated, with a new time", _SENSES),
    "offset": FaultKind(Layer.READING, "a value has a constant error", _SENSES, Offset),
    "jumps": FaultKind(Layer.READING, "a value jumps now and then", _SENSES, Jumps),
    "noisy": FaultKind(Layer.READING, "a value has added noise", _SENSES, Noise),
    "drifts": FaultKind(Layer.READING, "a value drifts away", _SENSES, Drifts),
    "negated": FaultKind(Layer.READING, "a value has the wrong sign", _SENSES, Negated),
    "becomes": FaultKind(Layer.READING, "a value is replaced by a wrong one", _SENSES, Becomes),
    "saturated": FaultKind(Layer.READING, "a value is clipped at a limit", _SENSES, Saturated),
    "garbage": FaultKind(Layer.READING, "random numbers in place of readings", _SENSES, Garbage),
    "not_a_number": FaultKind(Layer.READING, "a value is NaN or infinite", _SENSES, NotANumber),
    "delayed": FaultKind(Layer.READING, "readings arrive late, with their old time", _SENSES, Delayed),
    "late_answer": FaultKind(Layer.READING, "the part answers late", _PARTS, LateAnswer),
    "nack": FaultKind(Layer.BUS, "transfers are not acknowledged", _ON_A_BUS, Lost),
    "hang": FaultKind(Layer.BUS, "a device holds the whole bus", _ON_A_BUS),
    "flipped_bits": FaultKind(Layer.BUS, "answers have wrong bits", _ON_A_BUS, FlippedBits),
    "shifted_block": FaultKind(Layer.BUS, "the bits of answers are shifted", _ON_A_BUS, Shifted),
    "wrong_id": FaultKind(Layer.BUS, "the part reports a wrong identity", _ON_A_BUS, WrongId),
    "reset": FaultKind(Layer.BUS, "the part loses its power, and with it its settings", _ON_A_BUS),
    "all_00": FaultKind(Layer.BUS, "answers contain only zeros", _ON_A_BUS),
    "all_ff": FaultKind(Layer.BUS, "answers contain only ones", _ON_A_BUS),
    "lost_bytes": FaultKind(Layer.BUS, "some written bytes are lost", ("motors",), LostBytes),
    "failsafe_off": FaultKind(Layer.BUS, "the board's deadman does not arm", ("motors",)),
    "board_fault": FaultKind(Layer.BUS, "the board reports a drive fault", ("motors",)),
    "ignores": FaultKind(Layer.BUS, "the board acknowledges commands and does not follow them", ("motors",)),
    "dark": FaultKind(Layer.BUS, "the picture is dark: a leaf on the lens, or night", ("motion",)),
    "spikes": FaultKind(Layer.BUS, "garbage that looks like motion of the ground", ("motion",), Spikes),
    "same_picture": FaultKind(Layer.BUS, "the camera repeats the same picture", ("motion",)),
    "uncalibrated": FaultKind(Layer.BUS, "the part reports that its calibration is lost", ("compass",)),
    "task_crash": FaultKind(Layer.PROCESS, "a bug in a driver ends its task", _PARTS),
    "loop_stall": FaultKind(Layer.PROCESS, "the event loop is blocked, or the clock jumps", _PROCESS, LoopStall),
    "undervoltage": FaultKind(Layer.PROCESS, "the computer's supply sags", _PROCESS, Undervoltage),
}
