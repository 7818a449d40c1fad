"""The contact map in the report of a run: where it is laid on the map, and when it counts."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.views.run_report.logs import ARMED, HEADER, OUTCOME, by_time, data_of, drive, fix, simulated_drive
from tests.views.text.records import event
from wayfarer.fieldlog.schema import Record
from wayfarer.views.page.plots import plot
from wayfarer.views.run_report.memory import MOST, draw_memory, kept_maps
from wayfarer.views.run_report.track import Track, track_of


def contact_map(at_s: float, **changes: Any) -> Record:
    """What a rover remembers that drives to the north: a trunk two metres ahead of it, as wide to either side."""
    trunks = [[at_s + 2.0, -1.0, at_s + 2.0, 1.0, 0.5]]
    usual = {"ahead_m": at_s, "right_m": 0.0, "trunks": trunks, "way": [], "mode": "plan"}
    return event("contact_map", at_s, **usual | changes)


def trunks_of(track: Track) -> NDArray[np.float64]:
    """The trunks that are drawn: from and until when, and two ends, metres east and north."""
    map_ = plot("map", None, "map")
    draw_memory(map_, track)
    trunks, _way = (each for each in map_.renderers if each.name == "memory")
    data = trunks.data_source.data  # type: ignore[attr-defined]
    return np.column_stack([data[name] for name in ("t", "until", "x0", "y0", "x1", "y1")])


def test_memory_is_laid_at_the_rover_by_dead_reckoning_and_counts_until_the_next(tmp_path: Path) -> None:
    records = by_time(*drive(), contact_map(1.0), contact_map(2.0), contact_map(3.0, trunks=[]))
    track = track_of(data_of(tmp_path, HEADER, ARMED, *records, OUTCOME))
    here_m = [track.path.at(at_s)[1] for at_s in (1.0, 2.0)]
    assert trunks_of(track) == pytest.approx(np.array([
        [1.0, 2.0, -1.0, here_m[0] + 2.0, 1.0, here_m[0] + 2.0], [2.0, 3.0, -1.0, here_m[1] + 2.0, 1.0, here_m[1] + 2.0]
    ]), abs=1e-5)  # fmt: skip


def test_memory_is_laid_at_the_true_place_of_a_simulated_rover(tmp_path: Path) -> None:
    first, *rest = simulated_drive()
    track = track_of(data_of(tmp_path, first, *by_time(*rest, contact_map(2.0)), OUTCOME))
    assert trunks_of(track)[0] == pytest.approx([2.0, inf, 24.0, 12.5 + 3.0 + 2.0, 26.0, 12.5 + 3.0 + 2.0], abs=1e-5)


def test_memory_is_turned_and_stretched_as_the_path_is(tmp_path: Path) -> None:
    records = by_time(*drive(40.0), *(fix(at_s, 1.1 * at_s) for at_s in range(1, 40)), contact_map(20.0))
    track = track_of(data_of(tmp_path, HEADER, ARMED, *records, OUTCOME))
    assert track.fit is not None
    assert track.fit.stretched == pytest.approx(1.1, abs=0.03)
    *_, north_m = trunks_of(track)[0]
    assert north_m == pytest.approx(track.path.at(22.0)[1], abs=0.1), "where the path comes two seconds later"


def test_page_of_a_long_run_has_every_so_many_maps_and_the_last(tmp_path: Path) -> None:
    records = by_time(*drive(), *(contact_map(0.001 * count) for count in range(2 * MOST)))
    data = data_of(tmp_path, HEADER, ARMED, *records, OUTCOME)
    kept = kept_maps(data)
    assert len(kept) == MOST + 1
    assert kept[-1] is data.contact_maps[-1]
    assert not data.events[1:], "they would bury all others"
