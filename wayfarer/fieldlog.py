"""The field log of a run: ``run.jsonl``, one JSON object a line, readable with ``tail -f`` and with ``jq``.

The first record says what ran (version, algorithm, the rover's whole configuration), the last how it ended; between
them there is a record for each control tick and each event. Keys carry their units; ``t_s`` is the loop's clock and
``t_wall`` the wall clock, which may step. ``field_logs/README.md`` has the schema.

Logging can never raise into control: what cannot be written is dropped and counted, and the rover drives on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import orjson
import structlog
from structlog.typing import EventDict, WrappedLogger

from wayfarer import __version__
from wayfarer.errors import BadInput
from wayfarer.escape.api import Observation
from wayfarer.hal import PositionFix
from wayfarer.latest import Snapshot
from wayfarer.records import TickRecord

FILE_NAME = "run.jsonl"
SCHEMA = 1

WallClock = Callable[[float], float]


def wall_clock(_t_s: float) -> float:
    """Return the wall clock in seconds since 1970: the only place in the field code that reads one."""
    return time.time()


def new_run_folder(logs: Path) -> Path:
    """Return the name of the next run's folder: a counter, which no clock can turn back, and the time in UTC.

    Raises:
        BadInput: the logs' folder cannot be read.
    """
    try:
        taken = [path.name for path in logs.iterdir()] if logs.exists() else []
    except OSError as error:
        raise BadInput(f"{logs}: the logs' folder cannot be read: {error.strerror}") from None
    last = max((int(number) for name in taken if (number := name.partition("-")[0]).isdecimal()), default=0)
    return logs / f"{last + 1:05d}-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}"


class FieldLog:
    """Writes one run into a folder; implements ``records.RunLog``.

    Args:
        folder: where ``run.jsonl`` is made; created if need be.
        details: what else the first record says: algorithm, configuration, seed.
        wall: the wall clock, given the loop's time; a simulated run passes one that makes its log reproducible.

    Raises:
        BadInput: the file cannot be made.
    """

    def __init__(self, folder: Path, details: Mapping[str, Any], wall: WallClock = wall_clock) -> None:
        self._wall = wall
        self._t_s = 0.0
        self.dropped = 0
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = (folder / FILE_NAME).open("xb")
        except OSError as error:
            raise BadInput(f"{folder}: the field log cannot be written: {error.strerror}") from None
        self._logger: Any = structlog.wrap_logger(
            structlog.BytesLogger(self._file),
            processors=[self._stamp, structlog.processors.JSONRenderer(serializer=orjson.dumps)],
            wrapper_class=structlog.BoundLoggerBase,
        )
        self._write("run", 0.0, {"schema": SCHEMA, "version": __version__, **details})

    def tick(self, record: TickRecord) -> None:
        """Write a control tick: what was seen, wanted, and applied."""
        try:
            fields = _tick(record)
        except Exception:  # a third party's memory() or decision; no log is worth a run
            self.dropped += 1
        else:
            self._write("tick", record.t_s, fields)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Write something that happened."""
        self._write("event", t_s, {"name": name, **details})

    def position(self, fix: PositionFix | None) -> None:
        """Write a position."""
        if fix is not None:
            self._write("position", fix.t_s, fix._asdict())

    def close(self, reason: str, text: str) -> None:
        """Write the outcome and close the file."""
        self._write("outcome", self._t_s, {"reason": reason, "text": text, "dropped": self.dropped})
        try:
            self._file.close()
        except OSError:
            self.dropped += 1

    def _write(self, kind: str, t_s: float, fields: Mapping[str, Any]) -> None:
        self._t_s = t_s
        try:
            self._logger._proxy_to_logger("msg", kind, t_s=t_s, fields=fields)
        except (OSError, ValueError, TypeError):  # disk, closed file, a detail that is no JSON
            self.dropped += 1

    def _stamp(self, _logger: WrappedLogger, _method: str, event: EventDict) -> EventDict:
        """Put kind and times first, for the person who tails the file."""
        t_s = event["t_s"]
        return {"record": event["event"], "t_s": round(t_s, 6), "t_wall": round(self._wall(t_s), 3), **event["fields"]}


def _tick(record: TickRecord) -> dict[str, Any]:
    wanted, applied, decision = record.decision.wheels, record.applied, record.decision
    return {
        **_read(record.snapshot),
        **_seen(record.observation),
        "phase": decision.phase.value,
        "why": decision.why,
        "wanted_left": wanted.left,
        "wanted_right": wanted.right,
        "applied_left": applied.left,
        "applied_right": applied.right,
        "level": record.level.name.lower(),
        "cause": record.cause.value if record.cause is not None else None,
        **record.memory(),
    }


def _read(snapshot: Snapshot) -> dict[str, Any]:
    """Return what the sensors said, exactly: a replay starts from this."""
    compass, motion, contact = snapshot.compass, snapshot.motion, snapshot.contact
    return {
        "compass": compass and compass._asdict(),
        "motion": motion and motion._asdict(),
        "contact": contact and {**contact._asdict(), "sides": [side.value for side in contact.sides]},
    }


def _seen(observation: Observation | None) -> dict[str, Any]:
    """Return what the handler saw of it."""
    if observation is None:
        return {"heading_deg": None}
    return {
        "decision_t_s": round(observation.t_s, 6),
        "heading_deg": observation.heading_deg,
        "pitch_deg": observation.pitch_deg,
        "roll_deg": observation.roll_deg,
        "anomalies": [anomaly.value for anomaly in observation.anomalies],
        "goal_heading_deg": observation.goal_heading_deg,
        "travelled_m": observation.travelled_m,
    }
