"""The generated pages are those that the code gives now: ``python -m docs.generate`` writes them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from docs.generate import CASE, FOLDER, STOPS, WITNESSED, pages
from wayfarer.config.rover_path import SCHEMA

# What a number may be measured in: as the end of its key, or as words of its description.
UNIT_IN_KEY = re.compile(r"_(days|m|s|us|deg|hz|v|mb|kg|m_s2)$|^m_per_pixel$")
UNIT_IN_WORDS = re.compile(
    r"share|0 to \d|number|pixels|grey level|degrees|in rad|deg/s|bit/s|a second|address|duty", re.IGNORECASE
)


@pytest.fixture(scope="module")
def generated() -> dict[Path, str]:
    return pages()


@pytest.mark.parametrize(
    "name", ["python.md", "command-line.md", "campaign-settings.md", "rover-file.md", SCHEMA, STOPS, CASE, WITNESSED]
)
def test_page_is_as_the_code_says_now(generated: dict[Path, str], name: str | Path) -> None:
    path = FOLDER / name  # an absolute path stays what it is
    assert path.read_text(encoding="utf-8") == generated[path], "stale: python -m docs.generate"
    assert len(generated) == 8


def test_every_key_of_the_world_has_its_default_and_range(generated: dict[Path, str]) -> None:
    page = generated[FOLDER / "campaign-settings.md"]
    cells = [[cell.strip() for cell in line.split(" | ")] for line in page.splitlines() if line.startswith("| `sim.")]
    assert len(cells) > 30
    assert [row[0] for row in cells if not (row[1] and "number" in row[2])] == []


def settings(schema: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Give table, key and schema of each setting of a rover file, drivers' included."""
    parts = schema["properties"]["parts"]["properties"]
    drivers = {f"{part} {each['title']}": each for part, choice in parts.items() for each in choice["anyOf"][:-1]}
    for table, of in {"": schema, **schema["$defs"], **drivers}.items():
        for key, value in of["properties"].items():
            if "$ref" not in value and key != "driver":
                yield table, key, value


def types_of(value: dict[str, Any]) -> set[str]:
    return {each.get("type", "") for each in [value, *value.get("anyOf", [])]}


def test_every_key_says_what_it_is_and_in_which_unit(generated: dict[Path, str]) -> None:
    found = list(settings(json.loads(generated[SCHEMA])))
    assert len(found) > 150
    assert [f"{table}.{key}" for table, key, value in found if not value.get("description")] == []
    assert [
        f"{table}.{key}"
        for table, key, value in found
        if types_of(value) & {"number", "integer"}
        and not UNIT_IN_KEY.search(key)
        and not UNIT_IN_WORDS.search(value["description"])
    ] == []
