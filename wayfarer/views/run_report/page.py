"""Building blocks of HTML pages: one self-contained file, for telephones and printing too."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path

from wayfarer.errors import BadInput
from wayfarer.fieldlog.atomic_file import whole_file
from wayfarer.views.run_report.drawing import Drawing

PAGE = "report.html"
FIGURES = "figures"  # the folder beside the page
LONG = 30  # letters


def write_page(out: Path, title: str, body_of: Callable[[Path], Iterable[str]]) -> Path:
    """Write a page, whole or not at all, and return ``out``; ``body_of`` gets the folder for the figures, beside it.

    Raises:
        BadInput: it cannot be written there.
    """
    figures = out.parent / FIGURES
    try:
        figures.mkdir(parents=True, exist_ok=True)
        with whole_file(out) as draft:
            draft.write_bytes(document(title, body_of(figures)).encode())
    except OSError as error:
        raise BadInput(
            f"{out}: the report cannot be written there: {error.strerror or error}; name another file with --out"
        ) from error
    return out


def document(title: str, body: Iterable[str]) -> str:
    """Return a whole page; ``body`` is HTML, ``title`` is text."""
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title>",
            f"<style>\n{_css()}</style>",
            "</head>",
            "<body>",
            "<main>",
            f"<h1>{escape(title)}</h1>",
            *body,
            "</main>",
            "</body>",
            "</html>",
            "",
        ]
    )


def section(heading: str, *parts: str) -> str:
    """Return a section under a heading."""
    return "\n".join(["<section>", f"<h2>{escape(heading)}</h2>", *parts, "</section>"])


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def bullets(texts: Iterable[str]) -> str:
    """Return a list of plain texts."""
    return "\n".join(["<ul>", *(f"<li>{escape(text)}</li>" for text in texts), "</ul>"])


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return names and values as a list; a long value has a separate line."""
    lines = ['<dl class="facts">']
    for name, value in pairs:
        kind = ' class="long"' if len(value) > LONG else ""
        lines.append(f"<div{kind}><dt>{escape(name)}</dt><dd>{_lines(value)}</dd></div>")
    return "\n".join([*lines, "</dl>"])


def figure(drawing: Drawing, caption: str, kind: str = "wide") -> str:
    """Return a drawing with its caption and links to its files; a wide one scrolls where the screen is narrow."""
    links = " ".join(f'<a href="{FIGURES}/{drawing.name}.{ending}">{ending.upper()}</a>' for ending in ("png", "svg"))
    scrolls = ' tabindex="0"' if kind == "wide" else ""
    return "\n".join(
        [
            f'<figure class="{kind}">',
            f'<div class="drawing"{scrolls}>',
            drawing.svg.strip(),
            "</div>",
            f'<figcaption>{escape(caption)} <span class="files">{links}</span></figcaption>',
            "</figure>",
        ]
    )


def table(caption: str, head: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Return a table; each row has a class and its cells, the first of which names it. A line feed parts lines."""
    lines = [
        '<div class="table" tabindex="0">',
        "<table>",
        f"<caption>{escape(caption)}</caption>",
        "<thead><tr>" + "".join(f'<th scope="col">{_lines(cell)}</th>' for cell in head) + "</tr></thead>",
        "<tbody>",
    ]
    for kind, (name, *cells) in rows:
        data = "".join(f"<td>{_lines(cell)}</td>" for cell in cells)
        lines.append(f'<tr class="{kind}"><th scope="row">{_lines(name)}</th>{data}</tr>')
    return "\n".join([*lines, "</tbody>", "</table>", "</div>"])


def _lines(text: str) -> str:
    return escape(text).replace("\n", "<br>")


@cache
def _css() -> str:
    return (files("wayfarer.views.run_report") / "page.css").read_text(encoding="utf-8")
