"""Records of a log, as the JSON objects that they are in it, as short as they can be, and logs made of them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from wayfarer.fieldlog.record import SCHEMA, AnyRecord, Tick, decode
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.logview.narrator import Line, RunNarrator, Verbosity

Json = dict[str, Any]  # a record as it is in a line
SAMPLE_LOGS = Path(__file__).resolve().parents[2] / "field_logs"
RUN = "00017-20261121T061405Z"  # a folder's name
BEGAN_WALL_S = 1_800_000_000.0
HEADER: Json = {
    "record": "run", "t_s": 100.0, "t_wall": BEGAN_WALL_S, "schema": SCHEMA, "part": 1, "version": "9.9",
    "rover": "minirover", "algorithm": "forest-pledge", "seed": 7, "simulated": False, "dry_run": False,
    "config": {"vehicle": {"max_speed_m_s": 1.0}, "safety": {"tick_late_s": 0.2}},
}  # fmt: skip


def line(record: Json) -> bytes:
    """Return the line of a record."""
    return msgspec.json.encode(record) + b"\n"


def read(record: Json) -> AnyRecord:
    """Return a record as a reader of the log has it."""
    return decode(line(record))


def record(kind: str, t_s: float, **fields: Any) -> Json:
    """Return a record so long after the beginning."""
    return {"record": kind, "t_s": 100.0 + t_s, "elapsed_s": t_s, "t_wall": BEGAN_WALL_S + t_s, **fields}


def event(name: str, t_s: float, text: str | None = None, severity: str = "info", **data: Any) -> Json:
    return record("event", t_s, name=name, text=text or name, severity=severity, data=data)


def noted(t_s: float, note: str) -> Json:
    return event("mark", t_s, f"Mark: {note}", note=note)


def tick(t_s: float, **fields: Any) -> Json:
    """Return a tick of a rover that drives north at half duty, unless ``fields`` say otherwise.

    What is not a key of a tick is remembered by its algorithm.
    """
    memory = {"counter_deg": 0.0, "episodes": 0}
    memory |= {key: fields.pop(key) for key in list(fields) if key not in Tick.__struct_fields__}
    usual: Json = {
        "mode": "armed", "heading_deg": 0.0, "goal_heading_deg": 0.0, "anomalies": [], "travelled_m": 0.5 * t_s,
        "north_m": 0.5 * t_s, "east_m": 0.0, "path_m": 0.5 * t_s, "mission_s": t_s, "mission_m": 0.5 * t_s,
        "phase": "follow", "why": "follow", "wanted_left": 0.5, "wanted_right": 0.5, "applied_left": 0.5,
        "applied_right": 0.5, "level": "well", "cause": None, "memory": memory,
    }  # fmt: skip
    return record("tick", t_s, **usual | fields)


def unarmed(begins_s: float, ends_s: float, **fields: Any) -> list[Json]:
    return drive(begins_s, ends_s, **{"mode": "disarmed", "mission_s": None, "mission_m": None} | fields)


def drive(begins_s: float, ends_s: float, **fields: Any) -> list[Json]:
    """Return ticks every 0.05 s, the end left out."""
    return [tick(begins_s + count * 0.05, **fields) for count in range(round((ends_s - begins_s) / 0.05))]


def numbered(records: Iterable[Json]) -> list[Json]:
    """Return records with the numbers that a log gives them; a header has none."""
    count = 0
    found = []
    for each in records:
        count += each["record"] != "run"
        found.append(each if each["record"] == "run" else {**each, "n": count})
    return found


def write(run: Path, records: Iterable[Json | bytes], name: str = "run.00001.jsonl") -> Path:
    """Write records to the end of a log, bytes as they are; return the run's folder."""
    run.mkdir(parents=True, exist_ok=True)
    with (run / name).open("ab") as file:
        file.writelines(each if isinstance(each, bytes) else line(each) for each in records)
    return run


def narrated(records: Iterable[Json | AnyRecord], verbosity: Verbosity = Verbosity.STATUS) -> list[Line]:
    """Return what is told of a run in lines."""
    fold, narrator = RunFold(), RunNarrator(verbosity)
    return [
        line for each in records for line in narrator.tell(fold.add(read(each) if isinstance(each, dict) else each))
    ]


def outcome(t_s: float, reason: str = "requested") -> Json:
    return record("outcome", t_s, reason=reason, text="enough", dropped=0)
