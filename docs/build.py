"""Build the documentation into ``site/``: ``python -m docs.build``.

The pages are those of ``docs``, a few files of the checkout's top, and the notebook. They are laid into a temporary
folder first, with their links changed to where each page is there. A dead link or anchor fails the build. Search works
in a page that is opened as a file too.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from docs.notebook import as_markdown

ROOT = Path(__file__).resolve().parents[1]
SITE = ROOT / "site"
NOTEBOOK = "docs/tutorial/campaign.ipynb"
# Pages that are elsewhere in the checkout, where people look for them, and their places in the site.
ELSEWHERE = {
    "ARCHITECTURE.md": "explanation/architecture.md",
    "CHANGELOG.md": "reference/changelog.md",
    "CODE_OF_CONDUCT.md": "how-to/code-of-conduct.md",
    "CONTRIBUTING.md": "how-to/contributing.md",
    "SECURITY.md": "explanation/security.md",
    "benchmarks/README.md": "explanation/benchmarks.md",
    "README.md": "index.md",
    "examples/ros2/wayfarer_failsafe/README.md": "how-to/ros2.md",
    NOTEBOOK: "tutorial/campaign.md",
    "wayfarer/rovers/rover.schema.json": "reference/rover.schema.json",
}
STATIC = {".png", ".webp", ".svg", ".css", ".js", ".json", ".xml"}
# What search in a file needs: zensical asks another host for it, in place of which pages have a file of ours.
FOREIGN, OURS = "https://unpkg.com/iframe-worker/shim", "images/file-worker.js"
LINK = re.compile(r"(?<=\]\()(?!https?:|mailto:|data:|#)([^)#\s]+)")


def build(site: Path = SITE) -> None:
    """Write the site into a folder, in place of what was there.

    Raises:
        SystemExit: with what is wrong, as the generator says it.
    """
    with tempfile.TemporaryDirectory() as folder:
        staged = Path(folder)
        stage(staged / "docs")
        shutil.copy(ROOT / "zensical.toml", staged)
        command = [sys.executable, "-m", "zensical", "build", "--strict", "--config-file", "zensical.toml"]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}  # where docstrings are read from
        done = subprocess.run(command, cwd=staged, env=environment, stderr=subprocess.PIPE, text=True, check=False)
        if done.returncode:
            sys.exit(done.stderr.partition("Traceback (most recent call last)")[0])  # it raises to end
        for page in (staged / "site").rglob("*.html"):
            ours = os.path.relpath(staged / "site" / OURS, page.parent)
            page.write_text(page.read_text(encoding="utf-8").replace(FOREIGN, ours), encoding="utf-8")
        shutil.rmtree(site, ignore_errors=True)
        shutil.copytree(staged / "site", site)


def stage(folder: Path) -> None:
    """Lay all pages and pictures into a folder, with their links as they are there."""
    places = pages()
    for source, place in places.items():
        path = folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        if Path(source).suffix in STATIC:
            shutil.copy(ROOT / source, path)
        else:
            path.write_text(page_text(source, places), encoding="utf-8")


def pages() -> dict[str, str]:
    """Return the place in the site of each file of the checkout that is in it."""
    ours = [path for path in (ROOT / "docs").rglob("*") if path.suffix in {".md", *STATIC}]
    return {path.relative_to(ROOT).as_posix(): path.relative_to(ROOT / "docs").as_posix() for path in ours} | ELSEWHERE


def page_text(source: str, places: dict[str, str]) -> str:
    """Return a page as Markdown, with the links of the site."""
    text = (ROOT / source).read_text(encoding="utf-8")
    if source == NOTEBOOK:
        text = as_markdown(text)

    def placed(match: re.Match[str]) -> str:
        target = os.path.normpath(Path(source).parent / match[1])
        there = places.get(target, match[1])  # a link to what is not in the site stays, and fails the build
        return os.path.relpath(there, Path(places[source]).parent)

    return LINK.sub(placed, text)


if __name__ == "__main__":
    build()
