"""What wheels were told, as the bench wrote it down: when they turned, and when they were stopped for good."""

from __future__ import annotations

from math import inf
from typing import TypeAlias

Commands: TypeAlias = list[tuple[float, float, float]]
"""Each is (time that it is true from, left duty, right duty)."""


def stop_after(commands: Commands) -> tuple[float, float]:
    """Return when wheels that stand were last told to turn, and when they were told to stand for good.

    Raises:
        ValueError: they were never told to turn.
    """
    last = max(index for index, (_, left, right) in enumerate(commands) if left or right)
    stop_s = next(t_s for t_s, left, right in commands[last:] if not (left or right))
    return commands[last][0], stop_s


def spans(commands: Commands) -> list[tuple[float, float]]:
    """Return from when to when any wheel was told to turn; a span that has not ended ends in infinity."""
    found: list[tuple[float, float]] = []
    start_s: float | None = None
    for t_s, left, right in commands:
        if (left or right) and start_s is None:
            start_s = t_s
        elif not (left or right) and start_s is not None:
            found.append((start_s, t_s))
            start_s = None
    return found if start_s is None else [*found, (start_s, inf)]


def told_to_turn(commands: Commands) -> bool:
    """Return whether any wheel was told to turn."""
    return any(left or right for _, left, right in commands)


def first_stop(commands: Commands, after_s: float) -> tuple[float, float]:
    """Return when wheels were last told to turn before they were first stopped after a time, and when that was.

    Raises:
        ValueError: they did not turn before, or were not stopped.
    """
    stop_s = min((t_s for t_s, left, right in commands if t_s > after_s and not (left or right)))
    return max(t_s for t_s, left, right in commands if t_s < stop_s and (left or right)), stop_s
