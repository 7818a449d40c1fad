"""Counts what the latest mission of a run has come to.

The next run tells of it after a power-up. It reads the end of this run's log only, so the totals are in there every
10 s, with the computer's health: a rover may stand disarmed for days before somebody switches it off.
"""

from __future__ import annotations

from typing import Any

from wayfarer.control.run_log import PartialLog, RunLog
from wayfarer.control.tick_record import TickRecord
from wayfarer.escape.api import Anomaly, Phase
from wayfarer.fieldlog.last_run import MISSION_TOTALS


class MissionTotals(PartialLog):
    """Follows a run, and writes an event at the end of each mission, also where the run ends first.

    What a person drives during a mission counts as time only, as in ``wayfarer status``.

    Args:
        log: takes the event; must be told of the run after this, because it takes none after the outcome.
    """

    def __init__(self, log: RunLog) -> None:
        self._log = log
        self._began_s: float | None = None
        self._at_m: float | None = None  # of all that the run has commanded so far
        self._driven_m = 0.0
        self._before: tuple[Anomaly, ...] = ()
        self._totals: dict[str, Any] = dict.fromkeys(MISSION_TOTALS)

    @property
    def totals(self) -> dict[str, Any]:
        """Return seconds, commanded metres, anomalies, and why it ended (None: it goes on); all None before one."""
        return dict(self._totals)

    def tick(self, record: TickRecord) -> None:
        """Count a tick of a mission."""
        seen = record.observation
        if self._began_s is None or seen is None:
            return
        moved_m = 0.0 if self._at_m is None else seen.travelled_m - self._at_m
        if record.decision.phase is not Phase.MANUAL:
            self._driven_m += moved_m
            self._totals["mission_anomalies"] += len(set(seen.anomalies).difference(self._before))
        self._at_m, self._before = seen.travelled_m, seen.anomalies
        self._totals["mission_s"] = round(record.t_s - self._began_s, 1)
        self._totals["mission_m"] = round(self._driven_m, 2)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Begin or end a mission."""
        if name == "armed":
            self._began_s, self._at_m, self._driven_m, self._before = t_s, None, 0.0, ()
            self._totals |= {"mission_s": 0.0, "mission_m": 0.0, "mission_anomalies": 0, "mission_ended": None}
        elif name == "disarmed" and self._began_s is not None:
            self._totals["mission_ended"] = details["reason"]
            self._tell(t_s)

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002 - as any RunLog
        """Tell of a mission that went on until the end of the run: its totals are up to 10 s old in the log."""
        if self._began_s is not None:
            self._tell(self._began_s + self._totals["mission_s"])

    def _tell(self, t_s: float) -> None:
        self._began_s = None
        told = self._totals
        self._log.event(
            "mission_ended", t_s, mission_s=told["mission_s"], mission_m=told["mission_m"],
            mission_anomalies=told["mission_anomalies"], mission_ended=told["mission_ended"],
        )  # fmt: skip
