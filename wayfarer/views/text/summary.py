"""The summary of a run: distance, duration, anomalies, and where the rover is likely to be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wayfarer.fieldlog.run_state import LowBattery
from wayfarer.views.text.last_position import LastPosition


@dataclass(frozen=True, slots=True)
class Mark:
    """A person's note; ``at_s`` is the time since the beginning."""

    at_s: float
    text: str


@dataclass(frozen=True, slots=True)
class PeriodPercentiles:
    """Median, 99th percentile and longest of the control periods, the time between two ticks; seconds."""

    p50_s: float
    p99_s: float
    max_s: float


@dataclass(frozen=True, slots=True)
class RunSummary:
    """The summary of a run; a value that its log does not have is None (without a header also ``simulated``).

    ``trial`` is the number of a simulated trial, which has virtual time and no ``began_wall_s``. ``lasted_s`` is from
    the first record to the last, ``armed_s`` the part of it while armed, ``held_s`` the part of that with the wheels
    held, by cause, ``limited_s`` that of driving with limits. ``commanded_m`` is the commanded distance and
    ``reckoned_m`` that of dead reckoning, both forwards and backwards added up.

    ``anomalies`` counts beginnings by kind, ``episodes`` those of all missions, ``recoveries`` how often the rover
    backed off, ``exhausted`` the phases that reached their bound. ``late_ticks`` came more than ``tick_late_s`` of the
    rover file after the tick before. ``sensor_failures`` is by sensor, ``failures`` by name of the event.
    ``dropped`` counts the records that could not be written.
    """

    rover: str | None
    algorithm: str | None
    version: str | None
    seed: int | None
    trial: int | None
    simulated: bool | None
    dry_run: bool | None
    began_wall_s: float | None
    lasted_s: float
    armed_s: float
    held_s: Mapping[str, float]
    limited_s: Mapping[str, float]
    commanded_m: float | None
    reckoned_m: float
    anomalies: Mapping[str, int]
    episodes: int
    recoveries: int
    exhausted: Mapping[str, int]
    low_battery: LowBattery | None
    ticks: int
    period: PeriodPercentiles | None
    late_ticks: int
    sensor_failures: Mapping[str, int]
    failures: Mapping[str, int]
    marks: tuple[Mark, ...]
    holds: int
    goals: int
    clock_steps_s: tuple[float, ...]
    dropped: int
    reason: str | None
    text: str | None
    where: LastPosition
