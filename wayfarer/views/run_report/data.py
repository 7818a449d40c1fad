"""The data of a run's report, read from its log in a single pass (``run_reading``).

Times are seconds since the first record. An unknown number is NaN, which is a gap in a line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.fieldlog.episodes import Episode
from wayfarer.fieldlog.fields import setting
from wayfarer.fieldlog.reader import Damage, Record
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.typed import or_nan
from wayfarer.safety.conditions import Level
from wayfarer.views.text.run_summariser import summarise
from wayfarer.views.text.summary import RunSummary

Floats = NDArray[np.float64]
Columns = Mapping[str, Floats]

GAP_S = 1.0  # no record for so long: lines are broken there
PHASES = tuple(phase.value for phase in Phase)
LEVELS = {level.name.lower(): float(level) for level in Level}
ANOMALIES = frozenset(anomaly.value for anomaly in Anomaly)


class Tick(NamedTuple):
    """One control tick, as drawn. ``phase`` counts in ``PHASES``; ``level`` is ``conditions.Level``.

    ``period_s`` is the time since the tick before, NaN where records are missing between the two. ``stretch`` counts
    the gaps before it: records are missing between two that differ in it.
    """

    t_s: float
    phase: float
    level: float
    heading_deg: float
    goal_heading_deg: float
    counter_deg: float
    pitch_deg: float
    roll_deg: float
    commanded_m_s: float
    measured_m_s: float
    duty: float
    period_s: float
    north_m: float
    east_m: float
    stretch: float


class TruePose(NamedTuple):
    """Where a simulated rover really was, in the metres of its forest; ``stretch`` as in ``Tick``."""

    t_s: float
    x_m: float
    y_m: float
    phase: float
    stretch: float


class Onset(NamedTuple):
    """An anomaly that was not there in the tick before."""

    t_s: float
    kind: str


class LoggedEvent(NamedTuple):
    """An ``event`` record and its name; ``mark`` counts the marks from 1 and is 0 for any other event."""

    t_s: float
    name: str
    record: Record
    mark: int


class MapFix(NamedTuple):
    """A position: degrees, the horizontal error in metres, and where dead reckoning had the rover then."""

    t_s: float
    latitude_deg: float
    longitude_deg: float
    error_m: float
    north_m: float
    east_m: float


@dataclass
class RunData:
    """Everything of one run that its report shows."""

    header: Record = field(default_factory=dict)
    summary: RunSummary = field(default_factory=lambda: summarise([]))
    damage: Damage = field(default_factory=Damage)
    ticks: Columns = field(default_factory=lambda: columns(Tick, []))
    truth: Columns = field(default_factory=lambda: columns(TruePose, []))
    batteries: list[tuple[float, float]] = field(default_factory=list)
    onsets: list[Onset] = field(default_factory=list)
    events: list[LoggedEvent] = field(default_factory=list)
    fixes: list[MapFix] = field(default_factory=list)
    episodes: list[Episode] = field(default_factory=list)
    sensors: dict[str, SensorStatus] = field(default_factory=dict)

    @property
    def has_way(self) -> bool:
        """Return whether anybody can say where the rover went."""
        return bool(self.fixes) or not bool(np.isnan(self.ticks["north_m"]).all())

    def setting(self, *keys: str) -> float:
        """Return a number of the rover file, NaN where the header does not have it."""
        return or_nan(setting(self.header, *keys))


def columns(kind: type[Tick] | type[TruePose], flat: Any) -> Columns:
    """Return the columns of rows that stand one after the other."""
    names = kind._fields
    return dict(zip(names, np.array(flat, dtype=np.float64).reshape(-1, len(names)).T, strict=True))
