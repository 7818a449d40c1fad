"""Bokeh figures in the style of all pages, and their place in a page.

Axes, grids and texts take their colours from the variables ``--bk-...`` of ``page.css``, so they follow a dark page.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from bokeh.document import Document
from bokeh.models import BoxZoomTool, HoverTool, Model, PanTool, ResetTool, SaveTool, WheelZoomTool
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import ColumnDataSource, figure
from markupsafe import Markup

TEXT = "11px"
Figure = figure


def plot(name: str, height_px: int | None, zooms: Literal["width", "both", "map"], **settings: Any) -> Figure:
    """Return an empty figure as wide as its place. ``name`` is how a script of the page finds it.

    Dragging moves a ``map``, which keeps one scale for both axes, and zooms to what was dragged over in the others.
    Ctrl and the wheel zoom as well; the wheel alone scrolls the page. ``settings`` are further properties of
    ``bokeh.plotting.figure``.
    """
    sides: Literal["width", "both"] = "width" if zooms == "width" else "both"
    pan, box = PanTool(dimensions=sides), BoxZoomTool(dimensions=sides, match_aspect=zooms == "map")
    wheel = WheelZoomTool(dimensions=sides, modifiers={"ctrl": True})
    made = figure(
        name=name,
        height=height_px,
        tools=[pan, box, wheel, ResetTool(), SaveTool(filename=name)],
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        lod_threshold=None,  # a line of few points would be drawn coarsely while it is dragged
        min_border_right=12,
        **{"sizing_mode": "stretch_width"} | settings,
    )
    made.toolbar.logo = None
    made.toolbar.active_drag, made.toolbar.active_scroll = pan if zooms == "map" else box, wheel
    made.axis.axis_label_text_font_size = made.axis.major_label_text_font_size = TEXT
    made.axis.axis_label_text_font_style = "normal"
    made.axis.minor_tick_line_color = None
    return made


def source(**columns: Any) -> ColumnDataSource:
    """Return columns as Bokeh keeps them; numbers in single precision, which halves the page."""
    return ColumnDataSource({name: _compact(values) for name, values in columns.items()})


def _compact(values: Any) -> Any:
    array = np.asarray(values)
    return array.astype(np.float32) if array.dtype.kind in "fiu" else list(values)


def layer(name: str, *renderers: GlyphRenderer[Any]) -> None:
    """Let the page's box for a layer (``html.layers``) show and hide what was drawn."""
    for renderer in renderers:
        renderer.tags = [*renderer.tags, f"layer:{name}"]


def hover(renderers: Sequence[GlyphRenderer[Any]], *rows: tuple[str, str], **settings: Any) -> HoverTool:
    """Return a box that shows what is under the pointer: names, and values as ``@column{0.0} unit``."""
    return HoverTool(renderers=list(renderers), tooltips=list(rows), visible=False, **settings)


class Plots:
    """The models of one page, in the order in which they were placed."""

    def __init__(self) -> None:
        self.models: list[Model] = []

    def place(self, model: Model) -> Markup:
        """Return the element in which the browser draws a model."""
        self.models.append(model)
        return Markup('<div class="plot" id="plot-{}"></div>').format(len(self.models))

    def to_json(self) -> str:
        """Return what ``page.js`` needs to draw them.

        The same models give the same text: Bokeh counts its ids through the life of a process, a page from 1.
        """
        document, ids = Document(), dict[str, str]()
        with document.models.freeze():  # else each root makes it look at all models once more
            for model in self.models:
                document.add_root(model)
        content = _renumbered(document.to_json(deferred=False), ids)
        places = {ids[model.id]: f"plot-{at}" for at, model in enumerate(self.models, start=1)}
        document.clear()  # a model can be in one document only, and a notebook shows a plot as often as it is asked to
        return json.dumps({"document": content, "places": places}, separators=(",", ":"))


def _renumbered(part: Any, ids: dict[str, str]) -> Any:
    """Return a part of a document with the ids of models, and what refers to them, counted from 1."""
    if isinstance(part, dict):
        return {
            key: ids.setdefault(value, f"p{len(ids) + 1}") if key == "id" else _renumbered(value, ids)
            for key, value in part.items()
        }
    return [_renumbered(value, ids) for value in part] if isinstance(part, list) else part
