"""Logs to export."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from tests.logview import records
from tests.logview.records import Json
from wayfarer.fieldlog.record import AnyRecord

Kind = TypeVar("Kind")
HEADER: Json = records.HEADER | {
    "rover": "forestrover",
    "config": {"vehicle": {"length_m": 0.5, "width_m": 0.4, "max_speed_m_s": 1.0}},
}


def stamped(kind: str, t_s: float, **fields: object) -> Json:
    """A record by the log's own clock, which began at 100 s."""
    return records.record(kind, t_s - 100.0, **fields)


def tick(t_s: float, **fields: object) -> Json:
    """A tick of a rover that drives east."""
    motion = {"t_s": t_s, "forward_m": 0.5, "right_m": 0.0, "quality": 1.0, "signed": True}
    usual = {"heading_deg": 90.0, "goal_heading_deg": 90.0, "pitch_deg": 0.0, "roll_deg": 0.0, "motion": motion}
    usual |= {"north_m": 0.0, "east_m": t_s - 100.0}
    return records.tick(t_s - 100.0, **{"counter_deg": None, "episodes": None, **usual, **fields})


def of_kind(found: Sequence[AnyRecord], kind: type[Kind]) -> list[Kind]:
    return [each for each in found if isinstance(each, kind)]
