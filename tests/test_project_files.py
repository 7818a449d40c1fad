"""The files for people say what is so: paths that are there, one version, one name and one set of addresses."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest
from packaging.version import Version

from hatch_version import last_release, version_of
from tests.test_imports import LAYERS
from wayfarer import __version__
from wayfarer.errors import how_to_install
from wayfarer.extras import NEEDS

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PAGES = sorted(
    path.relative_to(ROOT).as_posix() for glob in ("*.md", "*/*.md", "docs/*/*.md") for path in ROOT.glob(glob)
)


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def paths_in(text: str) -> set[str]:
    """What stands between backquotes and looks like a path of the checkout, and the paths of `pytest` commands."""
    quoted = re.findall(r"`([\w.-][\w./-]*/[\w./-]*)`", text)
    tried = [word for command in re.findall(r"pytest ([^`\n#]+)", text) for word in command.split() if "/" in word]
    return {*quoted, *tried}


# Words over which readers stumbled. Write "chosen by us", "if", "round trip", "checked against", "current",
# "front", "from", "per", "stopped", "sensor".
STUMBLES = re.compile(
    r"\b(?:from no source|None where(?!:)|there and back|held against|garbage rejected|present settings|nose ahead"
    r"|difference to|(?:once|times|ticks|degrees|metres|bytes|readings|pictures) a (?:second|minute|tick|trial)"
    r"|(?:the|its) wheels stand|an? sense is|lost sense|nothing but|anew|all the time|hands on|swallows?"
    r"|(?<!there )(?:is|are) no (?:number|symlink|duty|text|row|record|link|run|stall|ordinary|error|evidence))\b",
    re.IGNORECASE,
)


@pytest.mark.parametrize(
    "folder",
    ["wayfarer", "docs", "examples", *(path.name for path in ROOT.glob("*.md") if path.name != "CHANGELOG.md")],
)
def test_text_is_plain_english(folder: str) -> None:
    top = ROOT / folder
    paths = [each for each in top.rglob("*.*") if each.suffix in {".py", ".md", ".js", ".html", ".toml"}] or [top]
    texts = {path: re.sub(r"\n *(?:#|//) ", "\n", path.read_text(encoding="utf-8")) for path in paths}
    assert {
        path.name: found for path, text in texts.items() if (found := STUMBLES.findall(" ".join(text.split())))
    } == {}


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "ARCHITECTURE.md"])
def test_path_that_a_page_names_is_there(page: str) -> None:
    paths = paths_in(text_of(page))
    assert paths
    assert {path for path in paths if not any((ROOT / top / path).exists() for top in ("", "wayfarer"))} == set()


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "CODE_OF_CONDUCT.md", "SECURITY.md"])
def test_page_that_asks_for_reports_names_no_invented_address(page: str) -> None:
    text = text_of(page)
    assert len(re.findall(r"address goes here\*\* \(owner:", text)) == 1
    assert not re.search(r"https?://|\b[\w.+-]+@[\w-]+\.\w", text)


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


# -- the version and the name ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("described", "version"),
    [
        ("v0.2.0", "0.2.0"),
        ("v0.3.0rc1", "0.3.0rc1"),
        ("v0.2.0-dirty", "0.2.0+dirty"),
        ("v0.2.0-3-g1a2b3c4d", "0.2.0+g1a2b3c4d"),
        ("v0.2.0-3-g1a2b3c4d-dirty", "0.2.0+g1a2b3c4d.dirty"),
        ("1a2b3c4d", "0.1.0+g1a2b3c4d"),  # no tags
        ("1a2b3c4d-dirty", "0.1.0+g1a2b3c4d.dirty"),
        ("", "0.1.0+dev"),  # git refuses, or git archive without tags
        ("$Format:%(describe)$", "0.1.0+dev"),
        ("vNext", "0.1.0+dev"),
    ],
)
def test_version_is_the_tag_or_says_that_it_is_none(described: str, version: str) -> None:
    assert version_of(described, "0.1.0") == version
    assert str(Version(version)) == version


def test_checkout_and_citation_have_the_changelogs_last_release() -> None:
    released = last_release(ROOT)
    assert re.search(rf"^## \[{re.escape(released)}\] - \d{{4}}-\d\d-\d\d$", text_of("CHANGELOG.md"), re.MULTILINE)
    assert re.search(rf"^version: {re.escape(released)}$", text_of("CITATION.cff"), re.MULTILINE)
    assert __version__ == f"{released}+dev" or (ROOT / "PKG-INFO").exists()


def test_each_extra_that_an_error_names_is_one_of_the_distribution() -> None:
    for needed in NEEDS.values():
        assert needed.extra in PROJECT["optional-dependencies"]
        assert how_to_install(needed.extra) == f"pip install '{PROJECT['name']}[{needed.extra}]'"


def test_citation_has_the_projects_address_if_there_is_one() -> None:
    cited = re.findall(r"^repository-code: (.+)$", text_of("CITATION.cff"), re.MULTILINE)
    assert cited == [address for name, address in PROJECT["urls"].items() if name == "Source"]


# -- what is installed -------------------------------------------------------------------------------------------------


def shown_by(path: Path) -> str:
    """What people may see of a file: all of it, of Python its strings that are no statement of their own."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        return text
    tree = ast.parse(text)
    quiet = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    strings = (each for each in ast.walk(tree) if isinstance(each, ast.Constant) and id(each) not in quiet)
    return "\n".join(each.value for each in strings if isinstance(each.value, str))


def test_what_an_installed_wayfarer_shows_names_no_file_of_the_checkout() -> None:
    suffixes = {".py", ".toml", ".json", ".html", ".js"}
    files = [path for path in (ROOT / "wayfarer").rglob("*") if path.suffix in suffixes]
    assert len(files) > 200
    checkout = re.compile(r"\b(docs|examples|tests)/\w|\b(CONTRIBUTING|README|ARCHITECTURE)\b")
    assert [(path.name, found[0]) for path in files if (found := checkout.search(shown_by(path)))] == []
