"""Where a run was on the globe: the fixes of its receiver, and the places of what happened between them.

Dead reckoning has no latitude. So the place of an event is the fix nearest in time, and the offset from there by dead
reckoning. That offset counts from magnetic north, as the compass does: with a declination of 5 degrees, 10 m of offset
lie 0.9 m aside.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from math import atan2, degrees, hypot
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from wayfarer.angles import coordinates_deg, wrap180
from wayfarer.errors import BadInput
from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.elapsed import Elapsed
from wayfarer.fieldlog.fields import name, names, number, reckoning, sound_tick, span
from wayfarer.fieldlog.printable import clean
from wayfarer.fieldlog.reader import Damage, Record, RunReader
from wayfarer.safety.conditions import Level
from wayfarer.views.export.clock_zero import ClockZero
from wayfarer.views.text.verdict import readable
from wayfarer.views.text.wording import event_name, event_text, outcome_text, run_text, whole_deg
from wayfarer.views.vocabulary import ANOMALIES, CAUSES

GAP_S = 10.0  # without a fix, and a track has a gap: ten readings at the usual ``rates.position_hz`` of 1
NEAR_M = 0.05  # what is told as 0.0 m
DECIMALS = 8  # of a degree: a millimetre
HELD = {level.name.lower() for level in (Level.HOLD, Level.FAULT)}  # the levels at which no wheel may turn


class Fix(NamedTuple):
    """What the receiver said; longitude in [-180, 180). ``error_m`` is None where it did not tell."""

    t_s: float
    elapsed_s: float
    latitude_deg: float
    longitude_deg: float
    error_m: float | None


class Happening(NamedTuple):
    """Something that happened at a place: ``mark``, ``anomaly``, ``hold`` or ``fault`` (the wheels stood), ``end``."""

    kind: str
    text: str
    t_s: float
    elapsed_s: float


class Waypoint(NamedTuple):
    """The place of something that happened, and from which fix it was reckoned, metres from there."""

    happening: Happening
    latitude_deg: float
    longitude_deg: float
    fix: Fix
    north_m: float
    east_m: float

    @property
    def placed(self) -> str:
        """Say how the place was found."""
        error = "" if self.fix.error_m is None else f" (error {self.fix.error_m:.1f} m)"
        fix = f"the fix at {span(self.fix.elapsed_s, 2)}{error}"
        distance_m = hypot(self.north_m, self.east_m)
        if distance_m < NEAR_M:
            return f"at {fix}"
        bearing = whole_deg(degrees(atan2(self.east_m, self.north_m)))
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
    taken = _Taken()
    for record in readable(reader):
        taken.take(record)
    zero_s = taken.clock.zero_s
    if not taken.fixes or zero_s is None:
        raise BadInput(
            f"{run} has no GPS position, so there is no {form}: dead reckoning has no latitude. Take csv, parquet or "
            f"mcap; for the next run give the rover a receiver (parts.position in its file)"
        )
    fixes = sorted(taken.fixes, key=attrgetter("t_s"))
    waypoints = [_placed(each, fixes, taken.poses) for each in taken.happenings]
    return Places(clean(run.resolve().name), taken.about, zero_s, list(_segments(fixes)), waypoints, reader.damage)


class _Taken:
    """What the records of a run say of places."""

    def __init__(self) -> None:
        self.clock = ClockZero()
        self.about = ""
        self.fixes: list[Fix] = []
        self.poses: list[ReckonedPose] = []
        self.happenings: list[Happening] = []
        self._elapsed = Elapsed()
        self._track = reckoning({})
        self._anomalies: frozenset[str] = frozenset()

    def take(self, record: Record) -> None:
        """Take the next record."""
        self.clock.take(record)
        elapsed_s = self._elapsed.at(record)
        match record["record"]:
            case "run" if not self.about:
                self.about = run_text(record)
                self._track = self._track if self.poses else reckoning(record)  # a log may have lost its first header
            case "tick":
                self._take_tick(record)
            case "position":
                self._take_fix(record, elapsed_s)
        happened = self._happened(record)
        self.happenings += [Happening(kind, text, record["t_s"], elapsed_s) for kind, text in happened]

    def _take_tick(self, tick: Record) -> None:
        if place := self._track.take(sound_tick(tick)):
            self.poses.append(place)

    def _take_fix(self, position: Record, elapsed_s: float) -> None:
        latitude_deg, longitude_deg = number(position, "latitude_deg"), number(position, "longitude_deg")
        if latitude_deg is not None and longitude_deg is not None:
            place = _on_globe(latitude_deg, longitude_deg)
            self.fixes.append(Fix(position["t_s"], elapsed_s, *place, number(position, "error_m")))

    def _happened(self, record: Record) -> Iterator[tuple[str, str]]:
        """Give what a record tells that has a place: its kind and a text."""
        match record["record"]:
            case "tick":
                before, self._anomalies = self._anomalies, frozenset(names(record, "anomalies"))
                if begun := self._anomalies - before:
                    yield "anomaly", ", ".join(ANOMALIES.get(each, each) for each in sorted(begun))
            case "event" if event_name(record) == "mark":
                yield "mark", event_text(record)
            case "event" if event_name(record) == "health" and name(record, "level") in HELD:
                level, cause = name(record, "level") or "", name(record, "cause") or "unknown"
                yield level, f"{level}: {CAUSES.get(cause, cause)}"
            case "outcome":
                yield "end", outcome_text(record)


def _segments(fixes: Sequence[Fix]) -> Iterator[list[Fix]]:
    """Cut a track where fixes are missing, and at the date line, as RFC 7946 asks (3.1.9)."""
    segment: list[Fix] = []
    for fix in fixes:
        if segment and (
            fix.t_s - segment[-1].t_s > GAP_S or abs(fix.longitude_deg - segment[-1].longitude_deg) > 180.0
        ):
            yield segment
            segment = []
        segment.append(fix)
    yield segment


def _placed(happening: Happening, fixes: Sequence[Fix], poses: Sequence[ReckonedPose]) -> Waypoint:
    """Return where something happened."""
    fix = min(_around(happening.t_s, fixes), key=lambda each: abs(each.t_s - happening.t_s))
    north_m, east_m = _reckoned_m(poses, fix.t_s, happening.t_s)
    return Waypoint(happening, *_on_globe(*coordinates_deg(fix, north_m, east_m)), fix, north_m, east_m)


def _on_globe(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return a latitude in [-90, 90] and a longitude in [-180, 180), as written: 180 itself is -180 in GPX.

    Only dead reckoning that went astray leads beyond a pole.
    """
    longitude_deg = round(wrap180(longitude_deg), DECIMALS)
    return round(min(max(latitude_deg, -90.0), 90.0), DECIMALS), -180.0 if longitude_deg == 180.0 else longitude_deg


def _around(t_s: float, fixes: Sequence[Fix]) -> Sequence[Fix]:
    """Return the fixes before and after a time; one of them where there is no other."""
    after = bisect_right(fixes, t_s, key=attrgetter("t_s"))
    return fixes[max(0, after - 1) : after + 1]


def _reckoned_m(poses: Sequence[ReckonedPose], from_t_s: float, to_t_s: float) -> tuple[float, float]:
    """Return metres north and east between two times by dead reckoning; none where it knows of no way."""
    if not poses:
        return 0.0, 0.0
    begins, ends = (poses[max(0, bisect_right(poses, t_s, key=attrgetter("t_s")) - 1)] for t_s in (from_t_s, to_t_s))
    return ends.north_m - begins.north_m, ends.east_m - begins.east_m
