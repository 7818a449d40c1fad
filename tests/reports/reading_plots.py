"""What a figure shows, read out of its models."""

from __future__ import annotations

from typing import Any

from bokeh.models.annotations import Legend

from wayfarer.reports.page.plots import Figure


def columns(figure: Figure, name: str) -> dict[str, list[Any]]:
    """Return what the renderer of this name draws, by column."""
    renderer: Any
    (renderer,) = (each for each in figure.renderers if each.name == name)
    return {column: list(values) for column, values in renderer.data_source.data.items()}


def legend(figure: Figure) -> list[str]:
    """Return the texts of a figure's legend."""
    found: Any
    (found,) = figure.select(Legend)
    return [item.label.value for item in found.items]


def names_of_rows(figure: Figure) -> list[str]:
    """Return the names beside the rows, from the top."""
    texts: Any = figure.yaxis[0].major_label_overrides
    return [texts[y] for y in sorted(texts)]
