"""The plan of a sweep: a grid of points, each a campaign with the same forests, noises and seeds.

What a trial meets follows from the campaign's seed and the trial's number, not from the point: points are paired.
Axes are parsed from ``KEY=FIRST:LAST:STEP`` or ``KEY=VALUE,VALUE``. The keys that can be swept are

* a key of the rover file, by its dotted name (``escape.turn_angle_deg``), checked as the file is;
* ``footprint_m``: ``vehicle.length_m`` and ``vehicle.width_m`` together, a square as in the paper;
* ``slip_mean_m``, ``budget_m`` and ``ground``, as the options of ``wayfarer sim``;
* ``sim.`` and a number of the simulated world (``physics.Physics``), or ``sim.trees_per_ha``;
* in MuJoCo ``sim.`` and a number of the terrain (``mujoco.terrain.Terrain``), such as the friction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from decimal import Decimal
from itertools import product
from typing import Annotated, Any, Final

from annotated_types import Interval

from wayfarer.config.messages import validated
from wayfarer.config.rover_file import flat, laid_over
from wayfarer.errors import BadInput, UnknownName
from wayfarer.experiments.campaign import Campaign
from wayfarer.setting_ranges import Metres
from wayfarer.simhal.drawn_ranges import parse_range
from wayfarer.simhal.mujoco.terrain import BOUNDS, Terrains
from wayfarer.simhal.world.physics import GroundName, Physics, Senses

Value = bool | int | float | str

MOST_AXES = 2  # a curve or a map; more cannot be drawn
MOST_VALUES = 1000  # of one key; more is a mistyped step
MOST_DIGITS = 15  # before or after the point
MOST_TRIALS = 1_000_000

FOOTPRINT = "footprint_m"
BODY = ("vehicle.length_m", "vehicle.width_m")
WORLD = "sim."
PARTS = "parts."  # a driver knows its keys; not all of them stand in the file


@dataclass(frozen=True, slots=True)
class Axis:
    """A key and the values that it takes, at least one, each once, in the order in which they were asked for."""

    key: str
    values: tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Sweep:
    """All that decides the results of a sweep: a campaign, what varies, and the campaign at each point.

    The last axis varies fastest.
    """

    base: Campaign
    axes: tuple[Axis, ...]
    points: tuple[Campaign, ...]

    def settings(self) -> dict[str, Any]:
        """Return the settings as JSON can hold them: what makes two sweeps the same one.

        ``now`` is what the campaign has for each key if it is not swept.
        """
        now = current(self.base)
        axes = [{"key": a.key, "values": list(a.values), "now": now.get(a.key)} for a in self.axes]
        return {"axes": axes, "campaign": self.base.settings()}


def make_sweep(base: Campaign, axes: Sequence[Axis]) -> Sweep:
    """Return the sweep of these axes over a campaign, all of its points checked.

    Raises:
        UnknownName: no such key; the text offers the nearest ones.
        BadConfig: a value is out of its range, or two do not go together.
        BadInput: too many keys or trials, a key without a value, or keys that do not go together.
    """
    if not 1 <= len(axes) <= MOST_AXES:
        raise BadInput(f"{len(axes)} keys to sweep: one gives curves, two give maps, more cannot be drawn")
    keys = [axis.key for axis in axes]
    _check_keys(base, keys)
    if without := [axis.key for axis in axes if not axis.values]:
        raise BadInput(f"key '{without[0]}' has no value to sweep: give one at least")
    count = math.prod(len(axis.values) for axis in axes) * len(base.algorithms) * base.trials
    if count > MOST_TRIALS:
        raise BadInput(f"this sweep has {count:,} trials, allowed are {MOST_TRIALS:,}; take fewer values or --trials")
    values = product(*(axis.values for axis in axes))
    points = (laid_over_campaign(base, dict(zip(keys, each, strict=True))) for each in values)
    return Sweep(base, tuple(axes), tuple(points))


# -- axes as a command line has them -----------------------------------------------------------------------------------


def parse_axis(text: str) -> Axis:
    """Return the axis that a text names; a range includes its last value where a step ends there.

    Raises:
        BadInput: it is neither a list nor a range, or its values are too many.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not (key and equals and values):
        raise BadInput(f"'{text}': write KEY=VALUES, such as escape.turn_angle_deg=10:180:10 or sim.trees_per_ha=40,80")
    found = _range(text, values.split(":")) if ":" in values else [_value(part.strip()) for part in values.split(",")]
    if "" in found:
        raise BadInput(f"'{text}': a value is missing between two commas, or at an end")
    return Axis(key, tuple(dict.fromkeys(found)))


def _range(text: str, parts: list[str]) -> list[Value]:
    try:
        first, last, step = (_decimal(part) for part in parts)
        count = int((last - first) / step) + 1
    except (ValueError, ArithmeticError):
        raise BadInput(
            f"'{text}': a range is FIRST:LAST:STEP, three numbers and a step that is not 0, such as 10:180:10"
        ) from None
    if not 1 <= count <= MOST_VALUES:
        why = f"{count} values, allowed are {MOST_VALUES}" if count > 1 else "the step leads away from the last value"
        raise BadInput(f"'{text}': {why}; a range is FIRST:LAST:STEP")
    return [_number(first + step * number) for number in range(count)]


def _value(text: str) -> Value:
    if text in {"true", "false"}:
        return text == "true"
    try:
        return _number(_decimal(text))
    except (ArithmeticError, ValueError):
        return text


def _decimal(text: str) -> Decimal:
    """Return a number that can be a setting.

    Raises:
        ArithmeticError: it is no number.
        ValueError: it is not finite, or so large or small that a whole number of it would fill the memory.
    """
    value = Decimal(text.strip())
    if not value.is_finite() or (value and abs(value.adjusted()) > MOST_DIGITS):
        raise ValueError(text)
    return value


def _number(value: Decimal) -> int | float:
    """Return a whole number as an int, which a key that counts something needs."""
    return int(value) if value == value.to_integral_value() else float(value)


# -- the keys, and how a value for one is applied to a campaign --------------------------------------------------------


@dataclass(frozen=True, slots=True)
class CampaignKeys:
    """The campaign's own settings."""

    slip_mean_m: Metres
    budget_m: Annotated[float, Interval(gt=0, le=1e6)]
    ground: GroundName


@dataclass(frozen=True, slots=True)
class ForestKeys:
    """The numbers of the generator; of 20,000 trees a hectare half would touch."""

    trees_per_ha: Annotated[float, Interval(ge=0, le=1000)]


CAMPAIGN = tuple(field.name for field in fields(CampaignKeys))
FOREST = tuple(field.name for field in fields(ForestKeys))
PHYSICS = tuple(field.name for field in fields(Physics) if field.name not in CAMPAIGN)
TERRAIN = Terrains._fields
SLOPE = ("slope_deg", "slope_direction_deg")
# Of the numbers of physics-light MuJoCo has those of the senses and these (``trial_setup.TrialSpec``).
IN_BOTH: Final = frozenset(
    {*(field.name for field in fields(Senses)), *SLOPE, "side_gain_sd", "slip_free_m", "tip_deg"}
)


def current(campaign: Campaign) -> dict[str, Any]:
    """Return each key that can be swept with its value now: None if it has none; keys of parts only if set."""
    rover = flat(campaign.rover.model_dump(mode="json"))
    length_m, width_m = (rover[each] for each in BODY)
    return {
        FOOTPRINT: length_m if length_m == width_m else None,
        **{name: getattr(campaign, name) for name in CAMPAIGN},
        **{WORLD + name: getattr(campaign, name) for name in FOREST},
        **{WORLD + name: getattr(campaign.physics, name) for name in PHYSICS},
        **(_fixed_terrain(campaign.terrains) if campaign.terrains else {}),
        **rover,
    }


def _fixed_terrain(terrains: Terrains) -> dict[str, float | None]:
    return {WORLD + name: low if low == high else None for name, (low, high) in terrains._asdict().items()}


def _check_keys(campaign: Campaign, keys: list[str]) -> None:
    """Refuse keys that cannot be swept.

    Raises:
        UnknownName: no such key; the text offers the nearest ones.
        BadInput: two keys set the same, or one that nothing here depends on.
    """
    known = current(campaign)
    for key in keys:
        if campaign.terrains is None and key in {WORLD + name for name in TERRAIN}:
            raise BadInput(f"key '{key}' has an effect only in MuJoCo; add --physics mujoco")
        if key not in known and not key.startswith(PARTS):
            raise UnknownName("key", key, known)
        if option := _option_against(campaign, key.removeprefix(WORLD)):
            raise BadInput(f"key '{key}' has no effect with {option}; leave out one of them")
    if len(set(keys)) < len(keys) or (FOOTPRINT in keys and set(BODY) & set(keys)):
        raise BadInput(f"{' and '.join(keys)} set the same value; sweep one of them")


def _option_against(campaign: Campaign, name: str) -> str | None:
    """Return the option with which a key of the world changes nothing, where a campaign has that."""
    if name in FOREST and campaign.forests is not None:
        return "--forests"
    if name in FOREST and campaign.scenario is not None:
        return "--site"
    if name in SLOPE and campaign.slopes is not None:
        return "--slope-deg"
    if campaign.terrains is not None and (name == "ground" or name in set(PHYSICS) - IN_BOTH):
        return "--physics mujoco"
    return None


def laid_over_campaign(campaign: Campaign, values: Mapping[str, Value]) -> Campaign:
    """Return a campaign with these values.

    Raises:
        BadConfig: a value is out of its range, or two do not go together; the text names the key and what is allowed.
    """
    now_campaign, now_forest = ({name: getattr(campaign, name) for name in names} for names in (CAMPAIGN, FOREST))
    own = validated(CampaignKeys, now_campaign | _under("", CAMPAIGN, values))
    forest = validated(ForestKeys, now_forest | _under(WORLD, FOREST, values), WORLD)
    physics = validated(Physics, asdict(campaign.physics) | _under(WORLD, PHYSICS, values), WORLD)
    rover = campaign.rover
    if of_rover := _of_rover(values):
        rover = laid_over(rover, nested(of_rover))
    terrains = campaign.terrains and campaign.terrains._replace(
        **{
            name: parse_range(WORLD + name, str(value), getattr(BOUNDS, name))
            for name, value in _under(WORLD, TERRAIN, values).items()
        }
    )
    return replace(campaign, rover=rover, physics=physics, terrains=terrains, **asdict(own), **asdict(forest))


def _under(prefix: str, names: tuple[str, ...], values: Mapping[str, Value]) -> dict[str, Value]:
    return {name: values[prefix + name] for name in names if prefix + name in values}


def _of_rover(values: Mapping[str, Value]) -> dict[str, Value]:
    """Return the keys that are of the rover file; a footprint stands for two."""
    plain = {key: value for key, value in values.items() if key not in CAMPAIGN and not key.startswith(WORLD)}
    if FOOTPRINT in plain:
        plain |= dict.fromkeys(BODY, plain.pop(FOOTPRINT))
    return plain


def nested(values: Mapping[str, Value]) -> dict[str, Any]:
    """Return tables within tables, from dotted keys."""
    table: dict[str, Any] = {}
    for dotted, value in values.items():
        *sections, key = dotted.split(".")
        inner = table
        for section in sections:
            inner = inner.setdefault(section, {})
        inner[key] = value
    return table
