"""Checks the order of a log's records: numbers and times must grow; records that break it are left out. Pure.

One line whose number or time was changed must not cost the lines after it, and a line alone does not show whether it
is too early or the one before it was too late. So where a record does not simply go on from the one before, the next
``WINDOW`` records are looked at together, and the longest row of them in which each can follow the one before is
believed. Damage of fewer than a quarter as many lines side by side costs those lines only.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from wayfarer.fieldlog.schema import Record

WINDOW = 256  # records that are looked at together, at most
RECORDS_A_SECOND = 3000  # more than any run writes: its ticks come at 1,000 Hz at most
SMOOTH_S = 1.0  # from a record to the next, where no record was lost and the loop was not blocked
# A position has the time of its reading: gpsd's may be 3 s old, and older where the loop was blocked meanwhile; the
# catalogue's longest stall is 60 s. A header or a ``log_gap`` has the time of the record after it, which may be one.
READ_EARLIER_S = 100.0
NOTED_EARLIER_S = 5.0  # all else is from after the beginning of the last tick, or has the time of a fresh position
AS_BEFORE = ("outcome", "truth")  # has the time of the record before it: truth that of its tick


class Seen(NamedTuple):
    """What was believed so far: the highest number, the latest time, and what the next times depend on.

    ``tick_t_s`` is when the last tick began, and before the first one the log. A tick is written when it has ended, so
    that the next one begins later than ``settled_s``, the latest time up to there. ``last_t_s`` is the time of the last
    record with a number. ``bare`` is the last record without one, as the header of each part is; such a line twice is
    one too many.
    """

    n: int = 0
    t_s: float = 0.0
    tick_t_s: float = -1.0
    settled_s: float = -1.0
    last_t_s: float = 0.0
    bare: Record | None = None


class Order:
    """Takes the records of one log, and gives those that are in order; ``dropped`` counts the others."""

    def __init__(self) -> None:
        self.dropped = 0
        self._seen = Seen()
        self._window: list[Record] = []  # what is not decided yet: only the last record, while all goes on smoothly
        self._ahead: Seen | None = None  # what will have been seen after that one; None while there are more

    def take(self, record: Record) -> list[Record]:
        """Take the next record, and return those that are decided."""
        following = None if self._ahead is None else _smoothly_after(record, self._ahead)
        if self._ahead is not None and following is not None:
            decided, self._window = self._window, [record]
            self._seen, self._ahead = self._ahead, following
            return decided
        self._window.append(record)
        self._ahead = None
        return [] if len(self._window) < WINDOW else [*self._decide(WINDOW // 2), *self._settle()]

    def rest(self) -> list[Record]:
        """Return what is left of the records that are not decided yet; more may come behind it."""
        self._ahead = None
        return self._decide(len(self._window))

    def all_of(self, records: Iterable[Record]) -> Iterator[Record]:
        """Take all of some records and give those that are in order, without waiting for more."""
        for record in records:
            yield from self.take(record)
        yield from self.rest()

    def forget_times(self) -> None:
        """Believe the time of the next record, independent of earlier records; numbers must grow on."""
        self._seen = Seen(n=self._seen.n, bare=self._seen.bare)

    def _decide(self, count: int) -> list[Record]:
        """Decide on the first records of the window."""
        believed = _longest_row(self._window, self._seen)
        kept = [index for index in range(count) if index in believed]
        decided = [self._window[index] for index in kept]
        self._seen = believed[kept[-1]] if kept else self._seen
        self.dropped += count - len(kept)
        del self._window[:count]
        return decided

    def _settle(self) -> list[Record]:
        """Return what is left in the window but the last record, if all of it goes on smoothly."""
        seen, before = self._seen, self._seen
        for record in self._window:
            following = _smoothly_after(record, seen)
            if following is None:
                return []
            before, seen = seen, following
        self._seen, self._ahead = before, seen
        *decided, last = self._window
        self._window = [last]
        return decided


def after(record: Record, seen: Seen) -> Seen | None:
    """Return what has been seen after a record; None where it cannot follow."""
    seen_n, latest_s, tick_t_s, settled_s, last_t_s, bare = seen
    n, t_s = record.get("n"), record["t_s"]
    if not _in_time(record, seen):
        return None
    if n is None:
        if record == bare:
            return None
        n, bare = seen_n, record
    elif n <= seen_n or (n - seen_n > RECORDS_A_SECOND and n - seen_n > RECORDS_A_SECOND * (t_s - latest_s)):
        return None
    else:
        last_t_s = t_s
    latest_s = t_s if t_s > latest_s else latest_s
    if record["record"] == "tick":
        tick_t_s, settled_s = t_s, latest_s
    elif tick_t_s < 0.0 and record["record"] == "run":
        tick_t_s = last_t_s = t_s
    return Seen(n, latest_s, tick_t_s, settled_s, last_t_s, bare)


def _in_time(record: Record, seen: Seen) -> bool:
    """Return whether a record's time can be, after what was seen; how late it may be is no question."""
    kind, t_s = record["record"], record["t_s"]
    if kind == "tick":
        return bool(t_s >= seen.settled_s)
    if kind in AS_BEFORE and record.get("n") == seen.n + 1:
        return bool(abs(t_s - seen.last_t_s) <= SMOOTH_S)
    earlier_s = READ_EARLIER_S if kind == "position" or record.get("n") is None else NOTED_EARLIER_S
    return bool(t_s >= seen.tick_t_s - earlier_s)


def _smoothly_after(record: Record, seen: Seen) -> Seen | None:
    """Return what has been seen after a record that follows with nothing missing in between; None for any other."""
    t_s = record["t_s"]
    if t_s > seen.t_s + SMOOTH_S or (record.get("n") or 0) > seen.n + 1:
        return None
    if t_s < seen.t_s and record["record"] != "position":  # ticks will tell which is wrong
        return None
    return after(record, seen)


class _Row(NamedTuple):
    """A row of records, told from its last one."""

    length: int
    seen: Seen
    place: int
    before: _Row | None


def _longest_row(window: list[Record], seen: Seen) -> dict[int, Seen]:
    """Return the longest row of records that can follow each other, by their places; of two the one that ends first."""
    rows = [_Row(0, seen, -1, None)]  # the longest first
    for index, record in enumerate(window):
        behind = False
        for row in tuple(rows):
            if (following := after(record, row.seen)) is not None and (not behind or record["t_s"] >= row.seen.t_s):
                _insert(rows, _Row(row.length + 1, following, index, row))
                behind = record["t_s"] < row.seen.t_s  # then what is before it may be too late: a row without that, too
                if not behind:
                    break
    believed, last = {}, rows[0]
    while last.before is not None:
        believed[last.place], last = last.seen, last.before
    return believed


def _insert(rows: list[_Row], row: _Row) -> None:
    """Put a row before those that are shorter, and those of its length that end later."""
    at = 0
    while at < len(rows) and (-rows[at].length, rows[at].seen.t_s, rows[at].seen.n) <= (
        -row.length, row.seen.t_s, row.seen.n,
    ):  # fmt: skip
        at += 1
    rows.insert(at, row)
