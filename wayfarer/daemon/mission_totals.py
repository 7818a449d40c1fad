"""Counts what the latest mission of a run has come to.

The next run tells of it after a power-up. It reads the end of this run's log only, so the totals are in there every
10 s, with the computer's health: a rover may stand disarmed for days before somebody switches it off.
"""

from __future__ import annotations

from typing import Any

from wayfarer.control.run_log import PartialLog, RunLog
from wayfarer.control.tick_record import TickRecord
from wayfarer.escape.api import Anomaly


class MissionTotals(PartialLog):
    """Follows a run, and writes an event at the end of each mission, also where the run ends first.

    Args:
        log: takes the event; must be told of the run after this, because it takes none after the outcome.
    """

    def __init__(self, log: RunLog) -> None:
        self._log = log
        self._began_s: float | None = None
        self._from_m: float | None = None
        self._before: tuple[Anomaly, ...] = ()
        self._totals: dict[str, Any] = dict.fromkeys(
            ("mission_s", "mission_m", "mission_anomalies", "mission_ended"), None
        )

    @property
    def totals(self) -> dict[str, Any]:
        """Return seconds, commanded metres, anomalies, and why it ended (None: it goes on); all None before one."""
        return dict(self._totals)

    def tick(self, record: TickRecord) -> None:
        """Count a tick of a mission."""
        seen = record.observation
        if self._began_s is None or seen is None:
            return
        if self._from_m is None:
            self._from_m = seen.travelled_m
        if seen.anomalies != self._before:
            self._totals["mission_anomalies"] += len(set(seen.anomalies).difference(self._before))
            self._before = seen.anomalies
        self._totals["mission_s"] = round(record.t_s - self._began_s, 1)
        self._totals["mission_m"] = round(seen.travelled_m - self._from_m, 2)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Begin or end a mission."""
        if name == "armed":
            self._began_s, self._from_m, self._before = t_s, None, ()
            self._totals = {"mission_s": 0.0, "mission_m": 0.0, "mission_anomalies": 0, "mission_ended": None}
        elif name == "disarmed" and self._began_s is not None:
            self._totals["mission_ended"] = details["reason"]
            self._tell(t_s)

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002 - as any RunLog
        """Tell of a mission that went on until the end of the run: its totals are up to 10 s old in the log."""
        if self._began_s is not None:
            self._tell(self._began_s + self._totals["mission_s"])

    def _tell(self, t_s: float) -> None:
        self._began_s = None
        s, m, anomalies, ended = self._totals.values()
        self._log.event(
            "mission_ended", t_s, mission_ended=ended, mission_s=s, mission_m=m, mission_anomalies=anomalies
        )
