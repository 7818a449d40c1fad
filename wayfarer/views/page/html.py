"""Building blocks of HTML pages. Each takes plain text and escapes it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple


def section(heading: str, *parts: str) -> str:
    """Return a section under a heading."""
    return "\n".join(["<section>", f"<h2>{escape(heading)}</h2>", *parts, "</section>"])


def paragraph(text: str) -> str:
    """Return a paragraph of plain text; nothing where there is none."""
    return f"<p>{escape(text)}</p>" if text else ""


def bullets(texts: Iterable[str]) -> str:
    """Return a list of plain texts."""
    return "\n".join(["<ul>", *(f"<li>{escape(text)}</li>" for text in texts), "</ul>"])


def link(address: str, text: str) -> str:
    """Return a link."""
    return f'<a href="{escape(address)}">{escape(text)}</a>'


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return names and values as a list."""
    items = [f"<div><dt>{escape(name)}</dt><dd>{_lines(value)}</dd></div>" for name, value in pairs]
    return "\n".join(['<dl class="facts">', *items, "</dl>"])


class PlotLayer(NamedTuple):
    """What can be shown and hidden in all plots of a page: every model that is tagged ``layer:`` and its name."""

    name: str
    text: str
    colour: str
    shown: bool = True


def layers(title: str, each: Iterable[PlotLayer]) -> str:
    """Return a box to tick for each layer, which is the key to the colours too; ``title`` is for those who hear it."""
    boxes = [
        f'<label><input type="checkbox" data-layer="{escape(layer.name)}"{" checked" * layer.shown}>'
        f'<i style="background: {escape(layer.colour)}"></i>{escape(layer.text)}</label>'
        for layer in each
    ]
    return "\n".join([f'<fieldset class="layers" aria-label="{escape(title)}">', *boxes, "</fieldset>"])


def key(title: str, lines: Iterable[tuple[str, str]]) -> str:
    """Return the title of a plot, with the names and the colours of its lines."""
    names = "".join(
        f'<span><i style="background: {escape(colour)}"></i>{escape(name)}</span>' for name, colour in lines
    )
    return f'<p class="key"><b>{escape(title)}</b>{names}</p>'


def figure(drawn: str, caption: str = "", alt: str = "") -> str:
    """Return a drawing, which is HTML, with its caption if it has one; ``alt`` says in words what it shows."""
    label = f' aria-label="{escape(alt)}"' if alt else ""
    below = [f"<figcaption>{escape(caption)}</figcaption>"] if caption else []
    return "\n".join([f"<figure{label}>", drawn, *below, "</figure>"])


def panels(figures: Iterable[str]) -> str:
    """Return figures beside each other, as far as there is room."""
    return "\n".join(['<div class="panels">', *figures, "</div>"])


def table(caption: str, head: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Return a table; each row has a class and its cells, the first of which names it. A line feed parts lines.

    On a telephone a row is a list under its name, so each cell says its column.
    """
    lines = [
        '<div class="table" tabindex="0">',
        "<table>",
        f"<caption>{escape(caption)}</caption>",
        "<thead><tr>" + "".join(f'<th scope="col">{_lines(cell)}</th>' for cell in head) + "</tr></thead>",
        "<tbody>",
    ]
    for kind, (name, *cells) in rows:
        columns = zip((column.replace("\n", " ") for column in head[1:]), cells, strict=True)
        data = "".join(f'<td data-column="{escape(column)}">{_lines(cell)}</td>' for column, cell in columns)
        lines.append(f'<tr class="{kind}"><th scope="row">{_lines(name)}</th>{data}</tr>')
    return "\n".join([*lines, "</tbody>", "</table>", "</div>"])


def _lines(text: str) -> str:
    return escape(text).replace("\n", "<br>")
