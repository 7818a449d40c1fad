"""The field log of a run: makes records of what it reports, one JSON object a line, for ``tail -F``, ``jq`` and views.

The first record says what ran (version, algorithm, the rover's whole configuration), the last how it ended; between
them there is one for each control tick and each event. Ticks go to the sink directly; events come from the structlog
logger of ``control.run_log``, with their context. ``record`` describes them all.

Logging can never raise into control: what cannot be written is dropped and counted, and the rover drives on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from wayfarer import __version__
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.fieldlog.clock import ELAPSED_DECIMALS, WallClock, wall_clock
from wayfarer.fieldlog.reader import Lines
from wayfarer.fieldlog.record import (
    SCHEMA,
    AnyRecord,
    Board,
    Compass,
    Contact,
    Event,
    Fix,
    Header,
    Manual,
    Motion,
    Outcome,
    Record,
    Tick,
    Wheels,
    encode,
)
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import MotorHealth, PositionFix, WheelCommand

STEP_S = 1.0  # more than a clock is slewed between two records; finding the right time steps it by hours
OF_EVENT = {"text", "severity", "run", "mission"}  # what an event has beside its details


class FieldLog(RunLog):
    """Makes records of what a run reports and passes each on as a line; implements ``control.run_log.RunLog``.

    Args:
        sink: where the lines go.
        details: what else the first record says, by the keys of ``record.Header``: algorithm, configuration, seed.
        wall: the computer's wall clock, given the loop's time.
        t_s: the loop's time at which the run begins.
        viewers: each is shown every record as a reader of the log will have it, and must neither wait nor change it;
            one that raises is not asked again.

    Raises:
        BadInput: the sink cannot be opened.
    """

    def __init__(
        self,
        sink: Sink,
        details: Mapping[str, Any],
        wall: WallClock = wall_clock,
        t_s: float = 0.0,
        viewers: Sequence[Callable[[AnyRecord], object]] = (),
    ) -> None:
        self._sink = sink
        self._wall = wall
        self._zero_s = wall(t_s) - t_s  # the wall time at which the loop's was 0
        self._viewers = list(viewers)
        self._details = {"version": __version__, **details}
        self._began_s = self._t_s = t_s
        self._number = 0
        self._unmade = 0
        self._shown = Lines()
        sink.open(self._header)
        self._show(self._header(1))

    @property
    def dropped(self) -> int:
        """How many records did not get into the log."""
        return self._unmade + self._sink.dropped

    def tick(self, record: TickRecord) -> None:
        """Write a control tick: what was seen, wanted, and applied."""
        self._note_clock_step(record.t_s)
        self._write(Tick, record.t_s, record)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Write something that happened."""
        about = {key: details[key] for key in OF_EVENT & details.keys()}
        data = {key: value for key, value in details.items() if key not in OF_EVENT and value is not None}
        self._write(Event, t_s, {"text": name, **about, "name": name, "data": data}, urgent=True)

    def position(self, fix: PositionFix | None) -> None:
        """Write a position."""
        if fix is not None:
            fields = fix._asdict()
            self._write(Fix, fields.pop("t_s"), fields, urgent=True)

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Write what the motor board reports."""
        left, right = duties or (None, None)
        self._write(Board, t_s, {**health._asdict(), "says_left": left, "says_right": right})

    def note(self, kind: type[Record], t_s: float, fields: Mapping[str, Any]) -> None:
        """Write a record of another kind: ``Computer``, or a simulation's ``Truth``."""
        self._write(kind, t_s, fields)

    def close(self, reason: str, text: str) -> None:
        """Write the outcome and close the log."""
        self._write(Outcome, self._t_s, {"reason": reason, "text": text, "dropped": self.dropped}, urgent=True)
        self._sink.close()

    def _write(
        self, kind: type[Record], t_s: float, fields: Mapping[str, Any] | TickRecord, *, urgent: bool = False
    ) -> None:
        self._t_s = t_s
        self._number += 1
        try:
            if isinstance(fields, TickRecord):
                fields = tick_fields(fields)
            line = encode(kind(n=self._number, **self._stamp(), **fields))
        except Exception:  # a third party's memory() or decision, or a key that is not text; no log is worth a run
            self._unmade += 1  # its number is missing, which a reader sees
            return
        self._sink.put(line, urgent)
        self._show(line)

    def _stamp(self) -> dict[str, float]:
        """Return the times of a record; that of the loop is whole, for replay."""
        t_s = self._t_s
        elapsed_s = round(t_s - self._began_s, ELAPSED_DECIMALS)
        return {"t_s": t_s, "elapsed_s": elapsed_s, "t_wall": round(self._wall(t_s), 3)}

    def _note_clock_step(self, t_s: float) -> None:
        """Write down that the computer's clock was set, before the first record with the new time."""
        zero_s = self._wall(t_s) - t_s
        step_s, self._zero_s = zero_s - self._zero_s, zero_s
        if abs(step_s) > STEP_S:
            text = f"The computer's clock was set by {step_s:+.0f} s"
            self.logger.warning("clock_step", t_s=t_s, text=text, by_s=round(step_s, 3))

    def _header(self, part: int) -> bytes:
        """Return the first line of a part of the log."""
        about: dict[str, Any] = {**self._stamp(), **self._details}
        return encode(Header(schema=SCHEMA, part=part, **about))

    def _show(self, line: bytes) -> None:
        """Show a record; a failing viewer must not end the log."""
        if not self._viewers or (shown := self._shown.parse(line)) is None:
            return
        failed: list[Exception] = []
        for viewer in list(self._viewers):
            try:
                viewer(shown)
            except Exception as error:
                self._viewers.remove(viewer)
                failed.append(error)
        for failure in failed:  # further records, which the other viewers are shown after this one
            text = f"An error inside wayfarer, in a viewer: {failure!r}"
            self.logger.warning("viewer_failed", t_s=self._t_s, text=text, error=repr(failure))


def tick_fields(tick: TickRecord) -> dict[str, Any]:
    """Return what the log keeps of a control tick, by the keys of ``record.Tick``.

    The readings are as the sensors gave them, because a replay starts from them.
    """
    compass, motion, contact, rims, manual = tick.compass, tick.motion, tick.contact, tick.rims, tick.manual
    decision, seen = tick.decision, tick.observation
    fields: dict[str, Any] = {
        "mode": tick.mode.value,
        "held": tick.held,
        "phase": decision.phase.value,
        "why": str(decision.why),
        "compass": compass and Compass(*compass),
        "motion": motion and Motion(*motion),
        "contact": contact
        and Contact(contact.t_s, tuple(side.value for side in contact.sides), contact.obstacle_bearing_deg),
        "wheels": rims and Wheels(*rims),
        "manual": manual and Manual(*manual),
        "goal_heading_deg": tick.goal_heading_deg,
        "north_m": tick.north_m,
        "east_m": tick.east_m,
        "path_m": tick.path_m,
        "mission_s": tick.mission_s,
        "mission_m": tick.mission_m,
        "wanted_left": decision.wheels.left,
        "wanted_right": decision.wheels.right,
        "applied_left": tick.applied.left,
        "applied_right": tick.applied.right,
        "level": tick.level.name.lower(),
        "cause": tick.cause.value if tick.cause is not None else None,
        "memory": dict(tick.memory()),
    }
    if seen is not None:
        fields |= {
            "decision_t_s": seen.t_s,
            "heading_deg": seen.heading_deg,
            "pitch_deg": seen.pitch_deg,
            "roll_deg": seen.roll_deg,
            "anomalies": tuple(anomaly.value for anomaly in seen.anomalies),
            "travelled_m": seen.travelled_m,
            "covered_m": seen.covered_m,
        }
    return fields
