"""Typed views of records, each made once, when ``run_fold.RunFold`` takes the record. Pure.

The reader has judged every key of ``schema``: a value is of its type and in its range, or None. So these are taken as
they are; texts are made fit for a terminal. What the schema cannot judge is looked at here and nowhere behind it: what
an algorithm remembers, what a sensor said, and the settings in a header. There a wrong type reads as missing.

Each view has ``elapsed_s``, the seconds since the first record of its log, and ``t_s``, the loop's clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan
from typing import Any

from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import flag, name, names, number, setting, table, whole
from wayfarer.fieldlog.schema import Record
from wayfarer.hal import MotionReading


@dataclass(slots=True)
class RunEvent:
    """Something that a log tells: one of these views, or an event of ``run_events``."""

    elapsed_s: float
    t_s: float


@dataclass(frozen=True, slots=True)
class Header:
    """What ran; None where the log does not say. ``world`` is the forest of a simulated run, if it can be drawn."""

    record: Record
    rover: str | None
    algorithm: str | None
    version: str | None
    seed: int | None
    trial: int | None
    part: int
    simulated: bool | None
    dry_run: bool | None
    world: Record | None

    @classmethod
    def of(cls, record: Record) -> Header:
        """Return the view of a ``run`` record; one of an empty record knows nothing."""
        return cls(
            record,
            rover=name(record, "rover"),
            algorithm=name(record, "algorithm"),
            version=name(record, "version"),
            seed=whole(record, "seed"),
            trial=whole(record, "trial"),
            part=whole(record, "part") or 1,
            simulated=flag(record, "simulated"),
            dry_run=flag(record, "dry_run"),
            world=_world(table(record, "world")),
        )

    def setting(self, *keys: str) -> float | None:
        """Return a number of the rover file; see ``fields.setting``."""
        return setting(self.record, *keys)


@dataclass(slots=True)
class Tick(RunEvent):
    """One control tick, under the names of its keys; from ``counter_deg`` on what the algorithm remembers.

    ``motion`` is what the motion sensor said since the tick before, NaN where it could not tell. The fold adds the
    last four: ``period_s`` since the tick before, NaN where records are missing between the two; ``place``, where dead
    reckoning has the rover, None without a heading; ``path_m``, how far it went; and ``measured_m_s``, the speed that
    the motion sensor measured, NaN where it could not.
    """

    record: Record
    motion: MotionReading | None
    heading_deg: float | None
    pitch_deg: float | None
    roll_deg: float | None
    anomalies: tuple[str, ...]
    goal_heading_deg: float | None
    travelled_m: float | None
    covered_m: float | None
    phase: str | None
    why: str | None
    wanted_left: float | None
    wanted_right: float | None
    applied_left: float | None
    applied_right: float | None
    level: str | None
    cause: str | None
    counter_deg: float | None
    side: float | None
    turn_deg: float | None
    episodes: float | None
    blocked_turns: float | None
    turn_from_duty: float | None
    period_s: float = nan
    place: ReckonedPose | None = None
    path_m: float = 0.0
    measured_m_s: float = nan

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Tick:
        """Return the view of a ``tick`` record."""
        get = record.get
        return cls(
            elapsed_s, record["t_s"], record, _motion(get("motion")),
            get("heading_deg"), get("pitch_deg"), get("roll_deg"),
            names(record, "anomalies"),
            get("goal_heading_deg"), get("travelled_m"), get("covered_m"),
            name(record, "phase"), name(record, "why"),
            get("wanted_left"), get("wanted_right"), get("applied_left"), get("applied_right"),
            name(record, "level"), name(record, "cause"),
            number(record, "counter_deg"), number(record, "side"), number(record, "turn_deg"),
            number(record, "episodes"), number(record, "blocked_turns"), number(record, "turn_from_duty"),
        )  # fmt: skip

    @property
    def duty(self) -> float | None:
        """Return the larger duty of the two sides, None where neither is known."""
        return max((abs(duty) for duty in (self.applied_left, self.applied_right) if duty is not None), default=None)


@dataclass(slots=True)
class Board(RunEvent):
    """What the motor board said of itself."""

    battery_v: float | None
    faults: tuple[str, ...]

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Board:
        """Return the view of a ``board`` record."""
        return cls(elapsed_s, record["t_s"], number(record, "battery_v"), names(record, "faults"))


@dataclass(slots=True)
class Fix(RunEvent):
    """A position from the receiver; ``error_m`` is horizontal, None where it is unknown."""

    latitude_deg: float
    longitude_deg: float
    error_m: float | None

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Fix | None:
        """Return the view of a ``position`` record, None where it does not say where."""
        latitude_deg, longitude_deg = record.get("latitude_deg"), record.get("longitude_deg")
        if latitude_deg is None or longitude_deg is None:
            return None
        return cls(elapsed_s, record["t_s"], latitude_deg, longitude_deg, record.get("error_m"))


@dataclass(slots=True)
class Computer(RunEvent):
    """How the computer is; ``throttled`` are the power and heat bits as hexadecimal text."""

    cpu_c: float | None
    throttled: str | None
    load_1min: float | None
    disk_free_mb: float | None
    log_dropped: int | None

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Computer:
        """Return the view of a ``computer`` record."""
        numbers = (record.get(key) for key in ("load_1min", "disk_free_mb", "log_dropped"))
        return cls(elapsed_s, record["t_s"], record.get("cpu_c"), name(record, "throttled"), *numbers)

    @property
    def bits(self) -> str:
        """Return the power and heat bits; empty where none is set."""
        return (self.throttled or "").removeprefix("0x").lstrip("0")


@dataclass(slots=True)
class Truth(RunEvent):
    """Where a simulated rover really is, in the metres of its forest; an angle that is not there is 0."""

    x_m: float
    y_m: float
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    slipping: bool | None
    touching: bool | None

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Truth | None:
        """Return the view of a ``truth`` record, None where it does not say where."""
        get, x_m, y_m = record.get, record.get("x_m"), record.get("y_m")
        if x_m is None or y_m is None:
            return None
        heading_deg, pitch_deg, roll_deg = (get(key) or 0.0 for key in ("heading_deg", "pitch_deg", "roll_deg"))
        slipping, touching = get("slipping"), get("touching")
        return cls(elapsed_s, record["t_s"], x_m, y_m, heading_deg, pitch_deg, roll_deg, slipping, touching)


def _motion(said: Mapping[str, Any] | None) -> MotionReading | None:
    """Return what the motion sensor said; JSON has no NaN, so that a number which was none is null in the log."""
    if not said:
        return None
    forward_m, right_m, quality = number(said, "forward_m"), number(said, "right_m"), number(said, "quality")
    return MotionReading(
        number(said, "t_s") or nan,
        nan if forward_m is None else forward_m,
        nan if right_m is None else right_m,
        nan if quality is None else quality,
        said.get("signed") is not False,
    )


def _world(world: Record) -> Record | None:
    """Return what is drawn of a simulated forest, None where that is not all there."""
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
