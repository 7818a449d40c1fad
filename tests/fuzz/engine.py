"""Running a target's cases, in batches of which each begins where the ones before came to."""

# ruff: noqa: TID251 - fuzzing goes on for a time of the clock
from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field
from math import inf
from random import Random
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings

from tests.fuzz.covered import Covered
from tests.fuzz.target import Case, Target, Try

BATCH_S = 1.0  # so long that Hypothesis's start counts for little
FIRST_BATCH = 20
KEPT_CASES = 100
SHRINK_S = 20.0  # to make a failing case small


@dataclass
class Found:
    """What became of fuzzing a target; ``error`` is what the small case ``case`` raised."""

    target: str
    cases: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    error: Exception | None = None
    case: Case = None
    coverage: float = 0.0
    missing: dict[str, list[int]] = field(default_factory=dict)


def fuzz_cases(target: Target, cases: int, seed: int = 0) -> Found:
    """Try about so many cases of a target, up to the first that fails; the same ones each time."""
    found = Found(target.name)
    with target.opened() as attempt:
        _Run(target, attempt, found).batch(cases, seed, [])
    return found


def fuzz_for(target: Target, seconds: float, seed: int) -> Found:
    """Try cases of a target for a time, or until one fails."""
    found, chances = Found(target.name), Random(f"{target.name} {seed}")
    ends_s = time.monotonic() + seconds
    covered, size = Covered(target.covers), FIRST_BATCH
    kept: list[Case] = []
    with covered.watching(), target.opened() as attempt:
        run = _Run(target, attempt, found, covered, ends_s)
        while found.error is None and time.monotonic() < ends_s:
            began_s = time.monotonic()
            kept = [*kept, *run.batch(size, chances.getrandbits(64), kept)][-KEPT_CASES:]
            size = max(5, min(4 * size, round(size * BATCH_S / (time.monotonic() - began_s))))
    found.coverage, found.missing = covered.share, covered.missing
    return found


class _Run:
    """Tries batches of cases, and remembers what came of them."""

    def __init__(
        self, target: Target, attempt: Try, found: Found, covered: Covered | None = None, ends_s: float = inf
    ) -> None:
        self._target = target
        self._attempt = attempt
        self._found = found
        self._covered = covered
        self._ends_s = ends_s

    def batch(self, cases: int, batch_seed: int, kept: list[Case]) -> list[Case]:
        """Try a batch, and return the cases that reached something new; a failing one is made small."""
        new: list[Case] = []

        @seed(batch_seed)
        @settings(
            max_examples=cases,
            database=None,
            deadline=None,
            derandomize=False,
            phases=(Phase.generate, Phase.shrink),
            suppress_health_check=list(HealthCheck),
            report_multiple_bugs=False,
            print_blob=False,
        )
        @given(self._target.cases(kept))
        def attempt_one(case: Any) -> None:
            if self._reached_new(case):
                new.append(case)

        try:
            attempt_one()
        except Exception:
            if self._found.error is None:
                raise  # Hypothesis itself failed
        return new

    def _reached_new(self, case: Case) -> bool:
        found = self._found
        if time.monotonic() > self._ends_s:
            return False
        before = self._covered.count if self._covered else 0
        found.cases += 1
        try:
            found.outcomes[self._attempt(case)] += 1
        except Exception as error:
            if found.error is None:
                self._ends_s = time.monotonic() + SHRINK_S
            found.error, found.case = error, case  # the last that fails is the smallest
            raise
        return self._covered is not None and self._covered.count > before
