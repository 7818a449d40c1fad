"""What the pages of campaigns and of sweeps share: where they go, their style, their figures and the names of these."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from html import escape
from pathlib import Path

from wayfarer.errors import BadInput
from wayfarer.experiments.report.drawing import Drawing, house_style
from wayfarer.views.page.frame import PAGE, write_page

FIGURES = "figures"  # the folder beside the page


def write_drawn(folder: Path, out: Path | None, title: str, body_of: Callable[[Path], Iterable[str]]) -> Path:
    """Write a page, its figures in the house style, and return its path: ``out``, or ``report.html`` in ``folder``.

    Raises:
        BadInput: it cannot be written there.
    """
    out = folder / PAGE if out is None else out
    figures = out.parent / FIGURES
    try:
        figures.mkdir(parents=True, exist_ok=True)
        with house_style():
            body = list(body_of(figures))
    except OSError as error:
        raise BadInput(
            f"{out}: the report cannot be written there: {error.strerror or error}; name another file with --out"
        ) from error
    return write_page(out, title, body)


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


def file_name(*parts: object) -> str:
    """Return a name for the file of a figure, whatever an algorithm is called."""
    return re.sub(r"[^\w.-]", "_", "-".join(map(str, parts)))
