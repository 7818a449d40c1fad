"""The files for people say what is so: paths that are there, one version."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.test_imports import LAYERS
from wayfarer import __version__

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    path.relative_to(ROOT).as_posix() for glob in ("*.md", "*/*.md", "docs/*/*.md") for path in ROOT.glob(glob)
)


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def paths_in(text: str) -> set[str]:
    """What stands between backquotes and looks like a path of the checkout, and the paths of `pytest` commands."""
    quoted = re.findall(r"`([\w./-]+/[\w./-]*)`", text)
    tried = [word for command in re.findall(r"pytest ([^`\n#]+)", text) for word in command.split() if "/" in word]
    return {*quoted, *tried}


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "ARCHITECTURE.md"])
def test_path_that_a_page_names_is_there(page: str) -> None:
    paths = paths_in(text_of(page))
    assert paths
    assert {path for path in paths if not any((ROOT / top / path).exists() for top in ("", "wayfarer"))} == set()


@pytest.mark.parametrize("page", PAGES)
def test_link_to_another_page_leads_to_a_heading_there(page: str) -> None:
    for name, heading in re.findall(r"\]\((?!http)([^)#]*)#?([^)]*)\)", text_of(page)):
        path = (ROOT / page).parent / name if name else ROOT / page
        assert path.exists(), name
        headings = re.findall(r"^#+ (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE) if heading else []
        assert heading in {"", *(re.sub(r"[^\w -]", "", each.lower()).replace(" ", "-") for each in headings)}


def test_architecture_has_the_picture_of_the_imports() -> None:
    text = text_of("ARCHITECTURE.md")
    picture = text.partition("```text\n")[2].partition("```")[0]
    assert [line.replace(",", "").split() for line in picture.splitlines()] == LAYERS


def test_changelog_and_citation_have_the_version() -> None:
    assert re.search(rf"^## \[{re.escape(__version__)}\] - \d{{4}}-\d\d-\d\d$", text_of("CHANGELOG.md"), re.MULTILINE)
    assert re.search(rf"^version: {re.escape(__version__)}$", text_of("CITATION.cff"), re.MULTILINE)
