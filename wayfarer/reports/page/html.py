"""Templates of HTML pages, and the building blocks of all of them: the macros of ``macros.html``.

A macro escapes the plain text that it is given, and returns Markup, which no other one escapes again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.resources import files
from typing import NamedTuple

from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup

from wayfarer.logview import palette
from wayfarer.vocabulary import in_words

Block = Callable[..., Markup]
_ENVIRONMENT = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)


class PlotLayer(NamedTuple):
    """What can be shown and hidden in all plots of a page: every model that is tagged ``layer:`` and its name.

    ``colour`` is empty if its models do not have one colour.
    """

    name: str
    text: str
    colour: str
    shown: bool = True


def phase_layers() -> Iterator[PlotLayer]:
    """Yield a layer for each phase that is drawn in a path; their boxes are the key to its colours too."""
    for phase, colour in palette.PHASE_COLOURS.items():
        yield PlotLayer(phase, in_words(phase), colour)


def template(package: str, name: str) -> Template:
    """Return a template that lies in a package of wayfarer."""
    return _ENVIRONMENT.from_string((files(package) / name).read_text(encoding="utf-8"))


def macros(package: str, *names: str) -> list[Block]:
    """Return macros of the file ``macros.html`` in a package."""
    module = template(package, "macros.html").module
    return [getattr(module, name) for name in names]


def below(rows: Iterable[tuple[str, Sequence[str]]]) -> list[tuple[str, list[str]]]:
    """Return rows for ``table`` with each interval below its value, so that all columns have room."""
    return [(kind, [cell.strip().replace(" [", "\n[") for cell in cells]) for kind, cells in rows]


section, result, folded, paragraph, bullets, facts, layers, key, figure, panels, table = macros(
    "wayfarer.reports.page",
    *("section", "result", "folded", "paragraph", "bullets", "facts", "layers", "key", "figure", "panels", "table"),
)
