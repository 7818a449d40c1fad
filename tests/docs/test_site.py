"""The site: built strictly, no request to another host, no dead link; in a browser search works, and tables fit."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from docs import build
from docs.notebook import as_markdown
from tests.browser import PHONE, OpenPage

pytest.importorskip("zensical", reason="the site is built with the extra docs")

# Attributes by which a browser fetches something by itself; a link waits for a person.
FETCHES = {("script", "src"), ("link", "href"), ("img", "src"), ("source", "src"), ("iframe", "src"), ("video", "src")}
# By how much each table is wider than what it scrolls in, and whether a shadow is drawn there.
TABLES = """[...document.querySelectorAll(".md-typeset__scrollwrap")].map((place) => [
  place.querySelector("table").textContent.trim().slice(0, 40),
  place.scrollWidth - place.clientWidth,
  getComputedStyle(place).backgroundImage.includes("gradient")
    && getComputedStyle(place.querySelector("table")).backgroundColor === "rgba(0, 0, 0, 0)",
])"""


class Fetched(HTMLParser):
    """Addresses that a browser asks for when it opens a page."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value for name, value in attrs if value and (tag, name) in FETCHES]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built") / "site"
    build.build(folder)
    return folder


@pytest.mark.process
def test_site_is_built_strictly_and_asks_no_other_host(site: Path) -> None:
    places = set(build.pages().values())
    for place in (place for place in places if place.endswith(".md")):
        assert (site / place).with_suffix(".html").is_file(), place
    for page in site.rglob("*.html"):
        fetched = Fetched()
        fetched.feed(page.read_text(encoding="utf-8"))
        assert [address for address in fetched.addresses if re.match(r"(https?:)?//", address)] == [], page
        if page.name != "404.html":  # which may be shown at any address
            files = [address.partition("#")[0] for address in fetched.addresses if not address.startswith("data:")]
            assert [name for name in files if not (page.parent / name).exists()] == [], page
    for style in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import )['\"]?(https?:)?//", style.read_text(encoding="utf-8")), style


@pytest.mark.process
def test_search_works_in_a_page_that_was_opened_as_a_file(site: Path, browser_page: OpenPage) -> None:
    opened = browser_page(offline=True)
    opened.page.goto((site / "how-to/install.html").as_uri())
    opened.page.get_by_role("button", name="Search").click()
    opened.page.keyboard.type("encoder")
    found = opened.page.locator("a", has_text="Wheel encoders").first
    found.click()
    opened.page.wait_for_url("**/reference/hardware.html**")
    assert opened.trouble == []


@pytest.mark.process
def test_table_fits_its_page_and_on_a_phone_shows_that_it_scrolls(site: Path, browser_page: OpenPage) -> None:
    desktop, phone = browser_page(), browser_page(PHONE)
    tables = 0
    for page in sorted(site.rglob("*.html")):
        for opened in (desktop, phone):
            opened.page.goto(page.as_uri())
            assert opened.overflow_px() <= 0, page
        wide = desktop.page.evaluate(TABLES)
        tables += len(wide)
        assert [(head, by_px) for head, by_px, _ in wide if by_px > 0] == [], page
        assert [head for head, by_px, hint in phone.page.evaluate(TABLES) if by_px > 0 and not hint] == [], page
    assert tables > 200


@pytest.mark.process
def test_dead_link_or_anchor_fails_the_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "docs/how-to").mkdir(parents=True)
    (tmp_path / "docs/how-to/install.md").write_text("# Install\n", encoding="utf-8")
    dead = "# Home\n\n[page](docs/no-such-page.md) [anchor](docs/how-to/install.md#no-such-heading)\n"
    (tmp_path / "README.md").write_text(dead, encoding="utf-8")
    (tmp_path / "zensical.toml").write_text('[project]\nsite_name = "dead"\n', encoding="utf-8")
    monkeypatch.setattr(build, "ROOT", tmp_path)
    monkeypatch.setattr(build, "ELSEWHERE", {"README.md": "index.md"})
    with pytest.raises(SystemExit) as told:
        build.build(tmp_path / "site")
    assert "page does not exist" in str(told.value)
    assert "anchor does not exist" in str(told.value)
    assert not (tmp_path / "site").exists()


def test_navigation_has_every_page_once() -> None:
    shown = re.findall(r'"([^"]+\.md)"', (build.ROOT / "zensical.toml").read_text(encoding="utf-8"))
    assert sorted(shown) == sorted(place for place in build.pages().values() if place.endswith(".md"))


def test_links_of_a_page_that_is_elsewhere_lead_to_pages_of_the_site() -> None:
    places = build.pages()
    assert "](../how-to/service.md)" not in build.page_text("README.md", places)
    assert "](how-to/service.md)" in build.page_text("README.md", places)
    assert "](what-stops-the-wheels.md)" in build.page_text("ARCHITECTURE.md", places)


def test_notebook_becomes_text_code_and_what_it_printed() -> None:
    page = as_markdown(
        '{"cells": [{"cell_type": "markdown", "source": ["# T"]}, {"cell_type": "code", "source": ["print(1)"], '
        '"outputs": [{"output_type": "stream", "name": "stdout", "text": ["1\\n"]}]}]}'
    )
    assert page == "# T\n\n```python\nprint(1)\n```\n\n```text\n1\n```"
