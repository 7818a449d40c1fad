"""A rover configuration with some settings replaced: for fault scenarios and sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wayfarer.config.messages import validated
from wayfarer.config.rover_file import RoverConfig


def laid_over(config: RoverConfig, settings: Mapping[str, Any], prefix: str = "") -> RoverConfig:
    """Return a rover with some settings changed, as validated as a rover file; an error puts ``prefix`` before a key.

    Raises:
        BadConfig: the text names the key and what is allowed.
    """
    return validated(RoverConfig, _merged(config.model_dump(mode="json"), settings), prefix)


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return two tables as one, where the upper one counts; tables within them are merged too."""
    merged = dict(below)
    for key, value in above.items():
        under = merged.get(key)
        merged[key] = _merged(under, value) if isinstance(under, Mapping) and isinstance(value, Mapping) else value
    return merged
