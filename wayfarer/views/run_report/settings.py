"""What of a run's rover file is not as the defaults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

from markupsafe import Markup

from wayfarer import __version__
from wayfarer.config.rover_file import RoverConfig, flat
from wayfarer.escape.api import Vehicle
from wayfarer.fieldlog.fields import table
from wayfarer.views.page import html
from wayfarer.views.run_report.data import RunData

NO_SETTINGS = "The log does not tell the rover file."
ALL_DEFAULTS = "Everything in the rover file is as wayfarer has it by default."


def own_settings_table(data: RunData) -> Markup:
    """Return the keys of a run's rover file whose values are not the defaults, or which have none."""
    settings, usual = _settings(data), default_settings()
    if not settings:
        return html.paragraph(NO_SETTINGS)
    rows = [
        ("setting", (key, _text(value), _text(usual[key])))
        for key, value in settings.items()
        if key in usual and usual[key] != value
    ]
    rows += [("setting", (key, _text(value), "")) for key, value in settings.items() if key not in usual]
    if not rows:
        return html.paragraph(ALL_DEFAULTS)
    caption = (
        f"Keys of the rover file whose value is not the default of wayfarer {__version__}; below them those without a "
        "default, as of body and parts."
    )
    return html.table(caption, ("key", "value", "default"), rows)


def default_settings() -> Mapping[str, Any]:
    """Return what a rover file need not say, by its dotted keys: all but the name, the body and the parts."""
    asked = [field.name for field in fields(Vehicle) if field.default is MISSING]
    usual = RoverConfig(name="any", vehicle=Vehicle(**dict.fromkeys(asked, 1.0)))
    needed = {"name", "parts", *(f"vehicle.{name}" for name in asked)}
    return {key: value for key, value in flat(usual.model_dump(mode="json")).items() if key not in needed}


def _settings(data: RunData) -> dict[str, Any]:
    return flat(table(data.header, "config"))


def _text(value: Any) -> str:
    return "none" if value is None else str(value)
