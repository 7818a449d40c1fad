"""The search space of ``wayfarer tune``: which numbers of the rover file are varied, and between which bounds.

A range is ``KEY=LOW:HIGH``, or ``KEY=LOW:HIGH:log`` for a number whose ratio counts and not its difference. The key is
any number of the rover file by its dotted name. Without ranges it is ``DEFAULT_SPACE`` around the present values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from wayfarer.config.messages import shortened
from wayfarer.config.rover_file import flat
from wayfarer.errors import BadConfig, BadInput, UnknownName
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.sweep import laid_over_campaign

# Multiples of the present value, so that they fit any rover: what ``docs/explanation/better-escape.md`` and the sweeps
# of ``docs/explanation/sensitivity.md`` found to matter, with room on both sides of what was tried there.
DEFAULT_SPACE: Mapping[str, tuple[float, float]] = {
    "escape.turn_angle_deg": (0.5, 3.0),
    "escape.back_off_m": (0.4, 3.0),
    "escape.probe_straight_m": (0.25, 2.0),
    "escape.probe_radius_m": (0.4, 2.0),
    "escape.reset_within_deg": (0.4, 4.0),
    "detector.immobilised_s": (0.5, 2.0),
    "detector.immobilised_below": (0.4, 2.0),
}
SHAPE = "write KEY=LOW:HIGH or KEY=LOW:HIGH:log, such as escape.turn_angle_deg=10:90"
DIGITS = 4  # of a value that is tried: the motors and the ground know no more


class SearchRange(NamedTuple):
    """A key of the rover file, its bounds in the key's unit, and its present value, which may lie outside them."""

    key: str
    low: float
    high: float
    log: bool
    whole: bool
    now: float

    def rounded(self, value: float) -> float | int:
        """Return a value as it is tried and written: within the bounds, with four digits, or whole."""
        if self.whole:
            return round(value)
        return min(max(float(f"{value:.{DIGITS}g}"), self.low), self.high)


def search_space(base: Campaign, asked: Sequence[str]) -> tuple[SearchRange, ...]:
    """Return the ranges that texts ask for, or those of ``DEFAULT_SPACE``; each of their ends is a value for the rover.

    Raises:
        UnknownName: no such key; the text offers the nearest ones.
        BadConfig: a bound is out of the key's range.
        BadInput: a text is no range, its bounds are reversed, the key is no number, or two ranges are of one key.
    """
    now = numbers(base)
    space = tuple(_range(text, now) for text in asked) if asked else tuple(_default(now))
    keys = [each.key for each in space]
    if twice := [key for key in dict.fromkeys(keys) if keys.count(key) > 1]:
        raise BadInput(f"key '{twice[0]}' has two ranges; give one")
    for each in space:
        for end in (each.low, each.high):
            _check_end(base, each, end)
    return space


def numbers(base: Campaign) -> dict[str, float | int]:
    """Return the numbers of a campaign's rover by their dotted keys."""
    found: dict[str, Any] = flat(base.rover.model_dump(mode="json"))
    return {
        key: value for key, value in found.items() if isinstance(value, int | float) and not isinstance(value, bool)
    }


def _default(now: Mapping[str, float]) -> list[SearchRange]:
    return [_around(key, now[key], *factors) for key, factors in DEFAULT_SPACE.items()]


def _around(key: str, now: float, least: float, most: float) -> SearchRange:
    low, high = (float(f"{now * factor:.{DIGITS}g}") for factor in (least, most))
    return SearchRange(key, low, high, log=True, whole=False, now=now)


def _range(text: str, now: Mapping[str, float]) -> SearchRange:
    key, equals, bounds = (part.strip() for part in text.partition("="))
    low, high, *scale = bounds.split(":") if equals and ":" in bounds else ("", "")
    if not key or scale not in ([], ["log"]):
        raise BadInput(f"--search '{shortened(text)}': {SHAPE}")
    if key not in now:
        raise UnknownName("number of the rover file", key, now)
    whole = isinstance(now[key], int)
    try:
        least, most = (int(end) if whole else float(end) for end in (low, high))
    except ValueError:
        kind = "two whole numbers" if whole else "two numbers"
        raise BadInput(f"--search '{shortened(text)}': expected {kind}; {SHAPE}") from None
    if not (math.isfinite(least) and math.isfinite(most) and least < most):
        raise BadInput(f"--search '{shortened(text)}': LOW must be below HIGH, and both finite")
    if scale and least <= 0:
        raise BadInput(f"--search '{shortened(text)}': a range with log must begin above 0")
    return SearchRange(key, least, most, bool(scale), whole, now[key])


def _check_end(base: Campaign, asked: SearchRange, end: float) -> None:
    """Refuse a bound that its key can never have; two keys that do not go together there are no mistake.

    Raises:
        BadConfig: as ``laid_over_campaign``.
    """
    try:
        laid_over_campaign(base, {asked.key: end})
    except BadConfig as error:
        if str(error).startswith(f"key '{asked.key}' ="):
            raise BadConfig(f"--search {asked.key}: {error}") from None
