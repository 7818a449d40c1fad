"""What an algorithm with a memory remembered of the wood, for the map and the cursor: all of it, and when it was so."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, pairwise
from math import inf
from typing import Any

import numpy as np
from bokeh.models import CDSView, IndexFilter

from wayfarer.fieldlog.contact_map import ContactMapNoted
from wayfarer.views import palette
from wayfarer.views.page.html import PlotLayer
from wayfarer.views.page.plots import Figure, layer, source
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.track import Track

MOST = 300  # maps of a run; of more every so many are in the page, and the last: some 200 kB
LAYER = PlotLayer("memory", "contact map", palette.REMEMBERED)
TRUNK: dict[str, Any] = {"line_width": 5, "line_cap": "round", "line_alpha": "alpha"}
WAY: dict[str, Any] = {"line_width": 2.5, "line_dash": [3, 5]}

Row = tuple[complex, complex, float]  # two ends, metres east + 1j * metres north from the rover, and the belief


def kept_maps(data: RunData) -> Sequence[ContactMapNoted]:
    """Return the maps of a run that its page has, in their order."""
    every = max(1, -(-len(data.contact_maps) // MOST))
    return [*data.contact_maps[:-1:every], *data.contact_maps[-1:]]


def draw_memory(map_: Figure, track: Track) -> None:
    """Draw what was remembered at any time, and let the page's cursor choose the time: nothing is seen before."""
    maps = kept_maps(track.data)
    _draw(map_, track, [(each, list(_trunks(each))) for each in maps], **TRUNK)
    _draw(map_, track, [(each, list(_way(each))) for each in maps], **WAY)


def _draw(map_: Figure, track: Track, rows: Sequence[tuple[ContactMapNoted, Iterable[Row]]], **look: Any) -> None:
    """Draw rows as lines; from where and until when each counts is for ``cursor.js``."""
    ends_s = [*(noted.elapsed_s for noted, _ in rows[1:]), inf]
    found = list(chain.from_iterable(_laid(track, *each, end_s) for each, end_s in zip(rows, ends_s, strict=False)))
    columns = zip(("t", "until", "x0", "y0", "x1", "y1", "alpha"), np.array(found).reshape(-1, 7).T, strict=True)
    view = CDSView(filter=IndexFilter(indices=[]))
    drawn = map_.segment(
        "x0", "y0", "x1", "y1", source=source(**dict(columns)), view=view, line_color=palette.REMEMBERED, **look
    )
    drawn.name = "memory"
    layer(LAYER.name, drawn)


def _laid(track: Track, noted: ContactMapNoted, rows: Iterable[Row], end_s: float) -> Iterator[tuple[float, ...]]:
    """Yield rows from where the path has the rover then, turned as the path is."""
    here_m = complex(*track.path.at(noted.elapsed_s))
    factor = track.fit.factor if track.fit and track.reckoned is None else 1.0
    for *ends, belief in rows:
        first_m, last_m = (here_m + factor * end for end in ends)
        ends_m = first_m.real, first_m.imag, last_m.real, last_m.imag
        yield noted.elapsed_s, end_s, *ends_m, palette.opacity(belief)


def _trunks(noted: ContactMapNoted) -> Iterator[Row]:
    for east0_m, north0_m, east1_m, north1_m, belief in noted.trunks_from((0.0, 0.0)):
        yield complex(east0_m, north0_m), complex(east1_m, north1_m), belief


def _way(noted: ContactMapNoted) -> Iterator[Row]:
    for first_m, last_m in pairwise(noted.way_from((0.0, 0.0))):
        yield complex(*first_m), complex(*last_m), 1.0
