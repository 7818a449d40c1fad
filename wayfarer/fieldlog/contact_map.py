"""What an algorithm remembers of the wood, as the event ``contact_map`` tells it. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Annotated

from wayfarer.angles import displacement_m
from wayfarer.fieldlog.fields import number
from wayfarer.fieldlog.schema import LIST, Metres, Record, Text, fields_of
from wayfarer.fieldlog.typed import RunEvent

SIDEWAYS_M = 0.1  # less is straight ahead: a quarter of the width of a rover
DOUBTED = 0.5  # a trunk that is believed less

MapRow = tuple[float, ...]
Rows = Annotated[tuple[MapRow, ...], LIST]
Point = tuple[float, float]


@dataclass(slots=True)
class ContactMapNoted(RunEvent):
    """What an algorithm remembers and plans, in metres ahead along, and right of, the goal heading.

    ``ahead_m`` and ``right_m`` are where it takes the rover to be. ``trunks`` are rows of two ends and the belief, 0 to
    1, that it blocks; ``way`` are the planned waypoints, and ``mode`` is ``plan`` or ``pledge``. The fold adds
    ``goal_heading_deg``, that of the tick before, None where it is not known.
    """

    record: Record
    ahead_m: Metres = None
    right_m: Metres = None
    trunks: Rows = ()
    way: Rows = ()
    mode: Text = None
    goal_heading_deg: float | None = None

    @classmethod
    def of(cls, elapsed_s: float, record: Record, goal_heading_deg: float | None = None) -> ContactMapNoted:
        """Return what the event says; a row that is not all there is left out."""
        rows = {"trunks": _rows(record, "trunks", 5), "way": _rows(record, "way", 2)}
        return cls(elapsed_s, record["t_s"], record, **fields_of(cls, record) | rows, goal_heading_deg=goal_heading_deg)

    @property
    def is_placed(self) -> bool:
        """Return whether it is known where from the rover everything is."""
        known = (self.ahead_m, self.right_m, self.goal_heading_deg)
        return all(value is not None and isfinite(value) for value in known)  # a third party's may be NaN

    def trunks_from(self, place_m: Point) -> list[MapRow]:
        """Return rows of two ends, metres east and north as the rover's place then, and the belief."""
        return [
            (*self._from(place_m, *trunk[:2]), *self._from(place_m, *trunk[2:4]), min(max(trunk[4], 0.0), 1.0))
            for trunk in self.trunks
        ]

    def way_from(self, place_m: Point) -> list[Point]:
        """Return the planned way from the rover to its last waypoint, metres east and north.

        It is empty without waypoints: straight ahead has no end, and the rover would soon leave the line behind.
        """
        if self.mode != "plan" or not self.way:
            return []
        here = (self.ahead_m or 0.0, self.right_m or 0.0)
        return [self._from(place_m, *waypoint[:2]) for waypoint in (here, *self.way)]

    def _from(self, place_m: Point, ahead_m: float, right_m: float) -> Point:
        north_m, east_m = displacement_m(
            self.goal_heading_deg or 0.0, ahead_m - (self.ahead_m or 0.0), right_m - (self.right_m or 0.0)
        )
        return place_m[0] + east_m, place_m[1] + north_m


def remembered_text(noted: ContactMapNoted) -> str:
    """Say what an algorithm remembers and plans, for ``wording``; pieces that go on from each other are one trunk."""
    ends = {trunk[2:4] for trunk in noted.trunks}
    first_pieces = [trunk for trunk in noted.trunks if trunk[:2] not in ends]
    count = len(first_pieces) or min(len(noted.trunks), 1)  # a ring has no first piece
    trunks = f"{count or 'no'} trunk{'' if count == 1 else 's'}"
    doubted = sum(trunk[4] < DOUBTED for trunk in first_pieces)
    doubt = f" ({doubted} doubted)" if doubted else ""
    return f"Remembers {trunks}{doubt}; {_plan_text(noted)}"


def _plan_text(noted: ContactMapNoted) -> str:
    if noted.mode != "plan":
        return "follows Pledge, not a plan" if noted.mode == "pledge" else "its plan is not known"
    aside_m = max((waypoint[1] - (noted.right_m or 0.0) for waypoint in noted.way), key=abs, default=0.0)
    if abs(aside_m) < SIDEWAYS_M:
        return "plans to drive straight towards the goal"
    return f"plans to pass {abs(aside_m):.1f} m to the {'right' if aside_m > 0.0 else 'left'}"


def _rows(record: Record, key: str, numbers: int) -> tuple[MapRow, ...]:
    rows = record.get(key)
    return tuple(_whole_rows(rows, numbers)) if isinstance(rows, list) else ()


def _whole_rows(rows: list[object], numbers: int) -> Iterator[MapRow]:
    for row in rows:
        if isinstance(row, list | tuple):
            values = [value for each in row[:numbers] if (value := number({"": each}, "")) is not None]
            if len(values) == numbers:
                yield tuple(values)
