"""The plan of a sweep: a grid of points, each a campaign with the same forests, noises and seeds.

What a trial meets follows from the campaign's seed and the trial's number, not from the point: points are paired.
Axes are parsed from ``KEY=FIRST:LAST:STEP`` or ``KEY=VALUE,VALUE``; ``experiments.keys`` has the keys.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

from wayfarer.config.messages import shown
from wayfarer.errors import BadInput, one_line
from wayfarer.experiments.campaign import Axis, Campaign
from wayfarer.experiments.keys import check_keys, current, replace_set
from wayfarer.experiments.settings import MOST_TRIALS, Value, as_decimal, as_number, as_plain, option_of, value_of

MOST_AXES = 2  # a curve or a map; more cannot be drawn
MOST_VALUES = 1000  # of one key; more is a mistyped step


@dataclass(frozen=True)
class Sweep:
    """All that decides the results of a sweep: a campaign, and what varies. The last axis varies fastest."""

    base: Campaign
    axes: tuple[Axis, ...]

    @property
    def total(self) -> int:
        """How many trials it has."""
        return math.prod(len(axis.values) for axis in self.axes) * len(self.base.algorithms) * self.base.trials

    @cached_property
    def points(self) -> tuple[Campaign, ...]:
        """The campaign at each point."""
        keys = [axis.key for axis in self.axes]
        values = product(*(axis.values for axis in self.axes))
        return tuple(replace_set(self.base, dict(zip(keys, each, strict=True))) for each in values)

    def settings(self) -> dict[str, Any]:
        """Return the settings as ``campaign.json`` has them: what makes two sweeps the same one."""
        axes = [{"key": axis.key, "values": list(axis.values), "now": axis.now} for axis in self.axes]
        return {"axes": axes, **self.base.settings()}


def make_sweep(base: Campaign, axes: Sequence[Axis], spell: Callable[[str], str] = option_of) -> Sweep:
    """Return the sweep of these axes over a campaign, all of its points checked; ``spell`` as of ``make_campaign``.

    Raises:
        UnknownName: no such key; the text offers the nearest ones.
        BadConfig: a value is out of its range, or two do not go together.
        BadInput: too many keys or trials, a key without a value, or keys that do not go together.
    """
    if not 1 <= len(axes) <= MOST_AXES:
        raise BadInput(f"{len(axes)} keys to sweep: one gives curves, two give maps, more cannot be drawn")
    check_keys(base, [*base.set, *(axis.key for axis in axes)], spell)
    if without := [axis.key for axis in axes if not axis.values]:
        raise BadInput(f"key '{without[0]}' has no value to sweep: give one at least")
    if odd := [value for axis in axes for value in axis.values if isinstance(value, str) and not _fits_cell(value)]:
        raise BadInput(f"{shown(odd[0])} cannot be swept: a text in trials.csv has no comma, quote or line break")
    now = current(base)
    sweep = Sweep(base, tuple(replace(axis, now=now.get(axis.key)) for axis in axes))
    if sweep.total > MOST_TRIALS:
        fewer = f"take fewer values or {spell('trials')}"
        raise BadInput(f"this sweep has {sweep.total:,} trials, allowed are {MOST_TRIALS:,}; {fewer}")
    for point in sweep.points:
        point.fixed  # noqa: B018 - a value that is out of its range ends it here
    return sweep


def _fits_cell(text: str) -> bool:
    return text.isprintable() and not {",", '"'} & {*text}


# -- axes as people write them -----------------------------------------------------------------------------------------


def axis_of(key: str, values: Iterable[Any]) -> Axis:
    """Return the axis of these values, which Python gives.

    Raises:
        BadInput: they are not a list of numbers or texts.
    """
    plain = None
    if isinstance(values, Iterable) and not isinstance(values, str | bytes | Mapping):
        plain = [as_plain(value) for value in values]
    if plain is None or any(not isinstance(value, bool | int | float | str) for value in plain):
        raise BadInput(f"values of '{one_line(key)}' = {shown(values)}: expected a list of numbers or of texts")
    return Axis(key, tuple(dict.fromkeys(plain)))


def parse_axis(text: str) -> Axis:
    """Return the axis that a text names; a range includes its last value if a step ends there.

    Raises:
        BadInput: it is neither a list nor a range, or its values are too many.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not (key and equals and values):
        raise BadInput(f"'{text}': write KEY=VALUES, such as escape.turn_angle_deg=10:180:10 or sim.trees_per_ha=40,80")
    found = _range(text, values.split(":")) if ":" in values else [value_of(part.strip()) for part in values.split(",")]
    if "" in found:
        raise BadInput(f"'{text}': a value is missing between two commas, or at an end")
    return Axis(key, tuple(dict.fromkeys(found)))


def _range(text: str, parts: list[str]) -> list[Value]:
    try:
        first, last, step = (as_decimal(part) for part in parts)
        count = int((last - first) / step) + 1
    except (ValueError, ArithmeticError):
        raise BadInput(
            f"'{text}': a range is FIRST:LAST:STEP, three numbers and a step that is not 0, such as 10:180:10"
        ) from None
    if not 1 <= count <= MOST_VALUES:
        why = f"{count} values, allowed are {MOST_VALUES}" if count > 1 else "the step leads away from the last value"
        raise BadInput(f"'{text}': {why}; a range is FIRST:LAST:STEP")
    return [as_number(first + step * number) for number in range(count)]
