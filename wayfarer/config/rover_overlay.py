"""A rover configuration with some settings replaced, and settings by their dotted names."""

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


def flat(value: Any, name: str = "") -> dict[str, Any]:
    """Return tables within tables by their dotted names, as ``detector.tilt_deg``."""
    if not isinstance(value, dict):
        return {name: value}
    return {key: leaf for k, v in value.items() for key, leaf in flat(v, f"{name}.{k}" if name else k).items()}
