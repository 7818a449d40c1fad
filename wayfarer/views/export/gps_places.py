"""Where a run was on the globe: the fixes of its receiver, its path, and the places of what happened.

Dead reckoning has no latitude. So the path is fitted to all fixes, or begins where a person says that it began. What
happened has its place on that path. Where nothing could be reckoned, it is at the fix nearest in time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import nan
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import or_nan, safe_text
from wayfarer.fieldlog.folders import run_title
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.run_events import AnomalyBegan, Ended, Noted
from wayfarer.fieldlog.run_fold import HELD, RunFold
from wayfarer.fieldlog.typed import Fix, RunEvent, Tick
from wayfarer.fieldlog.vocabulary import in_words
from wayfarer.fieldlog.wording import event_text, outcome_text, run_text
from wayfarer.views.export.placed_path import (
    OnGlobe,
    Origin,
    PathPoint,
    ReckonedPath,
    from_origin,
    on_globe,
    onto_fixes,
)
from wayfarer.views.export.wall_time import read_clock_zero_s
from wayfarer.views.receiver_fit import MapFix

GAP_S = 10.0  # without a fix, and a track has a gap: ten readings at the usual ``rates.position_hz`` of 1
_time = attrgetter("t_s")


class PlacedEvent(NamedTuple):
    """Something that happened at a place: ``mark``, ``anomaly``, ``hold`` or ``fault`` (the wheels stood), ``end``."""

    kind: str
    text: str
    t_s: float
    elapsed_s: float


class Waypoint(NamedTuple):
    """The place of something that happened, degrees; ``placed`` says how it was found."""

    placed_event: PlacedEvent
    latitude_deg: float
    longitude_deg: float
    placed: str


class Places(NamedTuple):
    """A run on the globe: its fixes and its path in segments without a gap, what happened, and the log's damage.

    ``path`` is dead reckoning, and ``path_name`` says how it was laid there. ``title`` is the name of the run's folder,
    ``about`` says what ran, ``zero_s`` is the wall time at which ``t_s`` was zero.
    """

    title: str
    about: str
    zero_s: float
    segments: list[list[Fix]]
    path: list[list[PathPoint]]
    path_name: str
    waypoints: list[Waypoint]
    damage: Damage

    @property
    def began_t_s(self) -> float:
        """Return the time of the first fix, else that of the first point of the path."""
        return next((segment[0].t_s for tracks in (self.segments, self.path) for segment in tracks), 0.0)


def read_places(run: Path, form: str, origin: Origin | None) -> Places:
    """Read where a run was; ``origin`` is where one without fixes began.

    Raises:
        BadInput: the run cannot be read, has neither fixes nor an origin, or has both; the text names the format.
    """
    reader = RunReader(run)
    zero_s, fold = read_clock_zero_s(reader), RunFold()
    fixes: list[Fix] = []
    compared: list[MapFix] = []
    poses: list[ReckonedPose] = []
    path = ReckonedPath()
    placed_events: list[PlacedEvent] = []
    for record in RunReader(run):
        events = fold.take(record)
        placed_events += _happened(events)
        for event in events:
            match event:
                case Tick(place=place) if place is not None:
                    poses.append(place)
                    path.take(event.elapsed_s, place, fold.state.stretch)
                case Fix():
                    fixes.append(_on_globe(event))
                    compared.append(_compared(event, fold.state.place))
    _check_origin(run, form, origin, fixes, poses)
    fixes.sort(key=_time)
    onto = onto_fixes(compared) if origin is None else from_origin(origin)
    laid, how = (path.laid(onto), onto.how) if onto else ([], "")
    waypoints = [_placed(each, fixes, poses, onto) for each in placed_events]
    title, about = run_title(run), run_text(fold.state.header)
    return Places(title, about, zero_s, list(_segments(fixes)), laid, how, waypoints, reader.damage)


def _check_origin(
    run: Path, form: str, origin: Origin | None, fixes: Sequence[Fix], poses: Sequence[ReckonedPose]
) -> None:
    if origin is not None and fixes:
        raise BadInput(f"{run} has GPS positions, which say where it was: leave --origin out")
    if origin is None and not fixes:
        raise BadInput(
            f"{run} has no GPS position, so there is no {form}: dead reckoning has no latitude. Say where it began "
            f"with --origin LAT,LON, or use csv, parquet or mcap; for the next run give the rover a receiver "
            f"(parts.position in its file)"
        )
    if origin is not None and not poses:
        raise BadInput(f"{run} has no heading, so no path leads away from --origin: see wayfarer logs check")


def _compared(fix: Fix, place: ReckonedPose | None) -> MapFix:
    """Return a fix with where dead reckoning had the rover then."""
    here_m = (place.north_m, place.east_m) if place else (nan, nan)
    return MapFix(fix.elapsed_s, fix.latitude_deg, fix.longitude_deg, or_nan(fix.error_m), *here_m)


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
    if segment:
        yield segment


def _placed(
    placed_event: PlacedEvent, fixes: Sequence[Fix], poses: Sequence[ReckonedPose], onto: OnGlobe | None
) -> Waypoint:
    """Return where something happened: on the path, else at the nearest fix."""
    t_s = placed_event.t_s
    if onto is not None:
        return Waypoint(placed_event, *onto(poses[max(0, bisect_right(poses, t_s, key=_time) - 1)]), onto.how)
    fix = min(fixes, key=lambda each: abs(each.t_s - t_s))
    error = "" if fix.error_m is None else f" (error {fix.error_m:.1f} m)"
    placed = f"the fix at {duration_text(fix.elapsed_s, 2)}{error}"
    return Waypoint(placed_event, fix.latitude_deg, fix.longitude_deg, placed)


def _on_globe(fix: Fix) -> Fix:
    latitude_deg, longitude_deg = on_globe(fix.latitude_deg, fix.longitude_deg)
    return replace(fix, latitude_deg=latitude_deg, longitude_deg=longitude_deg)
