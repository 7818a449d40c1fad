"""A rover file as text: each key that differs from its default, or that a person should know, below what it means."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from wayfarer.config.key_schema import key_schema, table_schema
from wayfarer.config.rover_file import RoverConfig
from wayfarer.config.rover_path import SCHEMA_ELSEWHERE

WIDTH = 100
HEAD = """\
Written by `wayfarer init`. `wayfarer check` shows what is still wrong; change it here.
All other keys have their defaults: docs/reference/rover-file.md, or an editor that knows the schema, lists them.
"""
# Optional parts that many rovers have, for a person to add later.
ABSENT = {
    "light": 'driver = "gpio_light"  # an LED or a buzzer that warns before the rover drives off\nred = 17',
    "position": 'driver = "gpsd"  # a receiver, for the log and the mission\'s radius; no decision sees it',
    "contact": 'driver = "bumper"  # switches\nfront = 5',
}


def rover_toml(table: Mapping[str, Any], remarks: Mapping[str, str]) -> str:
    """Return the text of a rover file.

    Args:
        table: the tables of the file.
        remarks: what a part's section begins with, by the part: how it was found.
    """
    known = [key for key in RoverConfig.model_fields if key in table]
    plain = {key: table[key] for key in known if not isinstance(table[key], dict)}
    sections = [_comment(HEAD), "\n".join(_keys("", plain))]
    sections += [_section(key, table[key]) for key in known if table[key] and key not in {*plain, "parts"}]
    for part, settings in table["parts"].items():
        sections.append(_section(f"parts.{part}", settings, remarks.get(part, "")))
    for part, text in ABSENT.items():
        if part not in table["parts"]:
            sections.append(_comment(f"[parts.{part}]\n{text}"))
    return SCHEMA_ELSEWHERE + "\n\n".join(sections) + "\n"


def _section(name: str, table: Mapping[str, Any], remark: str = "") -> str:
    lines = [f"[{name}]"] + ([_comment(remark)] if remark else [])
    return "\n".join([*lines, *_keys(name, table)])


def _keys(section: str, table: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of a section, in the order of its schema."""
    driver = table.get("driver")
    order = list(table_schema(section, driver).get("properties", {}))
    for key in sorted(table, key=lambda key: order.index(key) if key in order else len(order)):
        said = key_schema(f"{section}.{key}" if section else key, driver).get("description", "")
        if said:
            yield _comment(said)
        yield f"{key} = {toml_value(key, table[key])}"


def _comment(text: str) -> str:
    """Return lines of comment, no wider than a narrow terminal likes."""
    wrapped = (textwrap.wrap(line, WIDTH - 2, break_on_hyphens=False) for line in text.splitlines())
    return "\n".join(f"# {line}" for lines in wrapped for line in lines)


def toml_value(key: str, value: Any) -> str:
    """Return a value as TOML has it; I2C addresses as data sheets have them."""
    if key == "address" and isinstance(value, int) and value < 0x80:
        return f"0x{value:02X}"
    return json.dumps(value, ensure_ascii=False, default=str)  # a date, as rover files are read
