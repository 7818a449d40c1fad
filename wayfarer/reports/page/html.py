"""HTML pages of reports: their building blocks, which are the macros of ``macros.html``, and the frame of all pages.

A page is one file that needs no network, for telephones and printing too. A macro escapes the plain text that it is
given, and returns Markup, which no other one escapes again.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup

from wayfarer.errors import BadInput
from wayfarer.files import write_atomically
from wayfarer.logview import palette
from wayfarer.vocabulary import in_words

if TYPE_CHECKING:
    from wayfarer.reports.page.plots import Plots

PAGE = "report.html"
# A page in a notebook has letters of its size, and is as high as what is in it, which changes when plots are drawn.
FITTED = """
if (frameElement) {
  Object.assign(document.documentElement.style, { fontSize: "14px", overflowY: "hidden" });
  const fit = () => { frameElement.style.height = `${Math.ceil(document.body.offsetHeight)}px`; };
  new ResizeObserver(fit).observe(document.body);
}
"""
_ENVIRONMENT = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)


@cache
def _own(name: str) -> str:
    """Return a file of this package."""
    return (files("wayfarer.reports.page") / name).read_text(encoding="utf-8")


def _template(name: str) -> Template:
    return _ENVIRONMENT.from_string(_own(name))


Block = Callable[..., Markup]
_BLOCKS = (
    "section", "result", "folded", "paragraph", "bullets", "facts", "layers", "key", "figure", "panels", "table",
    "run", "events", "place",
)  # fmt: skip
section, result, folded, paragraph, bullets, facts, layers, key, figure, panels, table, run, events, place = (
    cast(Block, getattr(_template("macros.html").module, name)) for name in _BLOCKS
)


class PlotLayer(NamedTuple):
    """What can be shown and hidden in all plots of a page: every model that is tagged ``layer:`` and its name.

    ``colour`` is empty if its models do not have one colour.
    """

    name: str
    text: str
    colour: str
    shown: bool = True


def phase_layers(driven: Container[str]) -> Iterator[PlotLayer]:
    """Yield a layer for each phase that was driven; their boxes are the key to the colours of a path too."""
    for phase, colour in palette.PHASE_COLOURS.items():
        if phase in driven:
            yield PlotLayer(phase, in_words(phase), colour)


def below(rows: Iterable[tuple[str, Sequence[str]]]) -> list[tuple[str, list[str]]]:
    """Return rows for ``table`` with each interval below its value, so that all columns have room."""
    return [(kind, [cell.strip().replace(" [", "\n[") for cell in cells]) for kind, cells in rows]


class Plot:
    """Figures of a page on their own, with their key and their caption.

    A notebook shows it without any setting or network, and ``save`` makes a page of it. ``figures`` are Bokeh's, which
    may be changed before. A notebook that is saved with it keeps 1.4 MB for each plot, most of which is BokehJS.

    >>> plot = run_campaign("pledge", trials=2).plot()
    >>> plot
    <Plot: pledge in 2 simulated forest trials>
    >>> [figure.name for figure in plot.figures]
    ['paths']
    >>> plot.save("paths.html").name
    'paths.html'
    """

    def __init__(self, title: str, body: Sequence[str], plots: Plots) -> None:
        self._page = title, body, plots

    def __repr__(self) -> str:
        return f"<Plot: {self._page[0]}>"

    @property
    def figures(self) -> list[Any]:
        """The figures of Bokeh in it, in their order."""
        return [*self._page[2].models]

    def save(self, path: str | Path) -> Path:
        """Write it as one HTML file, which needs no network, and return its path. A file that is there is replaced.

        Raises:
            BadInput: it cannot be written there.
        """
        return write_page(Path(path), *self._page, out=Path(path))

    def _repr_html_(self) -> str:
        """Return it as a separate frame: its scripts and styles do not meet those of the notebook."""
        page = _document(*self._page, FITTED).replace("&", "&amp;").replace('"', "&quot;")
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 30rem; border: 0"></iframe>'


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
        usual: the file, if wayfarer chooses it. A symlink there is replaced: the folder may be another user's.
        title: plain text.
        body: Markup of the macros, asked for before the plots; other text is escaped.
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
    return _template("frame.html").render(
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
