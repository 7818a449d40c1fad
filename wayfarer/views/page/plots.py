"""Bokeh figures in the style of all pages, and their place in a page.

Axes, grids and texts take their colours from the variables ``--bk-...`` of ``page.css``, so they follow a dark page.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Literal

from bokeh.document import Document
from bokeh.models import BoxZoomTool, HoverTool, Model, PanTool, ResetTool, SaveTool, Tool, WheelZoomTool
from bokeh.models.renderers import GlyphRenderer
from bokeh.models.tools import Drag
from bokeh.plotting import figure

TEXT = "11px"
Figure = figure


def plot(name: str, height_px: int | None, tools: Sequence[Tool], **settings: Any) -> Figure:
    """Return an empty figure as wide as its place. ``name`` is how a script of the page finds it.

    ``settings`` are further properties of ``bokeh.plotting.figure``.
    """
    made = figure(
        name=name,
        height=height_px,
        tools=[*tools, SaveTool(filename=name)],
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        lod_threshold=None,  # a line of few points would be drawn coarsely while it is dragged
        min_border_right=12,
        **{"sizing_mode": "stretch_width"} | settings,
    )
    made.toolbar.logo = None
    made.toolbar.active_drag = next((tool for tool in tools if isinstance(tool, Drag)), None)  # else it is always pan
    made.axis.axis_label_text_font_size = made.axis.major_label_text_font_size = TEXT
    made.axis.axis_label_text_font_style = "normal"
    made.axis.minor_tick_line_color = None
    return made


def zoom_tools(dimensions: Literal["width", "both"] = "both", *, same_scale: bool = True) -> list[Tool]:
    """Return zoom by a box and by Ctrl and the wheel (the wheel alone scrolls the page), pan, and reset.

    The first is what dragging does at first. With ``both`` dimensions at the ``same_scale``, of a map, that is pan.
    """
    is_map = dimensions == "both" and same_scale
    pan, box = PanTool(dimensions=dimensions), BoxZoomTool(dimensions=dimensions, match_aspect=is_map)
    dragging = [pan, box] if is_map else [box, pan]
    return [*dragging, WheelZoomTool(dimensions=dimensions, modifiers={"ctrl": True}), ResetTool()]


def layer(name: str, *renderers: GlyphRenderer[Any]) -> None:
    """Let the page's box for a layer (``html.layers``) show and hide what was drawn."""
    for renderer in renderers:
        renderer.tags = [*renderer.tags, f"layer:{name}"]


def hover(renderers: Sequence[GlyphRenderer[Any]], *rows: tuple[str, str], **settings: Any) -> HoverTool:
    """Return a box that tells what is under the pointer: names, and values as ``@column{0.0} unit``."""
    return HoverTool(renderers=list(renderers), tooltips=list(rows), visible=False, **settings)


class Plots:
    """The models of one page, in the order in which they were placed."""

    def __init__(self) -> None:
        self._document = Document()

    def place(self, model: Model) -> str:
        """Return the element in which the browser draws a model."""
        self._document.add_root(model)
        return f'<div class="plot" id="plot-{len(self._document.roots)}"></div>'

    def to_json(self) -> str:
        """Return what ``page.js`` needs to draw them.

        The same models give the same text: Bokeh counts its ids through the life of a process, a page from 1.
        """
        ids: dict[str, str] = {}
        content = _renumbered(self._document.to_json(deferred=False), ids)
        places = {ids[root.id]: f"plot-{at}" for at, root in enumerate(self._document.roots, start=1)}
        return json.dumps({"document": content, "places": places}, separators=(",", ":"))


def _renumbered(part: Any, ids: dict[str, str]) -> Any:
    """Return a part of a document with the ids of models, and what refers to them, counted from 1."""
    if isinstance(part, dict):
        return {
            key: ids.setdefault(value, f"p{len(ids) + 1}") if key == "id" else _renumbered(value, ids)
            for key, value in part.items()
        }
    return [_renumbered(value, ids) for value in part] if isinstance(part, list) else part
