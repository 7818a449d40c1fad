"""Numbers of the simulated world that are fixed for a campaign, or drawn for each trial between two bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from wayfarer.config.messages import shortened, shown
from wayfarer.errors import BadInput
from wayfarer.simhal.random_streams import RandomStreams


class Range(NamedTuple):
    """A number, or where both ends differ the bounds that it is drawn between for each trial."""

    low: float
    high: float


def drawn(streams: RandomStreams, key: str, bounds: Range) -> float:
    """Return a trial's number between two bounds, with six digits, which its row has too.

    Each key has a random stream of its own, so that another drawn key changes nothing for it.
    """
    return float(f"{streams.generator(f'drawn {key}').uniform(*bounds):.6g}")


def ranges_of(found: Mapping[str, Sequence[float]], allowed: Mapping[str, Range]) -> dict[str, Range]:
    """Return the ranges that a file has, by the names that are expected, each with what its ends must be within.

    Raises:
        ValueError: a number is missing, too many, or out of bounds; the text says which.
    """
    if set(found) != set(allowed):
        names = shortened(", ".join(found)) or "nothing"
        raise ValueError(f"expected {', '.join(allowed)}, found {names}")
    for name, ends in found.items():
        lowest, highest = allowed[name]
        if not (len(ends) == 2 and lowest <= ends[0] <= ends[1] <= highest):
            raise ValueError(
                f"{name} = {shown(list(ends))}: expected two numbers from {lowest:g} to {highest:g} in order"
            )
    return {name: Range(*ends) for name, ends in found.items()}


def parse_range(option: str, text: str, bounds: Range) -> Range:
    """Read ``0.5`` or ``0.3:0.8``.

    Raises:
        BadInput: not one number or two, not within the bounds, or the wrong way round; the text names the option.
    """
    try:
        ends = [float(end) for end in text.split(":")]
    except ValueError:
        ends = []
    if not (1 <= len(ends) <= 2 and bounds.low <= ends[0] <= ends[-1] <= bounds.high):
        raise BadInput(
            f"{option} {text}: expected a number, or MIN:MAX (the smaller first) to draw one for each trial, "
            f"from {bounds.low:g} to {bounds.high:g}"
        )
    return Range(ends[0], ends[-1])
