"""The settings that a results folder keeps: whose folder it is, and what makes two campaigns or sweeps the same one."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields
from itertools import product
from pathlib import Path
from typing import Any

from wayfarer.config.chassis import AT_A_BRANCH, Chassis
from wayfarer.config.messages import shortened, shown
from wayfarer.config.rover_overlay import flat
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Tasks
from wayfarer.files.regular_file import read_regular
from wayfarer.simhal.world.grounds import GroundName
from wayfarer.simhal.world.physics import PHYSICS

MOST_BYTES = 10_000_000  # of a settings' file: a sweep of two keys with all the values that fit a command line has less
CHASSIS = "rover.chassis"  # where its keys stand in the settings
# What settings that do not name it stand for.
UNSAID = {"ground": GroundName.ideal.value} | {f"sim.{name}": value for name, value in asdict(PHYSICS).items()}


def kind_of(settings: Mapping[str, Any]) -> str:
    """Return ``sweep`` or ``campaign``: what has these settings, and how errors and the settings' file call it."""
    return "sweep" if "axes" in settings else "campaign"


def tasks_of(settings: Mapping[str, Any]) -> Tasks:
    """Return every trial of the campaign or sweep that has these settings."""
    campaign = settings.get("campaign", settings)
    return Tasks(campaign["algorithms"], campaign["trials"], len(swept_values(settings)))


def swept_values(settings: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the value of each swept key at each point, the last key varying fastest; a campaign is one point."""
    axes = settings.get("axes", ())
    points = product(*(axis["values"] for axis in axes))
    return [dict(zip((axis["key"] for axis in axes), values, strict=True)) for values in points]


def refuse_another(path: Path, settings: Mapping[str, Any]) -> None:
    """Refuse a folder that does not belong to the campaign or sweep that has these settings.

    Raises:
        BadInput: it belongs to another one; the text names the first difference.
    """
    kind = kind_of(settings)
    try:
        there = _comparable(json.loads(read_regular(path / f"{kind}.json", MOST_BYTES)), kind)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise BadInput(f"{path} cannot be resumed: it holds no {kind} ({kind}.json is missing or damaged)") from None
    for name, value, other in _differences(_comparable(json.loads(json.dumps(settings)), kind), there):
        raise BadInput(
            f"{path} belongs to another {kind}: {shortened(name)} is {shown(other)} there and "
            f"{shown(value)} here; repeat its settings, or give another folder"
        )


def _comparable(settings: Any, kind: str) -> dict[str, Any]:
    """Return settings by their dotted names; what a sweep sweeps has all its values."""
    if kind == "campaign":
        return UNSAID | flat(settings)
    keys = [str(axis["key"]) for axis in settings["axes"]]
    swept = zip(keys, (axis["values"] for axis in settings["axes"]), strict=True)
    return UNSAID | flat(settings["campaign"]) | {"keys": keys} | dict(swept)


def _differences(here: Mapping[str, Any], there: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted name and both values of each setting that makes two campaigns differ.

    What a rover file says of its chassis decides only where this campaign reads it. Files of older versions say less,
    and are still of the same campaign.
    """
    read = _chassis_keys_read(here)
    for name in dict.fromkeys((*here, *there)):
        section, _, key = name.rpartition(".")
        if (section != CHASSIS or key in read) and here.get(name) != there.get(name):
            yield name, here.get(name), there.get(name)


def _chassis_keys_read(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Return which keys of the chassis a campaign with these settings reads."""
    if settings["ground"] != GroundName.ideal or any(name.startswith("mujoco.") for name in settings):
        return tuple(field.name for field in fields(Chassis))
    return AT_A_BRANCH if settings.get("scenario") else ()
