"""The generated pages are those that the code gives now: ``python -m docs.generate`` writes them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import wayfarer
from docs.generate import FOLDER, TOPICS, WRITTEN_BY, commands, pages
from wayfarer.config.rover_path import SCHEMA

# What a number may be measured in: as the end of its key, or as words of its description.
UNIT_IN_KEY = re.compile(r"_(days|m|s|us|deg|hz|v|mb|kg|m_s2)$|^m_per_pixel$")
UNIT_IN_WORDS = re.compile(
    r"share|0 to \d|number|pixels|grey level|degrees|in rad|deg/s|bit/s|per second|address|duty", re.IGNORECASE
)


@pytest.fixture(scope="module")
def generated() -> dict[Path, str]:
    return pages()


def test_page_is_as_the_code_says_now(generated: dict[Path, str]) -> None:
    old = [
        path.name for path, text in generated.items() if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    assert old == [], "stale: python -m docs.generate"


def test_every_page_that_says_that_it_is_generated_is(generated: dict[Path, str]) -> None:
    marked = {path for path in FOLDER.glob("*.md") if path.read_text(encoding="utf-8").startswith(WRITTEN_BY)}
    assert marked == {path for path in generated if path.parent == FOLDER}
    assert len(generated) > 10


def test_every_public_name_and_command_has_its_page(generated: dict[Path, str]) -> None:
    assert sorted(name for names in TOPICS.values() for name in names) == sorted(wayfarer.__all__)
    text = "".join(text for path, text in generated.items() if path.parent == FOLDER)
    assert [words for words in commands() if text.count(f"\n## {' '.join(('wayfarer', *words))}\n") != 1] == []


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
