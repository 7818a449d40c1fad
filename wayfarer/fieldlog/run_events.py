"""What happened in a run, as ``run_fold.RunFold`` yields it; ``typed`` has what was read. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import number, safe_text, table
from wayfarer.fieldlog.header import Header
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import RunEvent


@dataclass(slots=True)
class RunBegan(RunEvent):
    """The log says what ran. ``late``: its first parts are gone, and no record came before this one."""

    header: Header
    late: bool


@dataclass(slots=True)
class Ended(RunEvent):
    """The run is over; ``dropped`` records could not be written."""

    reason: str | None
    text: str | None
    dropped: int


@dataclass(slots=True)
class Gap(RunEvent):
    """So many records are missing before this time; ``announced``: a ``log_gap`` has just said the same."""

    missing: int
    announced: bool


@dataclass(slots=True)
class Silence(RunEvent):
    """The log has no control tick for longer than ``GAP_S``: from ``began_s``, elapsed seconds as well, until this one.

    The loop was held up, or the records are missing; then there is a ``Gap`` as well.
    """

    began_s: float

    @property
    def for_s(self) -> float:
        """Return how long it lasted."""
        return self.elapsed_s - self.began_s


# -- changes from one record to the next -----------------------------------------------------------------------------


@dataclass(slots=True)
class PhaseChanged(RunEvent):
    """The rover does something else now; the tick that follows says why."""

    phase: str | None


@dataclass(slots=True)
class AnomalyBegan(RunEvent):
    """An anomaly that was not there in the tick before; ``place`` is where dead reckoning had the rover."""

    kind: str
    phase: str | None
    place: ReckonedPose | None


@dataclass(slots=True)
class BoardFaults(RunEvent):
    """The motor board reports other faults than before; none: it is well again."""

    faults: tuple[str, ...]


@dataclass(slots=True)
class BatteryChanged(RunEvent):
    """The battery's voltage is lower than any told so far, or the battery was changed."""

    battery_v: float


@dataclass(slots=True)
class PowerChanged(RunEvent):
    """The computer's power and heat bits changed; empty: it is well again."""

    bits: str


# -- records that tell of something ----------------------------------------------------------------------------------


@dataclass(slots=True)
class FaultInjected(RunEvent):
    """A scenario's fault begins or ends; ``for_s`` is None where it lasts to the end of the run."""

    target: str | None
    kind: str | None
    begins: bool
    for_s: float | None
    params: Mapping[str, Any]

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> FaultInjected:
        """Return what a ``fault`` record tells."""
        begins = record.get("begins") is True
        target, kind, for_s = safe_text(record, "target"), safe_text(record, "kind"), record.get("for_s")
        return cls(elapsed_s, record["t_s"], target, kind, begins, for_s, table(record, "params"))


@dataclass(slots=True)
class Noted(RunEvent):
    """An ``event`` record. It keeps all its keys: a new one is told without a change here (``wording.event_text``)."""

    name: str
    record: Record

    @staticmethod
    def of(elapsed_s: float, record: Record) -> Noted:
        """Return what an ``event`` record tells."""
        what = event_name(record)
        return BY_NAME.get(what, Noted)(elapsed_s, record["t_s"], what, record)


class Arming(Noted):
    """Arming was requested."""


class Armed(Noted):
    """The mission begins."""


class Disarmed(Noted):
    """The wheels are stopped until re-armed."""


class Held(Noted):
    """An operator asked to hold the wheels."""


class Released(Noted):
    """An operator asked to drive on."""


class GoalSet(Noted):
    """Another goal was asked for."""


class SensorFailed(Noted):
    """A sensor did not answer."""

    @property
    def sensor(self) -> str:
        """Return which."""
        return safe_text(self.record, "sensor") or "unknown"


class ClockStep(Noted):
    """The wall clock was set."""

    @property
    def by_s(self) -> float:
        """Return by how much."""
        return number(self.record, "by_s") or 0.0


@dataclass(slots=True)
class Marked(Noted):
    """A person's note; they are numbered from 1."""

    number: int = 0

    @property
    def text(self) -> str:
        """Return what it says."""
        return safe_text(self.record, "text") or ""


BY_NAME: Mapping[str, type[Noted]] = {
    "arming": Arming, "armed": Armed, "disarmed": Disarmed, "hold": Held, "resume": Released, "goal": GoalSet,
    "sensor_failed": SensorFailed, "clock_step": ClockStep, "mark": Marked,
}  # fmt: skip


def event_name(event: Record) -> str:
    """Return the name of an event, also of a damaged one."""
    return safe_text(event, "name") or "event"
