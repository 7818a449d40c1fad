"""The generated pages are those that the code gives now: ``python -m docs.generate`` writes them."""

from __future__ import annotations

import pytest

from docs.generate import FOLDER, pages


@pytest.fixture(scope="module")
def generated() -> dict[str, str]:
    return pages()


@pytest.mark.parametrize("name", ["python.md", "command-line.md", "rover-file.md", "rover.schema.json"])
def test_page_is_as_the_code_says_now(generated: dict[str, str], name: str) -> None:
    assert (FOLDER / name).read_text(encoding="utf-8") == generated[name], "stale: python -m docs.generate"
    assert set(generated) == {"python.md", "command-line.md", "rover-file.md", "rover.schema.json"}
