"""Writes a scenario as a scenario file: the inverse of ``scenario_file.py``."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields
from math import inf
from pathlib import Path
from typing import Any

from wayfarer.config.rover_path import is_rover_file
from wayfarer.fault_scenarios.scenario import Scenario
from wayfarer.simhal.faults.kinds import Fault

_SAME_NAME = ("name", "about", "rover", "depth", "algorithm", "for_s", "seed", "slip_mean_m", "clearing")


def as_toml(scenario: Scenario) -> str:
    """Return the text of a file with this scenario; of what it expects, only level and bound."""
    whole = {name: getattr(scenario, name) for name in _SAME_NAME} | {"rover": _rover(scenario.rover)}
    if not scenario.commands:
        whole["command"] = []  # where nothing is said, the rover is armed
    expect = {"level": scenario.expect.level, "within_s": scenario.expect.within_s}
    lines = [*_table("[[scenario]]", whole), *_table("[scenario.expect]", expect)]
    lines += _tables("scenario.settings", scenario.settings or {})
    for fault in scenario.faults:
        lines += _table("[[scenario.fault]]", _fault(fault))
    for command in scenario.commands:
        lines += _table("[[scenario.command]]", {each.name: getattr(command, each.name) for each in fields(command)})
    return "\n".join(lines) + "\n"


def _rover(name_or_path: str) -> str:
    """Return a rover's name, or its file's path from anywhere: the scenario's own file may be elsewhere."""
    return str(Path(name_or_path).resolve()) if is_rover_file(name_or_path) else name_or_path


def _fault(fault: Fault) -> dict[str, Any]:
    lasts = {} if fault.for_s == inf else {"for_s": fault.for_s}
    params = {each.name: getattr(fault.params, each.name) for each in fields(fault.params)}
    return {"at_s": fault.at_s, **lasts, "target": fault.target, "kind": fault.kind, **params}


def _tables(name: str, table: Mapping[str, Any]) -> Iterator[str]:
    """Yield a table's own keys, then the tables in it."""
    own = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    if own:
        yield from _table(f"[{name}]", own)
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _tables(f"{name}.{key}", value)


def _table(head: str, items: Mapping[str, Any]) -> Iterator[str]:
    yield head
    # A number or string of JSON, without infinities, is one of TOML; None is a key that is left out.
    yield from (f"{key} = {json.dumps(value, allow_nan=False)}" for key, value in items.items() if value is not None)
