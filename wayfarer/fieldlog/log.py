"""Records of the field log: one JSON object with a checksum a line, for ``tail -F``, ``jq`` and ``wayfarer logs``.

The first record says what ran (version, algorithm, the rover's whole configuration), the last how it ended; between
them there is a record for each control tick and each event. Keys carry their units; ``t_s`` is the loop's clock and
``t_wall`` the wall time, which may step. ``docs/reference/log.md`` has the schema.

Logging can never raise into control: what cannot be written is dropped and counted, and the rover drives on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from wayfarer import __version__
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Observation
from wayfarer.fieldlog.clock import WallClock, wall_clock
from wayfarer.fieldlog.lines import sealed
from wayfarer.fieldlog.schema import SCHEMA, Record
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import MotorHealth, PositionFix, WheelCommand

STEP_S = 1.0  # more than a clock is slewed between two records; finding the right time steps it by hours


class FieldLog:
    """Makes records of what a run reports and passes each on as a line; implements ``control.run_log.RunLog``.

    Args:
        sink: where the lines go.
        details: what else the first record says: algorithm, configuration, seed.
        wall: the computer's wall clock, given the loop's time.
        t_s: the loop's time at which the run begins.
        viewers: each is shown every record as it is written, and must neither wait nor change it; one that raises is
            not asked again.

    Raises:
        BadInput: the sink cannot be opened.
    """

    def __init__(
        self,
        sink: Sink,
        details: Mapping[str, Any],
        wall: WallClock = wall_clock,
        t_s: float = 0.0,
        viewers: Sequence[Callable[[Record], object]] = (),
    ) -> None:
        self._sink = sink
        self._wall = wall
        self._zero_s = wall(t_s) - t_s  # the wall time at which the loop's was 0
        self._viewers = list(viewers)
        self._details = details
        self._t_s = t_s
        self._number = 0
        self._unmade = 0
        sink.open(lambda part: sealed(self._header(part)))
        self._show(self._header(1))

    @property
    def dropped(self) -> int:
        """How many records did not get into the log."""
        return self._unmade + self._sink.dropped

    def tick(self, record: TickRecord) -> None:
        """Write a control tick: what was seen, wanted, and applied."""
        self._note_clock_step(record.t_s)
        self._write("tick", record.t_s, record)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Write something that happened."""
        self._write("event", t_s, {"name": name, **details}, urgent=True)

    def position(self, fix: PositionFix | None) -> None:
        """Write a position."""
        if fix is not None:
            self._write("position", fix.t_s, fix._asdict(), urgent=True)

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Write what the motor board reports."""
        left, right = duties or (None, None)
        self._write("board", t_s, {**health._asdict(), "says_left": left, "says_right": right})

    def note(self, kind: str, t_s: float, fields: Mapping[str, Any]) -> None:
        """Write a record of another kind: ``computer``, or a simulation's ``truth``."""
        self._write(kind, t_s, fields)

    def close(self, reason: str, text: str) -> None:
        """Write the outcome and close the log."""
        outcome = {"reason": reason, "text": text, "dropped": self.dropped}
        self._write("outcome", self._t_s, outcome, urgent=True)
        self._sink.close()

    def _write(self, kind: str, t_s: float, fields: Mapping[str, Any] | TickRecord, *, urgent: bool = False) -> None:
        self._t_s = t_s
        self._number += 1
        try:
            self._sink.put(self._line(kind, fields), urgent)
        except Exception:  # a third party's memory() or decision, or a detail that is no JSON; no log is worth a run
            self._unmade += 1  # its number is missing, which a reader sees
        else:
            self._show(self._newest)

    def _line(self, kind: str, fields: Mapping[str, Any] | TickRecord) -> bytes:
        """Return the line of what happened."""
        t_s = self._t_s
        # Kind and times come first, for the person who tails the file; times are whole, for replay.
        stamp = {"record": kind, "n": self._number, "t_s": t_s, "t_wall": round(self._wall(t_s), 3)}
        if isinstance(fields, TickRecord):
            fields = tick_fields(fields)
        self._newest = {**stamp, **fields, **stamp}
        return sealed(self._newest)

    def _note_clock_step(self, t_s: float) -> None:
        """Write down that the computer's clock was set, before the first record with the new time."""
        zero_s = self._wall(t_s) - t_s
        step_s, self._zero_s = zero_s - self._zero_s, zero_s
        if abs(step_s) > STEP_S:
            self.event("clock_step", t_s, by_s=round(step_s, 3))

    def _header(self, part: int) -> Record:
        """Return the first record of a part of the log."""
        t_s = self._t_s
        about = {"schema": SCHEMA, "part": part, "version": __version__, **self._details}
        return {"record": "run", "t_s": t_s, "t_wall": round(self._wall(t_s), 3), **about}

    def _show(self, record: Record) -> None:
        """Show a record; a failing viewer must not end the log."""
        failed: list[Exception] = []
        for viewer in list(self._viewers):
            try:
                viewer(record)
            except Exception as error:
                self._viewers.remove(viewer)
                failed.append(error)
        for failure in failed:  # further records, which the other viewers are shown after this one
            self.event("viewer_failed", self._t_s, error=repr(failure))


def tick_fields(record: TickRecord) -> dict[str, Any]:
    """Return what the log keeps of a control tick; ``typed.Tick`` describes its keys.

    The readings are as the sensors gave them, because a replay starts from them. If an algorithm remembers one of
    these keys, the log's counts.
    """
    compass, motion, contact = record.compass, record.motion, record.contact
    wanted, applied, decision = record.decision.wheels, record.applied, record.decision
    fields = {
        "compass": compass and compass._asdict(),
        "motion": motion and motion._asdict(),
        "contact": contact and {**contact._asdict(), "sides": [side.value for side in contact.sides]},
        **_seen(record.observation),
        "phase": decision.phase.value,
        "why": decision.why,
        "wanted_left": wanted.left,
        "wanted_right": wanted.right,
        "applied_left": applied.left,
        "applied_right": applied.right,
        "level": record.level.name.lower(),
        "cause": record.cause.value if record.cause is not None else None,
    }
    if record.manual is not None:
        fields |= {f"manual_{key}": value for key, value in record.manual._asdict().items()}
    for key, value in record.memory().items():
        fields.setdefault(key, value)
    return fields


def _seen(observation: Observation | None) -> dict[str, Any]:
    """Return what the handler saw of the readings."""
    if observation is None:
        return {"heading_deg": None}
    return {
        "decision_t_s": observation.t_s,
        "heading_deg": observation.heading_deg,
        "pitch_deg": observation.pitch_deg,
        "roll_deg": observation.roll_deg,
        "anomalies": [anomaly.value for anomaly in observation.anomalies],
        "goal_heading_deg": observation.goal_heading_deg,
        "travelled_m": observation.travelled_m,
        "covered_m": observation.covered_m,
    }
