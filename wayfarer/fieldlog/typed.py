"""Typed views of records, each made once, when ``run_fold.RunFold`` takes the record. Pure.

The reader has judged every key of ``schema``: a value is of its type and in its range, or None. So these are taken as
they are; texts are made fit for a terminal. What the schema cannot judge is looked at here and nowhere behind it: what
an algorithm remembers, what a sensor said, and the settings in a header. There a wrong type reads as missing.

Each view has ``elapsed_s``, the seconds since the first record of its log, and ``t_s``, the loop's clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import Any, Generic, TypeVar

from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import number, safe_text, safe_texts
from wayfarer.fieldlog.printable import clean
from wayfarer.fieldlog.schema import Record
from wayfarer.hal import MotionReading

T = TypeVar("T")


class Key(Generic[T]):
    """A key of a view's record, under the name of the attribute; the reader has judged its value.

    Args:
        otherwise: what is returned where the record does not say.
    """

    def __init__(self, otherwise: T) -> None:
        self._otherwise = otherwise

    def __set_name__(self, _view: type, key: str) -> None:
        self._key = key

    def __get__(self, view: Any, _type: type | None = None) -> T:
        value: T | None = view.record.get(self._key)
        return self._otherwise if value is None else value


class Remembered:
    """The same for a number that an algorithm remembers: a third party's may be anything, which reads as None."""

    def __set_name__(self, _view: type, key: str) -> None:
        self._key = key

    def __get__(self, view: Any, _type: type | None = None) -> float | None:
        return number(view.record, self._key)


Number = Key[float | None]


@dataclass(slots=True)
class RunEvent:
    """Something that a log tells: one of these views, or an event of ``run_events``."""

    elapsed_s: float
    t_s: float


@dataclass(slots=True)
class Tick(RunEvent):
    """One control tick, under the names of its keys.

    The fold adds the last seven fields: ``motion``, NaN where the motion sensor could not tell; ``period_s`` since the
    tick before, NaN where records are missing between the two; ``place``, where dead reckoning has the rover, None
    without a heading; ``before``, that of the tick before or None, where records are missing between the two;
    ``path_m``, how far it went; ``measured_m_s``, the speed that the motion sensor measured last, NaN where it could
    not for a while; and ``fresh``, the sensors that have spoken since the tick before. A fold that does not reckon
    gives no motion and no places.
    """

    record: Record
    heading_deg: float | None
    anomalies: tuple[str, ...]
    travelled_m: float | None
    phase: str | None
    why: str | None
    applied_left: float | None
    applied_right: float | None
    level: str | None
    cause: str | None
    motion: MotionReading | None = None
    period_s: float = nan
    place: ReckonedPose | None = None
    before: ReckonedPose | None = None
    path_m: float = 0.0
    measured_m_s: float = nan
    fresh: tuple[str, ...] = ()

    # What nothing is compared with is looked up when somebody asks for it.
    n = Key[int | None](None)
    pitch_deg = Number(None)
    roll_deg = Number(None)
    goal_heading_deg = Number(None)
    covered_m = Number(None)
    wanted_left = Number(None)
    wanted_right = Number(None)
    counter_deg = Remembered()
    side = Remembered()
    turn_deg = Remembered()
    episodes = Remembered()
    blocked_turns = Remembered()
    turn_from_duty = Remembered()

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Tick:
        """Return the view of a ``tick`` record."""
        get = record.get
        return cls(
            elapsed_s, record["t_s"], record, get("heading_deg"), safe_texts(record, "anomalies"),
            get("travelled_m"), safe_text(record, "phase"), safe_text(record, "why"),
            get("applied_left"), get("applied_right"), safe_text(record, "level"), safe_text(record, "cause"),
        )  # fmt: skip

    @property
    def further(self) -> dict[str, Any]:
        """Return what none of these attributes tells: new keys, and what a third party's algorithm remembers."""
        told = {key: value for key, value in self.record.items() if key not in _TICK_KEYS and value is not None}
        return {key: value for key, value in told.items() if key not in _NUMBERS or number(self.record, key) is None}

    @property
    def duty(self) -> float | None:
        """Return the larger duty of the two sides, None where neither is known."""
        return max((abs(duty) for duty in (self.applied_left, self.applied_right) if duty is not None), default=None)


_TICK_KEYS = frozenset(
    ("record", "t_s", "t_wall", "decision_t_s", "compass", "motion", "contact", "heading_deg", "anomalies",
     "travelled_m", "phase", "why", "applied_left", "applied_right", "level", "cause",
     *(name for name, each in vars(Tick).items() if isinstance(each, Key)))
)  # fmt: skip
_NUMBERS = frozenset(name for name, each in vars(Tick).items() if isinstance(each, Remembered))


@dataclass(slots=True)
class Board(RunEvent):
    """What the motor board said of itself; the fold adds the seconds since it said something before."""

    battery_v: float | None
    faults: tuple[str, ...]
    period_s: float = nan

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Board:
        """Return the view of a ``board`` record."""
        return cls(elapsed_s, record["t_s"], number(record, "battery_v"), safe_texts(record, "faults"))


@dataclass(slots=True)
class Fix(RunEvent):
    """A position from the receiver; ``error_m`` is horizontal, None where it is unknown.

    The fold adds ``period_s``, the seconds since the position before; None for the first one.
    """

    latitude_deg: float
    longitude_deg: float
    error_m: float | None
    period_s: float | None = None

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Fix | None:
        """Return the view of a ``position`` record, None where it does not say where."""
        latitude_deg, longitude_deg = record.get("latitude_deg"), record.get("longitude_deg")
        if latitude_deg is None or longitude_deg is None:
            return None
        return cls(elapsed_s, record["t_s"], latitude_deg, longitude_deg, record.get("error_m"))


@dataclass(slots=True)
class Computer(RunEvent):
    """How the computer is."""

    record: Record

    cpu_c = Number(None)
    throttled = Key[str | None](None)
    load_1min = Number(None)
    disk_free_mb = Number(None)
    log_dropped = Number(None)

    @property
    def power_bits(self) -> str:
        """Return the power and heat bits that are set, hexadecimal; empty where none is."""
        return clean(self.throttled or "").removeprefix("0x").lstrip("0")


@dataclass(slots=True)
class Truth(RunEvent):
    """Where a simulated rover really is, in the metres of its forest; what is not said is 0."""

    record: Record

    x_m = Key(0.0)
    y_m = Key(0.0)
    heading_deg = Key(0.0)
    pitch_deg = Key(0.0)
    roll_deg = Key(0.0)
    slipping = Key[bool | None](None)
    touching = Key[bool | None](None)


def motion_reading(tick: Record) -> MotionReading | None:
    """Return what the motion sensor said; JSON has no NaN, so that a number which was none is null in the log."""
    said = tick.get("motion")
    if not said:
        return None
    t_s, forward_m, right_m, quality = (or_nan(said.get(key)) for key in ("t_s", "forward_m", "right_m", "quality"))
    return MotionReading(t_s, forward_m, right_m, quality, said.get("signed") is not False)


def or_nan(value: float | None) -> float:
    """Return a number, NaN for one that is not known."""
    return nan if value is None else value
