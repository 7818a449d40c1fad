"""The state of a run so far, which ``run_fold.RunFold`` keeps. Bounded: it does not grow with the log."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from math import nan

from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.run_events import Ended
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.typed import Board, Fix, Header, Tick


@dataclass(frozen=True, slots=True)
class LowBattery:
    """The lowest voltage, seconds since the first record, and the larger duty of the two sides then, None: unknown."""

    battery_v: float
    at_s: float
    duty: float | None


@dataclass(slots=True)
class RunState:
    """The state of a run.

    ``first`` and ``last`` are the records at both ends, ``elapsed_s`` the seconds from the one to the other, and
    ``lasted_s`` those to the latest of all: a position is a little older than the record before it. Before the first
    header, tick or motor board report, those are views without values.

    ``mode`` is ``disarmed``, ``arming``, ``armed``, ``manual`` or ``ended``. ``place`` is the latest by dead reckoning,
    metres from where the log begins, and ``start`` where the rover was first armed, if that is in the log
    (``from_start``; None: it was not armed yet). ``path_m`` is the way by dead reckoning, ``commanded_m`` the one
    commanded, and ``driven_m`` the true one of a simulated rover, None of any other; all three forwards and backwards
    added up. ``mission_s`` and ``mission_m`` are those of the last mission.

    ``armed_s`` is the time armed, ``held_s`` the part of it with the wheels held, by cause, ``limited_s`` that of
    driving with limits (level ``degrade``). ``cause_since_s`` is when the present cause began. ``anomalies`` counts
    beginnings by kind, ``recoveries`` how often the rover backed off, ``exhausted`` the phases that reached their
    bound, ``events`` the events by name. ``episodes`` counts those of all missions, by the phases (``missions.py``).
    ``stretch`` grows wherever the log breaks off: where records are missing, and where there is no tick for a while.
    ``missing`` are the records missing so far, ``dropped`` those that could not be written.
    """

    header: Header = field(default_factory=lambda: Header.of({}))
    first: Record = field(default_factory=dict)
    last: Record = field(default_factory=dict)
    elapsed_s: float = 0.0
    lasted_s: float = 0.0
    mode: str = "disarmed"
    why_disarmed: str = "not armed since the start"
    operator_hold: bool = False
    goal_heading_deg: float | None = None
    tick: Tick = field(default_factory=lambda: Tick.of(nan, {"t_s": nan}))
    board: Board = field(default_factory=lambda: Board(nan, nan))
    fix: Fix | None = None
    first_fix: Fix | None = None
    ended: Ended | None = None
    place: ReckonedPose | None = None
    start: ReckonedPose | None = None
    from_start: bool | None = None
    path_m: float = 0.0
    commanded_m: float | None = None
    driven_m: float | None = None
    mission_s: float = 0.0
    mission_m: float = 0.0
    armed_s: float = 0.0
    held_s: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    limited_s: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    cause_since_s: float = 0.0
    ticks: int = 0
    anomalies: Counter[str] = field(default_factory=Counter)
    episodes: int = 0
    recoveries: int = 0
    exhausted: Counter[str] = field(default_factory=Counter)
    events: Counter[str] = field(default_factory=Counter)
    low_battery: LowBattery | None = None
    sensors: dict[str, SensorStatus] = field(default_factory=dict)
    stretch: int = 0
    missing: int = 0
    dropped: int = 0

    @property
    def t_s(self) -> float:
        """Return the loop's clock at the newest record."""
        return float(self.last.get("t_s", 0.0))
