"""The device files that a rover's parts are on, and the check that they exist and are accessible before a run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

from wayfarer.commissioning.checks.api import HostEnvironment
from wayfarer.commissioning.checks.system import diagnose
from wayfarer.config.rover_file import RoverConfig, line_in, part_settings
from wayfarer.errors import BadConfig


def device_files(config: RoverConfig) -> tuple[str, ...]:
    """Return the device files that a rover's parts are on, each once, in their order."""
    return tuple(dict.fromkeys(device for _, device in _ports(config)))


def refuse_missing_ports(config: RoverConfig, where: str, host: HostEnvironment) -> None:
    """Refuse a rover if a device file does not exist or may not be used.

    Args:
        config: the rover; only the Raspberry Pi's own buses have device files.
        where: the rover's file, or the name of a shipped one.
        host: where device files are looked up.

    Raises:
        BadConfig: the text names file, key and device, and what to do, such as which group to join.
    """
    for key, device in _ports(config):
        trouble = diagnose(host, device)
        if trouble is not None:
            line = line_in(where, key)
            at = f" (line {line})" if line else ""
            raise BadConfig(f"{where}: key '{key}'{at}: {trouble.found}, {trouble.cause}: {trouble.remedy}")


def _ports(config: RoverConfig) -> Iterator[tuple[str, str]]:
    """Give each device file and the key that names it; only buses of Linux have device files."""
    if config.buses != "linux":
        return
    for part, table in config.parts.items():
        _, settings = part_settings(part, table)
        for field in fields(settings):
            value = getattr(settings, field.name)
            if isinstance(value, str) and value.startswith("/dev/"):
                yield f"parts.{part}.{field.name}", value
