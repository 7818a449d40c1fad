"""The last known position of a rover: distance and bearing from its start, by dead reckoning and GPS. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite

from wayfarer.angles import bearing_deg, offset_m
from wayfarer.fieldlog.run_state import RunState
from wayfarer.fieldlog.typed import Fix


@dataclass(frozen=True, slots=True)
class RangeBearing:
    """Distance and bearing of a place from the start; degrees clockwise from north."""

    distance_m: float
    bearing_deg: float


@dataclass(frozen=True, slots=True)
class LastPosition:
    """Where the rover is at the end of its log; None: unknown.

    ``by_reckoning`` is relative to where the rover was first armed if ``from_start``, else to where the log begins. Its
    bearing is from magnetic north; its error grows with the distance and with each missing record. ``by_receiver`` is
    relative to the first fix, with its bearing from true north. ``fix_age_s`` is the time from the last fix to the end.
    """

    by_reckoning: RangeBearing | None = None
    by_receiver: RangeBearing | None = None
    last_fix: Fix | None = None
    fix_age_s: float | None = None
    from_start: bool = True


def last_position(state: RunState) -> LastPosition:
    """Return where the rover is now."""
    reckoned, fix = _by_reckoning(state), state.fix
    drove = reckoned is not None and reckoned.distance_m > 0.0
    return LastPosition(
        by_reckoning=reckoned,
        by_receiver=_by_receiver(state),
        last_fix=fix,
        fix_age_s=None if fix is None else max(0.0, state.t_s - fix.t_s),
        from_start=not drove if state.from_start is None else state.from_start,
    )


def _by_reckoning(state: RunState) -> RangeBearing | None:
    place, start = state.place, state.start
    if place is None:
        return None
    start_north_m, start_east_m = (start.north_m, start.east_m) if start else (0.0, 0.0)
    return _offset(place.north_m - start_north_m, place.east_m - start_east_m)


def _by_receiver(state: RunState) -> RangeBearing | None:
    first, last = state.first_fix, state.fix
    return None if first is None or last is None else _offset(*offset_m(first, last))


def _offset(north_m: float, east_m: float) -> RangeBearing | None:
    distance_m = hypot(north_m, east_m)
    return RangeBearing(distance_m, bearing_deg(north_m, east_m)) if isfinite(distance_m) else None
