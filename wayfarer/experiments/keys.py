"""The keys of a campaign: what ``--set`` sets, or draws for each trial, and what ``wayfarer sweep`` varies.

A key is

* a key of the rover file, by its dotted name (``escape.turn_angle_deg``), checked as the file is;
* ``footprint_m``: ``vehicle.length_m`` and ``vehicle.width_m`` together, a square as in the paper;
* ``slip_mean_m``, ``budget_m`` or ``ground``, which are options of ``wayfarer sim`` too;
* ``senses``: a named set of errors of the sensors;
* ``sim.`` and a number of the simulated world (``physics.Physics``), or ``sim.trees_per_ha``;
* in MuJoCo ``sim.`` and a number of the terrain (``physics.Terrain``), such as the friction.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import islice, product
from typing import Annotated, Any, NamedTuple, TypeGuard, TypeVar

from annotated_types import Interval

from wayfarer.config.messages import shown, validated
from wayfarer.config.rover_file import RoverConfig, flat
from wayfarer.config.rover_file import laid_over as rover_with
from wayfarer.errors import BadInput, UnknownName
from wayfarer.experiments.settings import (
    NO_NUMBER_REACHES,
    CampaignSettings,
    Setting,
    Value,
    as_plain,
    checked_plain,
    option_of,
    sentences,
    value_of,
)
from wayfarer.simhal.world.forest import TREES_PER_HA
from wayfarer.simhal.world.physics import FIELD, GroundName, Physics, Senses, Terrain

SettingsT = TypeVar("SettingsT", bound=CampaignSettings)
MOST_CORNERS = 64  # of all bounds of what is drawn: those that are tried before the first trial

FOOTPRINT = "footprint_m"
BODY = ("vehicle.length_m", "vehicle.width_m")
WORLD = "sim."
PARTS = "parts."  # a driver knows its keys; not all of them are in the file
SENSES = "senses"
SLOPE, DIRECTION = "sim.slope_deg", "sim.slope_direction_deg"
NAMED_SENSES: Mapping[str, Mapping[str, float]] = {"ideal": {}, "field": FIELD}


@dataclass(frozen=True, slots=True)
class ForestKeys:
    """The generator of forests."""

    trees_per_ha: Annotated[float, Interval(ge=0, le=1000)] = TREES_PER_HA
    """Trees per hectare of generated forests; of 20,000 half would touch."""


OWN = ("slip_mean_m", "budget_m", "ground")
PHYSICS = tuple(each.name for each in fields(Physics) if each.name not in OWN)
TERRAIN = tuple(each.name for each in fields(Terrain))
FOREST = tuple(each.name for each in fields(ForestKeys))
# Of the numbers of physics-light MuJoCo has those of the sensors and these (``trial_setup.TrialSpec``).
OF_SENSES = (each.name for each in fields(Senses))
IN_BOTH = frozenset((*OF_SENSES, "slope_deg", "slope_direction_deg", "side_gain_sd", "slip_free_m", "tip_deg"))


class Conditions(NamedTuple):
    """What the keys decide of a trial; ``terrain`` in MuJoCo only."""

    rover: RoverConfig
    physics: Physics
    terrain: Terrain | None
    ground: GroundName
    budget_m: float
    trees_per_ha: float


# -- values as people write them ---------------------------------------------------------------------------------------


def settings_of(asked: Mapping[str, Any] | Iterable[str], where: str) -> dict[str, Setting]:
    """Return values by their keys: from a mapping, or from texts such as ``sim.slope_deg=0:15``.

    Raises:
        BadInput: a text has no key or no value, a key is there twice, or bounds are the wrong way round; ``where`` is
            how the person who is to read that has written them.
    """
    pairs = list(asked.items()) if isinstance(asked, Mapping) else [_pair(text, where) for text in asked]
    found = {str(key): _setting(f"{where} {key}", value) for key, value in pairs}
    if len(found) < len(pairs):
        twice = next(key for key, _ in pairs if [other for other, _ in pairs].count(key) > 1)
        raise BadInput(f"{where} {twice} is there twice; leave one of them out")
    return found


def _pair(text: str, where: str) -> tuple[str, str]:
    key, equals, value = (part.strip() for part in text.partition("="))
    if not (key and equals and value):
        raise BadInput(
            f"{where} {text}: write KEY=VALUE, or KEY=LOW:HIGH to draw a number for each trial, such as "
            "sim.slope_deg=0:15"
        )
    return key, value


def _setting(where: str, value: Any) -> Setting:
    ends: Any = [value_of(part) for part in value.split(":")] if isinstance(value, str) else as_plain(value)
    if isinstance(value, str) and not (len(ends) == 2 and all(map(_is_number, ends))):
        return value_of(value)
    if isinstance(ends, bool | int | float):
        return ends
    low, high = map(as_plain, ends) if isinstance(ends, list | tuple) and len(ends) == 2 else (None, None)
    if not (_is_number(low) and _is_number(high) and low <= high):
        raise BadInput(f"{where} = {shown(value)}: expected a value, or LOW:HIGH to draw it for each trial, LOW first")
    return (low, high) if low < high else low


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


# -- the table, and how values are applied to a campaign ---------------------------------------------------------------


def current(campaign: CampaignSettings) -> dict[str, Any]:
    """Return each key with its value now: None if it has none; keys of parts only if set."""
    now = laid_over(campaign, campaign.fixed_values)
    rover = flat(now.rover.model_dump(mode="json"))
    length_m, width_m = (rover[each] for each in BODY)
    found = {
        FOOTPRINT: length_m if length_m == width_m else None,
        "slip_mean_m": now.physics.slip_mean_m,
        "budget_m": now.budget_m,
        "ground": now.ground,
        SENSES: campaign.set.get(SENSES, "ideal"),
        WORLD + "trees_per_ha": now.trees_per_ha,
        **{WORLD + name: getattr(now.physics, name) for name in PHYSICS},
        **{WORLD + name: getattr(now.terrain, name) for name in TERRAIN if now.terrain},
        **rover,
    }
    return found | dict.fromkeys(campaign.ranges, None)


def descriptions() -> dict[str, str]:
    """Return what each key is that is not of the rover file."""
    own, world = sentences(CampaignSettings), sentences(ForestKeys) | sentences(Physics) | sentences(Terrain)
    return {
        FOOTPRINT: f"{' and '.join(f'``{each}``' for each in BODY)} together.",
        **{name: own[name] for name in OWN},
        SENSES: f"Errors of compass and flow sensor by name: {' or '.join(NAMED_SENSES)} (as in a wood).",
        **{WORLD + name: text for name, text in world.items() if name not in OWN},
    }


def laid_over(campaign: CampaignSettings, values: Mapping[str, Value]) -> Conditions:
    """Return what these values of keys make of a campaign's conditions.

    Raises:
        UnknownName: no such named senses; the text offers those that there are.
        BadInput: a value is out of its range, or two do not go together; the text names the key and what is allowed.
    """
    own = checked_plain({name: values.get(name, getattr(campaign, name)) for name in OWN}, "key '{}'".format)
    name = values.get(SENSES, "ideal")
    if name not in NAMED_SENSES:
        raise UnknownName("value of the key senses", str(name), NAMED_SENSES)
    world = {**NAMED_SENSES[str(name)], **_under(WORLD, PHYSICS, values), "slip_mean_m": own["slip_mean_m"]}
    return Conditions(
        _rover(campaign.rover, values),
        validated(Physics, world, WORLD),
        validated(Terrain, _under(WORLD, TERRAIN, values), WORLD) if campaign.physics == "mujoco" else None,
        own["ground"],
        own["budget_m"],
        validated(ForestKeys, _under(WORLD, FOREST, values), WORLD).trees_per_ha,
    )


def _under(prefix: str, names: tuple[str, ...], values: Mapping[str, Value]) -> dict[str, Value]:
    return {name: values[prefix + name] for name in names if prefix + name in values}


def _rover(rover: RoverConfig, values: Mapping[str, Value]) -> RoverConfig:
    plain = {key: value for key, value in values.items() if key not in {*OWN, SENSES} and not key.startswith(WORLD)}
    if not plain:
        return rover
    if FOOTPRINT in plain:
        plain |= dict.fromkeys(BODY, plain.pop(FOOTPRINT))
    return rover_with(rover, nested(plain))


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


# -- checks ------------------------------------------------------------------------------------------------------------


def check_keys(campaign: CampaignSettings, keys: Sequence[str], spell: Any = option_of) -> None:
    """Refuse unknown keys, and keys that change nothing here.

    Raises:
        UnknownName: no such key; the text offers the nearest ones.
        BadInput: two keys set the same, or one that nothing here depends on; ``spell`` says how its reader writes a
            setting.
    """
    known = current(replace(campaign, set={}))
    for key in keys:
        name = key.removeprefix(WORLD)
        if campaign.physics == "light" and key != name and name in TERRAIN:
            raise BadInput(f"key '{key}' has an effect only in MuJoCo; add {spell('physics')} mujoco")
        if key not in known and not key.startswith(PARTS):
            raise UnknownName("key", key, known)
        if key == DIRECTION and SLOPE not in keys:
            raise BadInput(f"key '{key}' has an effect only with {SLOPE}; set that too, or leave it out")
        if other := _without_effect(campaign, key, name):
            with_it = f"{spell(other)} mujoco" if other == "physics" else spell(other)
            raise BadInput(f"key '{key}' has no effect with {with_it}; leave out one of them")
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise BadInput(f"key '{twice[0]}' is there twice, swept or in {spell('set')}; leave out one of them")
    if FOOTPRINT in keys and (twice := [key for key in BODY if key in keys]):
        raise BadInput(f"keys '{FOOTPRINT}' and '{twice[0]}' set the same value; leave out one of them")


def _without_effect(campaign: CampaignSettings, key: str, name: str) -> str | None:
    """Return the setting with which a key changes nothing, if the campaign has it."""
    if key != name and name in FOREST:
        return "forests" if campaign.forests else "site" if campaign.site else None
    of_light = key == "ground" or (key != name and name in set(PHYSICS) - IN_BOTH)
    return "physics" if of_light and campaign.physics == "mujoco" else None


def check_ranges(campaign: SettingsT) -> SettingsT:
    """Return the campaign with all bounds tried, as whole numbers if a key counts something.

    Raises:
        BadInput: what has bounds is not a number, or a trial that drew them could not be run.
    """
    known = current(replace(campaign, set=campaign.fixed_values))
    ranges: dict[str, Setting] = {}
    for key, (low, high) in campaign.ranges.items():
        if key == SENSES or isinstance(known.get(key), bool | str):
            raise BadInput(f"key '{key}' is not a number: it cannot be drawn for each trial; give one value")
        if not -NO_NUMBER_REACHES < low < high < NO_NUMBER_REACHES:
            raise BadInput(f"key '{key}' = {shown([low, high])}: expected LOW:HIGH, LOW first, both below 1e16")
        ranges[key] = (int(low), int(high)) if _counts(campaign, key, low, high) else (float(low), float(high))
    checked = replace_set(campaign, ranges)
    for each in corners(checked):
        laid_over(checked, {**checked.fixed_values, **each})
    return checked


def _counts(campaign: CampaignSettings, key: str, low: float, high: float) -> bool:
    """Return whether a key takes whole numbers only: a part's is known to its driver alone, so it is tried."""
    if not (float(low).is_integer() and float(high).is_integer()):
        return False
    others = {other: ends[0] for other, ends in campaign.ranges.items()}
    try:
        laid_over(campaign, {**campaign.fixed_values, **others, key: int(low)})
    except BadInput:
        return False  # the bounds themselves are wrong, which is said when they are tried
    try:
        laid_over(campaign, {**campaign.fixed_values, **others, key: low + 0.5})
    except BadInput:
        return True
    return False


def corners(campaign: CampaignSettings) -> Iterator[dict[str, float]]:
    """Yield combinations of the bounds of what is drawn; one without any if nothing is."""
    for ends in islice(product(*campaign.ranges.values()), MOST_CORNERS):
        yield dict(zip(campaign.ranges, ends, strict=True))


def replace_set(campaign: SettingsT, values: Mapping[str, Setting]) -> SettingsT:
    """Return a campaign with these values of keys beside its own."""
    return replace(campaign, set={**campaign.set, **values})


def drawn(ranges: Mapping[str, tuple[float, float]], seed: int) -> dict[str, float]:
    """Return a trial's numbers between these bounds, with six digits, which its row has too.

    Each key has a separate random stream: drawing another key as well changes nothing for it.
    """
    if not ranges:
        return {}
    from wayfarer.simhal.random_streams import RandomStreams  # imports numpy: only campaigns that draw need it

    streams, values = RandomStreams(seed), dict[str, float]()
    for key, (low, high) in ranges.items():
        generator = streams.generator(f"drawn {key}")
        if isinstance(low, int) and isinstance(high, int):
            values[key] = int(generator.integers(low, high, endpoint=True))
        else:
            values[key] = float(f"{generator.uniform(low, high):.6g}")
    return values
