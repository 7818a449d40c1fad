"""The settings that a results folder keeps: whose folder it is, and what makes two campaigns or sweeps the same one."""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

from wayfarer.config.messages import shortened, shown
from wayfarer.config.rover_overlay import flat
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Tasks
from wayfarer.files.regular_file import read_regular

MOST_BYTES = 10_000_000  # of a settings' file: a sweep of two keys with all the values that fit a command line has less


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
        BadInput: it belongs to another one, or to another version's; the text names the first difference.
    """
    kind = kind_of(settings)
    here = _by_name(json.loads(json.dumps(settings)))
    try:
        there = _by_name(json.loads(read_regular(path / f"{kind}.json", MOST_BYTES)))
    except (OSError, ValueError, AttributeError, TypeError, RecursionError):
        raise BadInput(f"{path} cannot be resumed: it holds no {kind} ({kind}.json is missing or damaged)") from None
    for name in (*here, *there):
        if here.get(name) != there.get(name):
            raise BadInput(
                f"{path} belongs to another {kind}: {shortened(name)} is {shown(there.get(name))} there and "
                f"{shown(here.get(name))} here; repeat its settings, or give another folder"
            )


def _by_name(settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings by their dotted names, those of a sweep's axes by the number of the axis too."""
    return flat(settings | {"axes": dict(enumerate(settings.get("axes", ()), start=1))})
