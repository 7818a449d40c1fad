"""Score of the detector against ground truth: precision, recall and delay.

An *episode* is a time without a gap in which an anomaly is really there; a *claim* one in which the detector says so.
One that ended before the detector could say anything, and was not claimed, counts as none: a rover that turns away by
itself misses nothing. A claim is right if it begins in an episode, or so shortly after it that the detector could not
know yet.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.detector.ground import TILTS
from wayfarer.escape.api import Anomaly
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.testing.safety_rules import after_each_step

SPEED_OVER_S = 0.1  # a body that rubs at a trunk jerks: its speed is a mean
AFTERWARDS_S = 0.15  # three control periods: a sensor's reading, the tick, and the window that empties


class TimeSpan(NamedTuple):
    """From when to when, in seconds."""

    begins_s: float
    ends_s: float


class Score(NamedTuple):
    """How claims of one anomaly fared: episodes and how many were found, claims and how many were right.

    ``delays_s`` are those from the beginning of an episode to its first claim.
    """

    episodes: int
    found: int
    claims: int
    right: int
    delays_s: tuple[float, ...]

    def __add__(self, other: Any) -> Score:
        """Return the score of two runs together."""
        return Score(*(mine + its for mine, its in zip(self, other, strict=True)))


NOTHING = Score(0, 0, 0, 0, ())


class Timeline:
    """Collects the spans of each of several keys from samples that say which keys hold at a time."""

    def __init__(self) -> None:
        self.spans: dict[Any, list[TimeSpan]] = {}
        self._since_s: dict[Any, float] = {}
        self._last_s = 0.0

    def sample(self, t_s: float, keys: Sequence[Any]) -> None:
        """Take what holds now."""
        for key in [key for key in self._since_s if key not in keys]:
            self.spans.setdefault(key, []).append(TimeSpan(self._since_s.pop(key), self._last_s))
        for key in keys:
            self._since_s.setdefault(key, t_s)
        self._last_s = t_s

    def end(self) -> None:
        """End what lasts."""
        self.sample(self._last_s, ())


class DetectorScorer(RunLog):
    """Watches a run from both sides: the world at each of its steps, the detector at each control tick.

    In physics-light what slips or touches is held. A body with wheels (``on_wheels``) that slips is not, and one that
    touches may slide along: it is held while it continues with less than ``immobilised_below`` of what is commanded.
    """

    def __init__(self, config: RoverConfig, *, on_wheels: bool = False) -> None:
        self._config = config
        self._on_wheels = on_wheels
        self._seen_s = self._seen_m = self._speed_m_s = 0.0
        self._really = Timeline()
        self._claimed = Timeline()

    def follow(self, world: SimulatedWorld) -> None:
        """Watch a world."""
        after_each_step(world, lambda: self._really.sample(world.t_s, self._there(world)))

    def tick(self, record: TickRecord) -> None:
        """Take what the detector claims."""
        self._claimed.sample(record.t_s, record.observation.anomalies if record.observation else ())

    def scores(self) -> dict[Anomaly, Score]:
        """Return the score of each anomaly."""
        self._really.end()
        self._claimed.end()
        return {anomaly: self._score(anomaly) for anomaly in Anomaly}

    def _there(self, world: SimulatedWorld) -> list[Any]:
        """Return what is really wrong; being held has a direction, because turning round begins another episode."""
        config, (left, right) = self._config, world.commanded
        there: list[Any] = []
        driven_m_s = (left + right) / 2 * config.vehicle.max_speed_m_s
        if self._held(world, driven_m_s) and abs(driven_m_s) >= config.detector.immobilised_from_m_s:
            there.append((Anomaly.IMMOBILISED, driven_m_s > 0.0))
        pitch_deg, roll_deg = world.pitch_deg + world.ground_pitch_deg, world.roll_deg + world.ground_roll_deg
        tilts = zip(TILTS, (pitch_deg, -pitch_deg, roll_deg, -roll_deg), strict=True)
        there += [(tilt, True) for tilt, angle_deg in tilts if angle_deg >= config.detector.tilt_deg]
        if world.touch is not None:
            there.append((Anomaly.TOUCHED, True))
        return there

    def _held(self, world: SimulatedWorld, driven_m_s: float) -> bool:
        """Return whether something holds the body."""
        if not self._on_wheels:
            return world.slipping or world.touch is not None or world.body_faults.snagged
        if world.t_s - self._seen_s >= SPEED_OVER_S:
            moved_m = world.forward_m - world.reverse_m
            self._speed_m_s = (moved_m - self._seen_m) / (world.t_s - self._seen_s)
            self._seen_s, self._seen_m = world.t_s, moved_m
        something = world.touch is not None or world.high_centred or world.body_faults.snagged
        along_m_s = self._speed_m_s if driven_m_s > 0.0 else -self._speed_m_s
        return something and along_m_s < self._config.detector.immobilised_below * abs(driven_m_s)

    def _score(self, anomaly: Anomaly) -> Score:
        waits_s = _waits_s(self._config, anomaly)
        spans = [span for key, spans in self._really.spans.items() if key[0] is anomaly for span in spans]
        return score(sorted(spans), self._claimed.spans.get(anomaly, []), waits_s)


def _waits_s(config: RoverConfig, anomaly: Anomaly) -> float:
    """Return for how long the detector must look before it may claim an anomaly: its own setting, and two readings."""
    detector, rates = config.detector, config.rates
    if anomaly is Anomaly.IMMOBILISED:
        return detector.immobilised_s + 2 / rates.motion_hz
    if anomaly is Anomaly.TOUCHED:
        return detector.touch_s + 2 / rates.contact_hz
    return detector.tilt_s + 2 / rates.compass_hz


def score(really: Sequence[TimeSpan], claimed: Sequence[TimeSpan], waits_s: float) -> Score:
    """Return how claims fared against episodes; both in the order of time."""
    delays_s = [_delay_s(span, claimed) for span in really]
    found_s = [delay_s for delay_s in delays_s if delay_s is not None]
    missed = sum(
        delay_s is None and span.ends_s - span.begins_s >= waits_s
        for span, delay_s in zip(really, delays_s, strict=True)
    )
    right = sum(any(_covers(span, claim) for span in really) for claim in claimed)
    return Score(len(found_s) + missed, len(found_s), len(claimed), right, tuple(found_s))


def _covers(span: TimeSpan, claim: TimeSpan) -> bool:
    return span.begins_s <= claim.begins_s <= span.ends_s + AFTERWARDS_S


def _delay_s(span: TimeSpan, claimed: Sequence[TimeSpan]) -> float | None:
    """Return how long after its beginning an episode was claimed; at once if the claim was there before."""
    for claim in claimed:
        if claim.begins_s <= span.ends_s + AFTERWARDS_S and claim.ends_s >= span.begins_s:
            return max(0.0, claim.begins_s - span.begins_s)
    return None
