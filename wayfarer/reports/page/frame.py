"""The frame of all HTML pages: one file that needs no network, for telephones and printing too."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from wayfarer.errors import BadInput
from wayfarer.files import write_atomically
from wayfarer.logview import palette
from wayfarer.reports.page.html import template

if TYPE_CHECKING:
    from wayfarer.reports.page.plots import Plots

PAGE = "report.html"


def write_page(
    usual: Path,
    title: str,
    body: Iterable[str],
    plots: Plots,
    script: str = "",
    *,
    out: Path | None = None,
) -> Path:
    """Write a page, whole or not at all, and return its path.

    Args:
        usual: the file, where wayfarer chooses it. A symlink there is replaced: the folder may be another user's.
        title: plain text.
        body: Markup (``reports.page.html``), asked for before the plots; other text is escaped.
        plots: what Bokeh draws in it.
        script: JavaScript that runs at the end of the page, before the plots are drawn. When they are, ``document``
            receives the event ``plotted``, whose ``detail`` is Bokeh's document.
        out: the file that a person chose instead, which may be a symlink; its folder is made if it is not there.

    Raises:
        BadInput: it cannot be written there.
    """
    text = _document(title, body, plots, script)
    path = out or usual
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text, follow_symlink=out is not None)
    except OSError as error:
        raise BadInput(
            f"{path}: the page cannot be written there: {error.strerror or error}; name another file with --out"
        ) from error
    return path


def _document(title: str, body: Iterable[str], plots: Plots, script: str) -> str:
    body = list(body)  # which places the plots
    return template("wayfarer.reports.page", "frame.html").render(
        title=title,
        style=palette.css() + _own("page.css"),
        body=body,
        plots=plots.to_json().replace("<", "\\u003c"),  # else a text in it could end the element
        scripts=(bokeh_js(), script, _own("page.js")),
    )


@cache
def bokeh_js() -> str:
    """Return Bokeh for browsers: 1.3 MB, without its widgets, tables and WebGL."""
    from bokeh.resources import Resources  # takes half a second

    return "\n".join(Resources(mode="inline", components=["bokeh"], log_level="warn").js_raw)


@cache
def _own(name: str) -> str:
    return (files("wayfarer.reports.page") / name).read_text(encoding="utf-8")
