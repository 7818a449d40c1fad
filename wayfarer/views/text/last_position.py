"""The last known position of a rover: distance and bearing from its start, by dead reckoning and GPS. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, degrees, hypot, isfinite

from wayfarer.angles import offset_m, wrap360
from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import number
from wayfarer.fieldlog.reader import Record


@dataclass(frozen=True, slots=True)
class RangeBearing:
    """Distance and bearing of a place from the start; degrees clockwise from north."""

    distance_m: float
    bearing_deg: float


@dataclass(frozen=True, slots=True)
class ReceiverFix:
    """A position from the receiver; ``error_m`` is None where it is unknown."""

    t_s: float
    latitude_deg: float
    longitude_deg: float
    error_m: float | None


@dataclass(frozen=True, slots=True)
class LastPosition:
    """Where the rover is at the end of its log; None: unknown.

    ``by_reckoning`` is relative to where the rover was first armed if ``from_start``, else to where the log begins. Its
    bearing is from magnetic north; its error grows with the distance and with each missing record. ``by_receiver`` is
    relative to the first fix, with its bearing from true north. ``fix_age_s`` is the time from the last fix to the end.
    """

    by_reckoning: RangeBearing | None = None
    by_receiver: RangeBearing | None = None
    last_fix: ReceiverFix | None = None
    fix_age_s: float | None = None
    from_start: bool = True


class PositionTracker:
    """Follows a run to where it ends."""

    def __init__(self) -> None:
        self._start: ReckonedPose | None = None
        self._place: ReckonedPose | None = None
        self._from_start: bool | None = None  # None: it was not armed yet
        self._first_fix: ReceiverFix | None = None
        self._last_fix: ReceiverFix | None = None

    def starts(self) -> None:
        """Note that the rover is armed; the place of the first time is the start."""
        if self._from_start is None:
            self._from_start, self._start = True, self._place

    def begins_late(self) -> None:
        """Note that the first part of the log is missing: the place of the next arming need not be the start."""
        if self._from_start is None:
            self._from_start = False

    def reckoned(self, place: ReckonedPose | None) -> None:
        """Take where dead reckoning has the rover."""
        self._place = place or self._place

    def fix(self, position: Record) -> None:
        """Take a ``position`` record."""
        latitude_deg, longitude_deg = number(position, "latitude_deg"), number(position, "longitude_deg")
        if latitude_deg is None or longitude_deg is None:
            return
        self._last_fix = ReceiverFix(position["t_s"], latitude_deg, longitude_deg, number(position, "error_m"))
        self._first_fix = self._first_fix or self._last_fix

    def where(self, t_s: float) -> LastPosition:
        """Return where the rover is at the end of the log, ``t_s``."""
        last = self._last_fix
        age_s = None if last is None else max(0.0, t_s - last.t_s)
        reckoned = self._by_reckoning()
        drove = reckoned is not None and reckoned.distance_m > 0.0
        from_start = not drove if self._from_start is None else self._from_start
        return LastPosition(reckoned, self._by_receiver(), last, age_s, from_start)

    def _by_reckoning(self) -> RangeBearing | None:
        if self._place is None:
            return None
        start_north_m, start_east_m = (self._start.north_m, self._start.east_m) if self._start else (0.0, 0.0)
        return _offset(self._place.north_m - start_north_m, self._place.east_m - start_east_m)

    def _by_receiver(self) -> RangeBearing | None:
        first, last = self._first_fix, self._last_fix
        return None if first is None or last is None else _offset(*offset_m(first, last))


def _offset(north_m: float, east_m: float) -> RangeBearing | None:
    distance_m = hypot(north_m, east_m)
    return RangeBearing(distance_m, wrap360(degrees(atan2(east_m, north_m)))) if isfinite(distance_m) else None
