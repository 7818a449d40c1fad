"""What happened in a run, as ``run_fold.RunFold`` yields it; ``typed`` has what was read. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from wayfarer.fieldlog import schema
from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import safe_text
from wayfarer.fieldlog.schema import Record, fields_of
from wayfarer.fieldlog.typed import Header, RunEvent


@dataclass(slots=True)
class RunBegan(RunEvent):
    """The log says what ran. ``late``: its first parts are gone, and no record came before this one."""

    header: Header
    late: bool


@dataclass(slots=True)
class Ended(RunEvent):
    """The run is over; ``dropped`` records could not be written."""

    reason: schema.Text = None
    text: schema.Text = None
    dropped: Annotated[int, schema.COUNT] = 0


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
    """A scenario's fault begins or ends; ``for_s`` is None if it lasts to the end of the run."""

    target: schema.Text = None
    kind: schema.Text = None
    begins: Annotated[bool, schema.FLAG] = False
    for_s: schema.Lasting = None
    params: Annotated[Mapping[str, Any], schema.TABLE] = field(default_factory=dict)


@dataclass(slots=True)
class Noted(RunEvent):
    """An ``event`` record. It keeps all its keys: a new one is told without a change here (``wording.event_text``).

    Which of the keys it has depends on its ``name``. The fold gives a ``mark`` its ``number``, from 1.
    """

    record: Record
    name: Annotated[str, schema.TEXT] = "event"
    start_delay_s: schema.Lasting = None
    goal_heading_deg: schema.Angle = None
    failed: schema.Texts = ()
    reason: schema.Text = None
    text: Annotated[str, schema.TEXT] = ""
    level: schema.Text = None
    cause: schema.Text = None
    sensor: Annotated[str, schema.TEXT] = "unknown"
    error: schema.Text = None
    retry_in_s: schema.Lasting = None
    flags: schema.Text = None
    part: schema.Text = None
    counts: schema.Table = None
    run: schema.Text = None
    armed_t_wall: schema.Since1970 = None
    mode: schema.Text = None
    mission_s: schema.Lasting = None
    mission_m: schema.Metres = None
    mission_anomalies: schema.Count = None
    mission_ended: schema.Text = None
    stall_s: schema.Lasting = None
    by_s: Annotated[float, schema.Values(schema.NUMBER, -1e10, 1e10)] = 0.0  # a clock is set from any time to any other
    dropped: Annotated[int, schema.COUNT] = 0
    where: schema.Text = None
    runs: schema.Texts = ()
    deleted_mb: Annotated[float, schema.Values(schema.NUMBER, 0.0, 1e12)] = 0.0
    left_mb: Annotated[float, schema.Values(schema.NUMBER, 0.0, 1e12)] = 0.0
    driver: schema.Text = None
    lost: schema.Text = None

    number: int = 0

    @classmethod
    def of(cls, elapsed_s: float, record: Record) -> Noted:
        """Return what an ``event`` record says."""
        return cls(elapsed_s, record["t_s"], record, **fields_of(cls, record))


def event_name(event: Record) -> str:
    """Return the name of an event, also of a damaged one."""
    return safe_text(event, "name") or "event"
