"""The keys that can be swept, and how a value for one is applied to a campaign.

* a key of the rover file, by its dotted name (``escape.turn_angle_deg``), checked as the file is;
* ``footprint_m``: ``vehicle.length_m`` and ``vehicle.width_m`` together, a square as in the paper;
* ``slip_mean_m``, ``budget_m`` and ``ground``, as the options of ``wayfarer sim``;
* ``sim.`` and a number of the simulated world (``physics.Physics``), or ``sim.trees_per_ha``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Annotated, Any

from annotated_types import Interval

from wayfarer.config.messages import validated
from wayfarer.config.rover_file import flat, laid_over
from wayfarer.errors import BadInput, UnknownName
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.sweep.axes import Value
from wayfarer.setting_ranges import Metres
from wayfarer.simhal.world.physics import GroundName, Physics

FOOTPRINT = "footprint_m"
BODY = ("vehicle.length_m", "vehicle.width_m")
WORLD = "sim."
PARTS = "parts."  # a driver knows its keys; not all of them stand in the file


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


def current(campaign: Campaign) -> dict[str, Any]:
    """Return each key that can be swept with its value now: None where it has none; keys of parts only if set."""
    rover = flat(campaign.rover.model_dump(mode="json"))
    length_m, width_m = (rover[each] for each in BODY)
    return {
        FOOTPRINT: length_m if length_m == width_m else None,
        **{name: getattr(campaign, name) for name in CAMPAIGN},
        **{WORLD + name: getattr(campaign, name) for name in FOREST},
        **{WORLD + name: getattr(campaign.physics, name) for name in PHYSICS},
        **rover,
    }


def check_keys(campaign: Campaign, keys: list[str]) -> None:
    """Refuse keys that cannot be swept.

    Raises:
        UnknownName: no such key; the text offers the nearest ones.
        BadInput: two keys set the same, or one that nothing here depends on.
    """
    known = current(campaign)
    for key in keys:
        if key not in known and not key.startswith(PARTS):
            raise UnknownName("key", key, known)
        if key.removeprefix(WORLD) in FOREST and campaign.forests is not None:
            raise BadInput(f"key '{key}' is of generated forests; leave out --forests")
    if len(set(keys)) < len(keys) or (FOOTPRINT in keys and set(BODY) & set(keys)):
        raise BadInput(f"{' and '.join(keys)} set the same value; sweep one of them")


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
        rover = laid_over(rover, _nested(of_rover))
    return replace(campaign, rover=rover, physics=physics, **asdict(own), **asdict(forest))


def _under(prefix: str, names: tuple[str, ...], values: Mapping[str, Value]) -> dict[str, Value]:
    return {name: values[prefix + name] for name in names if prefix + name in values}


def _of_rover(values: Mapping[str, Value]) -> dict[str, Value]:
    """Return the keys that are of the rover file; a footprint stands for two."""
    plain = {key: value for key, value in values.items() if key not in CAMPAIGN and not key.startswith(WORLD)}
    if FOOTPRINT in plain:
        plain |= dict.fromkeys(BODY, plain.pop(FOOTPRINT))
    return plain


def _nested(values: Mapping[str, Value]) -> dict[str, Any]:
    """Return tables within tables, from dotted keys."""
    table: dict[str, Any] = {}
    for dotted, value in values.items():
        *sections, key = dotted.split(".")
        inner = table
        for section in sections:
            inner = inner.setdefault(section, {})
        inner[key] = value
    return table
