"""What a record says, one class for each kind, made once when ``run_fold.RunFold`` takes it. Pure.

Each attribute with a type of ``schema`` is a key of the record, and this is its only description. The reader has
judged it: the value is of its type and in its range, or not known. What the schema cannot judge is looked at here and
nowhere behind it: what an algorithm remembers, what a sensor said. There a wrong type reads as missing.

All but ``Header`` have ``elapsed_s``, the seconds since the first record of the log, and ``t_s``, the loop's clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import Annotated, Any

from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import integer, number, or_nan, table
from wayfarer.fieldlog.schema import (
    ANGLE,
    COUNT,
    METRES,
    NUMBER,
    STAMP,
    TABLE,
    Angle,
    AnyNumber,
    Count,
    Duty,
    Flag,
    Lasting,
    Metres,
    Record,
    SinceBoot,
    Table,
    Text,
    Texts,
    Values,
    fields_of,
    keys_of,
)
from wayfarer.hal import MotionReading

# What an algorithm remembers, if it is a number: a third party's may be anything.
REMEMBERED = ("counter_deg", "side", "turn_deg", "episodes", "blocked_turns", "turn_from_duty")


@dataclass(slots=True)
class RunEvent:
    """Something that a log tells: one of these views, or an event of ``run_events``."""

    elapsed_s: float
    t_s: float


@dataclass(frozen=True, slots=True)
class Header:
    """What ran; None if the log does not say. ``world`` is the forest of a simulated run, if it can be drawn."""

    record: Record
    schema: Annotated[int | None, Values((int,), 1, 2**53)] = None
    part: Annotated[int, COUNT] = 1
    version: Text = None
    rover: Text = None
    algorithm: Text = None
    config: Table = None
    config_hash: Text = None
    parts: Table = None
    simulated: Flag = None
    dry_run: Flag = None
    log: Text = None
    start_delay_s: Lasting = None
    boot_id: Text = None
    trial: Count = None
    forest: Count = None
    noise: Count = None
    slip_mean_m: Metres = None
    budget_m: Metres = None
    mujoco: Table = None
    ground: Text = None
    slope: Table = None
    sim: Table = None

    @classmethod
    def of(cls, record: Record) -> Header:
        """Return what a ``run`` record says; an empty record says nothing."""
        return cls(record, **fields_of(cls, record))

    @property
    def seed(self) -> int | None:
        """Return the seed, a number of any size."""
        return integer(self.record, "seed")

    @property
    def world(self) -> Record | None:
        """Return what is drawn of a simulated forest, None if that is not all there."""
        return _world(table(self.record, "world"))

    def setting(self, section: str, key: str) -> float | None:
        """Return a number of the rover file, such as ``max_speed_m_s`` of ``vehicle``; None if it is not there."""
        return number(table(table(self.record, "config"), section), key)


@dataclass(slots=True)
class Tick(RunEvent):
    """One control tick, under the names of its keys.

    ``motion`` is NaN if the motion sensor could not tell. The fold adds the last seven fields: ``period_s`` since
    the tick before, NaN if records are missing between the two; ``place``, where dead reckoning has the rover, None
    without a heading; ``before``, that of the tick before or None, if records are missing between the two;
    ``path_m``, how far it went; ``measured_m_s``, the speed that the motion sensor measured last, NaN if it could
    not for a while; ``fresh``, the sensors that have spoken since the tick before; and ``driven_m``, the true way of a
    simulated rover when it was last written, None for any other. A fold that does not reckon gives no places.
    """

    record: Record
    compass: Table = None
    motion: Annotated[MotionReading | None, TABLE] = None
    contact: Table = None
    decision_t_s: SinceBoot = None
    heading_deg: Angle = None
    pitch_deg: Angle = None
    roll_deg: Angle = None
    anomalies: Texts = ()
    goal_heading_deg: Angle = None
    travelled_m: Metres = None
    covered_m: Metres = None
    phase: Text = None
    why: Text = None
    wanted_left: AnyNumber = None
    wanted_right: AnyNumber = None
    applied_left: Duty = None
    applied_right: Duty = None
    level: Text = None
    cause: Text = None
    manual_seq: Count = None
    manual_forward: Duty = None
    manual_turn: Duty = None
    manual_sent_s: SinceBoot = None

    counter_deg: float | None = None
    side: float | None = None
    turn_deg: float | None = None
    episodes: float | None = None
    blocked_turns: float | None = None
    turn_from_duty: float | None = None

    period_s: float = nan
    place: ReckonedPose | None = None
    before: ReckonedPose | None = None
    path_m: float = 0.0
    measured_m_s: float = nan
    fresh: tuple[str, ...] = ()
    driven_m: float | None = None

    @property
    def n(self) -> int | None:
        """Return the number of the record."""
        return self.record.get("n")

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Tick:
        """Return what a ``tick`` record says."""
        fields = fields_of(cls, record)
        fields["motion"] = _motion_reading(record)
        for key in REMEMBERED:
            fields[key] = number(record, key)
        return cls(elapsed_s, record["t_s"], record, **fields)

    @property
    def further(self) -> dict[str, Any]:
        """Return what none of these attributes tells: new keys, and what a third party's algorithm remembers."""
        attributes = {"record", *STAMP, *keys_of(Tick)}
        attributes |= {key for key in REMEMBERED if getattr(self, key) is not None}
        return {key: value for key, value in self.record.items() if value is not None and key not in attributes}

    @property
    def duty(self) -> float | None:
        """Return the larger duty of the two sides, None if neither is known."""
        return max((abs(duty) for duty in (self.applied_left, self.applied_right) if duty is not None), default=None)


@dataclass(slots=True)
class Board(RunEvent):
    """What the motor board said of itself; the fold adds the seconds since it said something before."""

    battery_v: AnyNumber = None
    faults: Texts = ()
    says_left: AnyNumber = None
    says_right: AnyNumber = None
    period_s: float = nan


@dataclass(slots=True)
class Fix(RunEvent):
    """A position from the receiver; ``error_m`` is horizontal, and ``utc_s`` its clock; None if they are unknown.

    The fold adds ``period_s``, the seconds since the position before; None for the first one.
    """

    latitude_deg: Annotated[float, Values(NUMBER, -90.0, 90.0)]
    longitude_deg: Annotated[float, Values(NUMBER, -180.0, 180.0)]
    error_m: Annotated[float | None, Values(NUMBER, 0.0, 1e8)] = None
    utc_s: Annotated[float | None, Values(NUMBER, -1e11, 1e12)] = None  # the calendar's years 1 to 9999
    period_s: float | None = None


@dataclass(slots=True)
class Computer(RunEvent):
    """How the computer is."""

    cpu_c: Annotated[float | None, Values(NUMBER, -273.0, 1000.0)] = None
    throttled: Text = None
    load_1min: Annotated[float | None, Values(NUMBER, 0.0, 1e6)] = None
    disk_free_mb: Annotated[float | None, Values(NUMBER, 0.0, 1e12)] = None
    disk_read_only: Flag = None
    disk_memory: Text = None
    log_dropped: Count = None
    log_sync_ms: Annotated[float | None, Values(NUMBER, 0.0, 1e9)] = None

    @property
    def power_bits(self) -> str:
        """Return the power and heat bits that are set, hexadecimal; empty if none is."""
        return (self.throttled or "").removeprefix("0x").lstrip("0")


@dataclass(slots=True)
class Truth(RunEvent):
    """Where a simulated rover really is, in the metres of its forest; what is not said of its body is 0.

    ``driven_m`` is the way so far, forwards and backwards added up; None in older logs.
    """

    x_m: Annotated[float, METRES]
    y_m: Annotated[float, METRES]
    heading_deg: Annotated[float, ANGLE] = 0.0
    pitch_deg: Annotated[float, ANGLE] = 0.0
    roll_deg: Annotated[float, ANGLE] = 0.0
    driven_m: Metres = None
    slipping: Flag = None
    touching: Flag = None


def _world(world: Record) -> Record | None:
    lengths = ("goal_y_m", "trunk_diameter_m", "tree_radius_m")
    if (
        all(number(world, key) is not None for key in lengths)
        and _are_rows([world.get("start_m")], 2)
        and _are_rows(world.get("trunks_m"), 4)
        and _are_rows(world.get("trees_m"), 2)
    ):
        return {key: world[key] for key in ("start_m", *lengths, "trees_m", "trunks_m")}
    return None


def _are_rows(rows: object, numbers: int) -> bool:
    """Return whether something is a list of lists that each begin with so many numbers."""
    return isinstance(rows, list | tuple) and all(
        isinstance(row, list | tuple)
        and len(row) >= numbers
        and all(number({"": value}, "") is not None for value in row[:numbers])
        for row in rows
    )


def _motion_reading(tick: Record) -> MotionReading | None:
    """Return what the motion sensor said; JSON has no NaN, so that a number which was none is null in the log."""
    said = tick.get("motion")
    if not said:
        return None
    t_s, forward_m, right_m, quality = (or_nan(said.get(key)) for key in ("t_s", "forward_m", "right_m", "quality"))
    return MotionReading(t_s, forward_m, right_m, quality, said.get("signed") is not False)
