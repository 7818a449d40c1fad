"""Logs to export."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

Record = dict[str, Any]

HEADER: Record = {
    "record": "run",
    "t_s": 100.0,
    "t_wall": 1000.0,
    "schema": 2,
    "part": 1,
    "version": "1",
    "algorithm": "forest-pledge",
    "rover": "forestrover",
    "config": {"vehicle": {"length_m": 0.5, "width_m": 0.4, "max_speed_m_s": 1.0}},
}


def stamped(kind: str, t_s: float, **fields: object) -> Record:
    return {"record": kind, "t_s": t_s, "t_wall": 900.0 + t_s, **fields}


def tick(t_s: float, **fields: object) -> Record:
    seen = {"heading_deg": 90.0, "pitch_deg": 0.0, "roll_deg": 0.0, "anomalies": [], "goal_heading_deg": 90.0}
    done = {"phase": "follow", "why": "follow", "level": "well", "cause": None, "travelled_m": 0.0}
    moved = {"motion": {"t_s": t_s, "forward_m": 0.5, "right_m": 0.0, "quality": 1.0, "signed": True}}
    return stamped("tick", t_s, **{**seen, **done, **moved, **fields})


def write(folder: Path, records: Iterable[Record | bytes]) -> Path:
    """A run's folder; what is bytes already gets into the file as it is."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = (record if isinstance(record, bytes) else json.dumps(record).encode() + b"\n" for record in records)
    (folder / "run.jsonl").write_bytes(b"".join(lines))
    return folder


def of_kind(records: Sequence[Record], kind: str) -> list[Record]:
    return [record for record in records if record["record"] == kind]
