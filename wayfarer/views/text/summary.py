"""The summary of a run: distance, duration, anomalies, and where the rover is likely to be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wayfarer.views.text.last_position import LastPosition
from wayfarer.views.text.periods import PeriodPercentiles


@dataclass(frozen=True, slots=True)
class Mark:
    """A person's note, so many seconds after the beginning."""

    at_s: float
    text: str


@dataclass(frozen=True, slots=True)
class LowBattery:
    """The lowest voltage, when it was, and the larger duty of the two sides then (None where that is not known)."""

    battery_v: float
    at_s: float
    duty: float | None


@dataclass(frozen=True, slots=True)
class RunSummary:
    """What came of a run; what its log does not tell is None, or not counted: without a header ``simulated``, too.

    ``trial`` is the number of a simulated trial, which has virtual time and no ``began_wall_s``. Times are
    seconds: ``lasted_s`` from the first record to the last, ``armed_s`` of it with wheels that may turn,
    ``held_s`` of that with wheels held, by cause. ``commanded_m`` is what the wheels were told and
    ``reckoned_m`` what dead reckoning saw of it, both forwards and backwards counted up.

    ``anomalies`` counts beginnings by kind, ``episodes`` is over all missions of the run, ``recoveries`` is how often
    the rover backed off, ``exhausted`` counts phases that ran out. ``late_ticks`` came later than the rover file's
    ``tick_late_s`` after the tick before. ``sensor_failures`` counts by sensor, ``failures`` the other events of that
    kind by name. ``dropped`` is how many records the log itself says it could not write.
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
