"""Where a run was on the globe: the fixes of its receiver, and the places of what happened between them.

Dead reckoning has no latitude. So the place of an event is the fix nearest in time, and the offset from there by dead
reckoning. That offset counts from magnetic north, as the compass does: with a declination of 5 degrees, 10 m of offset
lie 0.9 m aside.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from wayfarer.angles import bearing_deg, coordinates_deg, wrap180
from wayfarer.clamp import clamp
from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import safe_text
from wayfarer.fieldlog.folders import run_title
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.run_events import AnomalyBegan, Ended, Noted
from wayfarer.fieldlog.run_fold import HELD, RunFold
from wayfarer.fieldlog.typed import Fix, RunEvent, Tick
from wayfarer.fieldlog.vocabulary import in_words
from wayfarer.fieldlog.wording import event_text, outcome_text, run_text, whole_deg
from wayfarer.views.export.wall_time import read_clock_zero_s

GAP_S = 10.0  # without a fix, and a track has a gap: ten readings at the usual ``rates.position_hz`` of 1
NEAR_M = 0.05  # what is told as 0.0 m
DECIMALS = 8  # of a degree: a millimetre


class PlacedEvent(NamedTuple):
    """Something that happened at a place: ``mark``, ``anomaly``, ``hold`` or ``fault`` (the wheels stood), ``end``."""

    kind: str
    text: str
    t_s: float
    elapsed_s: float


class Waypoint(NamedTuple):
    """The place of something that happened, and from which fix it was reckoned, metres from there."""

    placed_event: PlacedEvent
    latitude_deg: float
    longitude_deg: float
    fix: Fix
    north_m: float
    east_m: float

    @property
    def placed(self) -> str:
        """Say how the place was found."""
        error = "" if self.fix.error_m is None else f" (error {self.fix.error_m:.1f} m)"
        fix = f"the fix at {duration_text(self.fix.elapsed_s, 2)}{error}"
        distance_m = hypot(self.north_m, self.east_m)
        if distance_m < NEAR_M:
            return f"at {fix}"
        bearing = whole_deg(bearing_deg(self.north_m, self.east_m))
        return f"{distance_m:.1f} m at {bearing} degrees (magnetic) from {fix}, by dead reckoning"


class Places(NamedTuple):
    """A run on the globe: its track in segments without a gap, what happened, and what of the log could not be read.

    ``title`` is the name of its folder, ``about`` says what ran, ``zero_s`` is the wall time at which ``t_s`` was zero.
    """

    title: str
    about: str
    zero_s: float
    segments: list[list[Fix]]
    waypoints: list[Waypoint]
    damage: Damage


def read_places(run: Path, form: str) -> Places:
    """Read where a run was.

    Raises:
        BadInput: the run cannot be read, or has no position; the text names the format that was wanted.
    """
    reader = RunReader(run)
    zero_s, fold = read_clock_zero_s(reader), RunFold()
    fixes: list[Fix] = []
    poses: list[ReckonedPose] = []
    placed_events: list[PlacedEvent] = []
    for record in RunReader(run):
        events = fold.take(record)
        placed_events += _happened(events)
        for event in events:
            match event:
                case Tick(place=place) if place is not None:
                    poses.append(place)
                case Fix():
                    fixes.append(_on_globe(event))
    if not fixes:
        raise BadInput(
            f"{run} has no GPS position, so there is no {form}: dead reckoning has no latitude. Use csv, parquet or "
            f"mcap; for the next run give the rover a receiver (parts.position in its file)"
        )
    fixes.sort(key=attrgetter("t_s"))
    waypoints = [_placed(each, fixes, poses) for each in placed_events]
    return Places(run_title(run), run_text(fold.state.header), zero_s, list(_segments(fixes)), waypoints, reader.damage)


def _happened(events: Sequence[RunEvent]) -> Iterator[PlacedEvent]:
    """Give what has a place of what a record tells; anomalies that begin at the same tick are one."""
    begun = [in_words(event.kind) for event in events if isinstance(event, AnomalyBegan)]
    if begun:
        yield PlacedEvent("anomaly", ", ".join(begun), events[0].t_s, events[0].elapsed_s)
    for event in events:
        match event:
            case Noted(name="mark", record=record):
                yield PlacedEvent("mark", event_text(record), event.t_s, event.elapsed_s)
            case Noted(name="health", record={"level": str(level), **told}) if level in HELD:
                cause = safe_text(told, "cause") or "unknown"
                yield PlacedEvent(level, f"{level}: {in_words(cause)}", event.t_s, event.elapsed_s)
            case Ended():
                yield PlacedEvent("end", outcome_text(event), event.t_s, event.elapsed_s)


def _segments(fixes: Sequence[Fix]) -> Iterator[list[Fix]]:
    """Cut a track where fixes are missing, and at the date line, as RFC 7946 asks (3.1.9)."""
    segment: list[Fix] = []
    for fix in fixes:
        late = fix.period_s is not None and fix.period_s > GAP_S
        if segment and (late or abs(fix.longitude_deg - segment[-1].longitude_deg) > 180.0):
            yield segment
            segment = []
        segment.append(fix)
    yield segment


def _placed(placed_event: PlacedEvent, fixes: Sequence[Fix], poses: Sequence[ReckonedPose]) -> Waypoint:
    """Return where something happened."""
    fix = min(_around(placed_event.t_s, fixes), key=lambda each: abs(each.t_s - placed_event.t_s))
    north_m, east_m = _reckoned_m(poses, fix.t_s, placed_event.t_s)
    latitude_deg, longitude_deg = coordinates_deg(fix, north_m, east_m)
    at = _on_globe(replace(fix, latitude_deg=latitude_deg, longitude_deg=longitude_deg))
    return Waypoint(placed_event, at.latitude_deg, at.longitude_deg, fix, north_m, east_m)


def _on_globe(fix: Fix) -> Fix:
    """Return it with a latitude in [-90, 90] and a longitude in [-180, 180), as written: 180 itself is -180 in GPX.

    Only dead reckoning that went astray leads beyond a pole.
    """
    longitude_deg = round(wrap180(fix.longitude_deg), DECIMALS)
    latitude_deg = round(clamp(fix.latitude_deg, -90.0, 90.0), DECIMALS)
    return replace(fix, latitude_deg=latitude_deg, longitude_deg=-180.0 if longitude_deg == 180.0 else longitude_deg)


def _around(t_s: float, fixes: Sequence[Fix]) -> Sequence[Fix]:
    """Return the fixes before and after a time; one of them where there is no other."""
    after = bisect_right(fixes, t_s, key=attrgetter("t_s"))
    return fixes[max(0, after - 1) : after + 1]


def _reckoned_m(poses: Sequence[ReckonedPose], from_t_s: float, to_t_s: float) -> tuple[float, float]:
    """Return metres north and east between two times by dead reckoning; none where it knows of no path."""
    if not poses:
        return 0.0, 0.0
    begins, ends = (poses[max(0, bisect_right(poses, t_s, key=attrgetter("t_s")) - 1)] for t_s in (from_t_s, to_t_s))
    return ends.north_m - begins.north_m, ends.east_m - begins.east_m
