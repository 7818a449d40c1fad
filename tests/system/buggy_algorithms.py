"""Algorithms with bugs, as a third party may write them; each drives well at first.

``wayfarer run --algorithm tests.system.buggy_algorithms:RAISES``
"""

# ruff: noqa: TID251 - a bug blocks in real time
from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from wayfarer.escape.api import Decision, Observation, Phase
from wayfarer.escape.catalogue import Algorithm
from wayfarer.hal import WheelCommand

WELL_FOR = 20  # decisions: a second of driving
BLOCKS_S = 1.0
BUG = "the bug of a third party"
PIECE_BYTES = 50_000_000


class BuggyHandler:
    """An ``EscapeHandler`` that drives straight ahead until its bug comes.

    Args:
        bug: is called at each decision from then on.
    """

    def __init__(self, bug: Callable[[], None]) -> None:
        self._bug = bug
        self._decisions = 0

    def decide(self, observation: Observation) -> Decision:
        """Drive, and after a second do what it should not."""
        self._decisions += 1
        if self._decisions > WELL_FOR:
            self._bug()
        return Decision(WheelCommand(0.3, 0.3), Phase.FOLLOW, "follow")

    def reset(self) -> None:
        """Forget nothing."""

    def memory(self) -> Mapping[str, float | str]:
        """Return what every algorithm tells."""
        return {"counter_deg": 0.0, "episodes": 0.0}


def raise_error() -> None:
    """Raise what nobody expects."""
    raise ZeroDivisionError(BUG)


class Block:
    """Hold up the event loop, once."""

    def __init__(self) -> None:
        self._done = False

    def __call__(self) -> None:
        """Wait where nothing may wait."""
        if not self._done:
            self._done = True
            time.sleep(BLOCKS_S)


class MemoryLeak:
    """Take memory at each decision, and never let go of it."""

    def __init__(self) -> None:
        self._kept: list[bytes] = []

    def __call__(self) -> None:
        """Take more."""
        self._kept.append(bytes(PIECE_BYTES))


def _algorithm(name: str, summary: str, bug: Callable[[], Callable[[], None]]) -> Algorithm:
    return Algorithm(name, "test", summary, lambda settings, vehicle, rng: BuggyHandler(bug()))


RAISES = _algorithm("raises", "raises while it drives", lambda: raise_error)
BLOCKS = _algorithm("blocks", "blocks the event loop for a second while it drives", Block)
HOARDS = _algorithm("hoards", "takes memory without end while it drives", MemoryLeak)
