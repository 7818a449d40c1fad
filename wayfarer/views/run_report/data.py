"""The data of a run's report, read from its log in a single pass (``reading``).

Times are seconds since the first record. An unknown number is NaN, which is a gap in a line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.escape.api import Phase
from wayfarer.fieldlog.episodes import Episode
from wayfarer.fieldlog.fields import number, setting
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.run_events import AnomalyBegan, Noted, Silence
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.typed import or_nan
from wayfarer.safety.conditions import Level
from wayfarer.views.text.summary import RunSummary

Floats = NDArray[np.float64]
Columns = Mapping[str, Floats]

PHASES = tuple(phase.value for phase in Phase)
LEVEL_NUMBERS = {level.name.lower(): float(level) for level in Level}


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
    """Everything of one run that its report shows.

    ``ticks`` has a column for each name in ``load_run.TICK``: ``phase`` counts in ``PHASES``, ``level`` is
    ``conditions.Level``, and ``period_s`` is NaN where records are missing since the tick before. ``further`` has the
    numbers that ticks have under keys that no view names. ``truth`` is where a simulated rover really was, in the
    metres of its forest. ``batteries`` are the voltages and the seconds since the motor board spoke before. These
    tables have a column ``stretch``: the log breaks off between two rows that differ in it.
    """

    header: Record = field(default_factory=dict)
    summary: RunSummary = field(init=False)
    damage: Damage = field(init=False)
    ticks: Columns = field(default_factory=dict)
    further: Columns = field(default_factory=dict)
    truth: Columns = field(default_factory=dict)
    sensors: Mapping[str, SensorStatus] = field(default_factory=dict)
    batteries: Columns = field(default_factory=dict)
    onsets: list[AnomalyBegan] = field(default_factory=list)
    events: list[Noted | Silence] = field(default_factory=list)
    fixes: list[MapFix] = field(default_factory=list)
    episodes: list[Episode] = field(default_factory=list)

    @property
    def has_way(self) -> bool:
        """Return whether anybody can say where the rover went."""
        return bool(self.fixes) or not bool(np.isnan(self.ticks["north_m"]).all())

    @property
    def goals(self) -> list[tuple[float, float]]:
        """Return when the rover took each goal, and its heading in degrees.

        Of a log that begins after the first one, it is that of the first tick in which the rover does not halt: a
        disarmed rover halts, and its ticks have a goal that nobody gave.
        """
        events = [event for event in self.events if isinstance(event, Noted) and event.name in {"armed", "goal"}]
        if events:
            told = ((event.elapsed_s, number(event.record, "goal_heading_deg")) for event in events)
            return [(t_s, goal_deg) for t_s, goal_deg in told if goal_deg is not None]
        known = ~np.isnan(self.ticks["goal_heading_deg"]) & (self.ticks["phase"] != PHASES.index(Phase.HALT.value))
        return list(zip(*(self.ticks[name][known][:1].tolist() for name in ("t_s", "goal_heading_deg")), strict=True))

    def setting(self, *keys: str) -> float:
        """Return a number of the rover file, NaN where the header does not have it."""
        return or_nan(setting(self.header, *keys))
