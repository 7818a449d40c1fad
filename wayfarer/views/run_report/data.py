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
from wayfarer.fieldlog.fields import setting
from wayfarer.fieldlog.reader import Damage, Record
from wayfarer.fieldlog.run_events import AnomalyBegan, Noted
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.typed import or_nan
from wayfarer.safety.conditions import Level
from wayfarer.views.text.summary import RunSummary

Floats = NDArray[np.float64]
Columns = Mapping[str, Floats]

GAP_S = 1.0  # no record for so long: lines are broken there
PHASES = tuple(phase.value for phase in Phase)
LEVELS = {level.name.lower(): float(level) for level in Level}


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

    ``ticks`` has a column for each name in ``reading.TICK``: ``phase`` counts in ``PHASES``, ``level`` is
    ``conditions.Level``, ``period_s`` is NaN where records are missing since the tick before, and ``stretch`` counts
    the gaps so far: records are missing between two ticks that differ in it. ``truth`` is where a simulated rover
    really was, in the metres of its forest.
    """

    header: Record = field(default_factory=dict)
    summary: RunSummary = field(init=False)
    damage: Damage = field(init=False)
    ticks: Columns = field(default_factory=dict)
    truth: Columns = field(default_factory=dict)
    sensors: Mapping[str, SensorStatus] = field(default_factory=dict)
    batteries: list[tuple[float, float]] = field(default_factory=list)
    onsets: list[AnomalyBegan] = field(default_factory=list)
    events: list[Noted] = field(default_factory=list)
    fixes: list[MapFix] = field(default_factory=list)
    episodes: list[Episode] = field(default_factory=list)

    @property
    def has_way(self) -> bool:
        """Return whether anybody can say where the rover went."""
        return bool(self.fixes) or not bool(np.isnan(self.ticks["north_m"]).all())

    def setting(self, *keys: str) -> float:
        """Return a number of the rover file, NaN where the header does not have it."""
        return or_nan(setting(self.header, *keys))
