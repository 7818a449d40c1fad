"""The frame of all HTML pages: one file that needs no network, for telephones and printing too."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path

from bokeh.resources import Resources

from wayfarer.errors import BadInput
from wayfarer.files.atomic_file import write_atomically
from wayfarer.views import palette
from wayfarer.views.page.plots import Plots

PAGE = "report.html"


def write_page(
    usual: Path,
    title: str,
    body: Iterable[str],
    plots: Plots | None = None,
    script: str = "",
    *,
    out: Path | None = None,
) -> Path:
    """Write a page, whole or not at all, and return its path.

    Args:
        usual: the file, where wayfarer chooses it. A symlink there is replaced: the folder may be another user's.
        title: plain text.
        body: HTML; it is asked for once, before the plots.
        plots: what Bokeh draws in it. Without, the page has no script.
        script: JavaScript that runs before the plots are drawn. When they are, ``document`` receives the event
            ``plotted``, whose ``detail`` is Bokeh's document.
        out: the file that a person chose instead, which may be a symlink; its folder is made if it is not there.

    Raises:
        BadInput: it cannot be written there.
    """
    text = "\n".join(_document(title, "\n".join(body), plots, script))
    path = out or usual
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text, follow_symlink=out is not None)
    except OSError as error:
        raise BadInput(
            f"{path}: the report cannot be written there: {error.strerror or error}; name another file with --out"
        ) from error
    return path


def _document(title: str, body: str, plots: Plots | None, script: str) -> Iterator[str]:
    yield from (
        "<!DOCTYPE html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>",
        f"<style>\n{palette.css()}{_own('page.css')}</style>",
        "</head>",
        "<body>",
        "<main>",
        f"<h1>{escape(title)}</h1>",
        body,
        "</main>",
    )
    if plots is not None:
        content = plots.to_json().replace("</", "<\\/")  # else a text in it could end the element
        yield f'<script type="application/json" id="plots">{content}</script>'
        yield from (f"<script>\n{code}\n</script>" for code in (bokeh_js(), script, _own("page.js")))
    yield from ("</body>", "</html>", "")


@cache
def bokeh_js() -> str:
    """Return Bokeh for browsers: 1.3 MB, without its widgets, tables and WebGL."""
    return "\n".join(Resources(mode="inline", components=["bokeh"], log_level="warn").js_raw)


@cache
def _own(name: str) -> str:
    return (files("wayfarer.views.page") / name).read_text(encoding="utf-8")
