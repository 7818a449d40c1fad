"""A mission's beginning and its normal end: start delay, goal heading, and limits. Pure.

Limits are on time, commanded distance, and radius around the start. The distance from the start is dead reckoning by
odometer and compass, so that spinning wheels do not count. If a receiver gives fixes, they count instead. Escape
decisions never use the fixes.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import hypot, inf, isfinite
from typing import Final

from wayfarer.angles import circular_mean, displacement_m, offset_m, wrap180
from wayfarer.hal import CompassReading, PositionFix
from wayfarer.safety.settings import SafetySettings

# The compass gets this many settling times to come to rest before arming is refused.
PATIENCE: Final = 10.0
FIX_FRESH_S: Final = 3.0  # an older fix does not count (fault catalogue, fault 56)
FIXES_BEYOND: Final = 5  # fixes in a row must be beyond the radius, so that a single jump does not end the mission
# Dead reckoning may be off by this share of the way. Chosen by us.
RECKONING_ERROR: Final = 0.1


class ArmingSequence:
    """Waits out the start delay, then takes the goal heading.

    A heading given by the user is used as it is. Otherwise the rover's own heading is taken at the END of the delay, as
    the mean over a settling time in which it stayed within a narrow spread. It is not taken earlier, because a person
    with keys and a phone is still near the compass when the delay begins.
    """

    def __init__(self, settings: SafetySettings, t_s: float, goal_heading_deg: float | None) -> None:
        self._settings = settings
        self._goal_heading_deg = goal_heading_deg
        self._delay_ends_s = t_s + settings.start_delay_s
        self._headings: deque[tuple[float, float]] = deque()

    def update(self, compass: CompassReading) -> float | None:
        """Return the goal heading once it is known, None while waiting."""
        t_s = compass.t_s
        if t_s < self._delay_ends_s:
            return None
        if self._goal_heading_deg is not None:
            return self._goal_heading_deg
        self._headings.append((t_s, compass.heading_deg))
        if t_s - self._headings[0][0] < self._settings.settle_s:
            return None
        mean_deg, _ = circular_mean(heading_deg for _, heading_deg in self._headings)
        if all(
            abs(wrap180(heading_deg - mean_deg)) <= self._settings.settle_spread_deg
            for _, heading_deg in self._headings
        ):
            return mean_deg
        self._headings.popleft()
        return None

    def too_late(self, t_s: float) -> bool:
        """Return whether arming must be refused, because the heading has not come to rest in time."""
        return t_s > self._delay_ends_s + PATIENCE * self._settings.settle_s


@dataclass(frozen=True, slots=True)
class RunEnd:
    """Why a run ended: a fixed reason such as ``requested`` or ``mission_time``, and a sentence for a person."""

    reason: str
    text: str


class Place:
    """Where dead reckoning has the rover, metres from where the run began; ``path_m`` adds up both ways.

    ``known`` is whether there has been a heading.
    """

    def __init__(self) -> None:
        self.north_m = self.east_m = self.path_m = 0.0
        self.known = False

    def move(self, ahead_m: float, right_m: float, heading_deg: float) -> None:
        """Add the displacement of the body since the last tick."""
        north_m, east_m = displacement_m(heading_deg, ahead_m, right_m)
        self.north_m += north_m
        self.east_m += east_m
        self.path_m += abs(ahead_m)
        self.known = True


class Mission:
    """One mission, from the moment at which the wheels may turn, at a place that goes on to move.

    ``north_m`` and ``east_m`` are those from the start.
    """

    def __init__(self, settings: SafetySettings, t_s: float, place: Place) -> None:
        self._settings = settings
        self.starts_s = t_s
        self._ends_s = t_s + settings.mission_time_s
        self._most_m = settings.mission_distance_m
        self._radius_m = settings.mission_radius_m
        self.travelled_m = 0.0
        self.north_m = self.east_m = 0.0
        self.place = place
        self._start_north_m, self._start_east_m = place.north_m, place.east_m
        self._home: PositionFix | None = None
        self._home_north_m = self._home_east_m = 0.0  # of that fix, from the start, by dead reckoning
        self._home_error_m = inf
        self._carried_m = 0.0  # a bound on how far a person may have carried the body, which no dead reckoning sees
        self._fix_t_s = -inf
        self._fixes_beyond = 0

    def advance(self, commanded_m: float) -> None:
        """Add the distance commanded since the last tick, negative backwards, and look where the body is now."""
        self.travelled_m += abs(commanded_m)
        self.north_m, self.east_m = self.place.north_m - self._start_north_m, self.place.east_m - self._start_east_m

    def wait(self, for_s: float) -> None:
        """Let the time limit wait, as long as a person drives; that person may also carry the rover."""
        self._ends_s += for_s
        self._carried_m = inf

    def position(self, fix: PositionFix) -> None:
        """Take a fix. Impossible fixes are ignored (fault catalogue, fault 8).

        The start is computed backwards from the best fix: a receiver that has just been switched on is off by tens of
        metres, and says so. The start is as exact as the fix and the dead reckoning since the start; the first counts
        until there is a better one. After a person has driven, none is better.

        A fix that is read several times, because the receiver is slower than the reading, counts once.
        """
        if not (abs(fix.latitude_deg) <= 90.0 and abs(fix.longitude_deg) <= 180.0 and isfinite(fix.t_s)):
            return
        if fix.t_s == self._fix_t_s:
            return
        error_m = fix.error_m if fix.error_m is not None and fix.error_m >= 0.0 else inf
        error_m += RECKONING_ERROR * self.travelled_m + self._carried_m
        home = self._home
        if home is None or error_m < self._home_error_m:
            home = self._home = fix
            self._home_north_m, self._home_east_m, self._home_error_m = self.north_m, self.east_m, error_m
        self._fix_t_s = fix.t_s
        north_m, east_m = offset_m(home, fix)
        away_m = hypot(self._home_north_m + north_m, self._home_east_m + east_m)
        self._fixes_beyond = self._fixes_beyond + 1 if away_m >= self._radius_m else 0

    def end(self, t_s: float) -> RunEnd | None:
        """Return the limit that is reached, or None."""
        settings = self._settings
        if t_s >= self._ends_s:
            return RunEnd("mission_time", f"the mission limit of {settings.mission_time_s:g} s was reached")
        if self.travelled_m >= self._most_m:
            return RunEnd("mission_distance", f"the mission limit of {settings.mission_distance_m:g} m was reached")
        away_m2 = self.north_m * self.north_m + self.east_m * self.east_m
        beyond = not away_m2 < self._radius_m * self._radius_m  # written so that NaN is beyond
        if 0.0 <= t_s - self._fix_t_s <= FIX_FRESH_S:  # a fix from the future does not count
            beyond = self._fixes_beyond >= FIXES_BEYOND
        if beyond:
            limit = f"the mission limit of {settings.mission_radius_m:g} m around the start was reached"
            return RunEnd("mission_radius", limit)
        return None
