"""The report of a sweep: what it draws, what it says, and what it refuses."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bokeh.models.annotations import Span

from tests.experiments import fake_trials
from tests.reports.campaigns import STRANGERS
from tests.reports.outline import Outline
from tests.reports.reading_plots import columns
from wayfarer import cli
from wayfarer.cli.run_trials import run_all
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Axis
from wayfarer.experiments.results import TRIALS, Results
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.sweep import Sweep, make_sweep
from wayfarer.reports.page.plots import Figure, Plots
from wayfarer.reports.sweep import Grid, curves_figures, maps_figures, write_sweep_report

ANGLES = Axis("escape.turn_angle_deg", (50, 10, 30))
SLIPS = Axis("slip_mean_m", (2, 10))
IN_A_FOREST = ["success, %", "SPL", "path, m", "time to escape, s"]
WORDS = Axis("anomaly_source", ("motion", "contact"))


def results_of(*axes: Axis, algorithms: tuple[str, ...] = ("pledge",), spl: bool = True) -> Grid:
    """At point p 8 - p of 8 trials escape, each on 60 + 10 p metres; the rest end entrapped."""
    sweep = make_sweep(fake_trials.campaign_of(8, *algorithms), axes)
    rows = []
    for task in Results(sweep).missing():
        out = task.trial >= task.point
        path_m = 60.0 + 10 * task.point + task.trial if out else 1000.0
        shortest_m, share = (36.0, 36.0 / path_m if out else 0.0) if spl else (None, None)
        row = TrialRow(task.trial, task.algorithm, task.trial, 0, 1, "escaped" if out else "entrapped", path_m)
        rows.append(row._replace(time_s=2.0 * path_m, shortest_path_m=shortest_m, spl=share, point=task.point))
    return Grid(Results(sweep, rows))


def drawn(figures: Iterator[Figure]) -> list[Any]:
    """Return the figures; Bokeh must be able to write them."""
    made, plots = list(figures), Plots()
    for figure in made:
        plots.place(figure)
    assert plots.to_json()
    return made


def test_curves_show_what_the_rows_say_in_the_order_of_the_values() -> None:
    success, spl, path, time = drawn(curves_figures(results_of(ANGLES)))
    assert columns(success, "pledge")["x"] == [10, 30, 50]
    assert columns(success, "pledge")["value"] == pytest.approx([87.5, 75.0, 100.0])
    assert columns(success, "pledge")["text"][0] == "87.5 [52.9, 97.8]"
    assert [line.location for line in success.select(Span)] == [30], "the value without a sweep"
    assert columns(path, "pledge")["value"] == pytest.approx([74.0, 84.5, 63.5])
    assert columns(time, "pledge")["value"] == pytest.approx([148.0, 169.0, 127.0])
    assert np.all(np.diff(np.array(columns(spl, "pledge")["value"])[[1, 0, 2]]) > 0)


@pytest.mark.parametrize("axis", [ANGLES, WORDS], ids=["numbers", "words"])
@pytest.mark.parametrize("spl", [True, False])
def test_curves_are_of_every_algorithm_and_of_what_is_known(axis: Axis, spl: bool) -> None:
    algorithms = ("pledge", "levy-walk", *STRANGERS)
    figures = drawn(curves_figures(results_of(axis, algorithms=algorithms, spl=spl)))
    assert [figure.title.text for figure in figures] == [title for title in IN_A_FOREST if spl or title != "SPL"]
    assert len({id(figure.x_range) for figure in figures}) == 1, "zoomed together"
    for figure in figures:
        assert all(len(columns(figure, name)["x"]) == len(axis.values) for name in algorithms)


def test_maps_put_each_point_where_its_keys_are() -> None:
    success, *_ = drawn(maps_figures(results_of(ANGLES, SLIPS, algorithms=("pledge", "levy-walk")), "levy-walk"))
    cells = columns(success, "cells")
    assert cells["value"] == pytest.approx([100.0, 87.5, 75.0, 62.5, 50.0, 37.5])
    assert list(zip(cells["x"], cells["y"], strict=True)) == [(x, y) for y in range(3) for x in range(2)]
    assert (cells["right"][:2], cells["up"][::2]) == (["2", "10"], ["50", "10", "30"])
    assert success.xaxis[0].major_label_overrides == {0: "2", 1: "10"}
    assert success.yaxis[0].major_label_overrides == {0: "50", 1: "10", 2: "30"}


@pytest.mark.parametrize("spl", [True, False])
@pytest.mark.parametrize("values", [2, 8, 40])
def test_maps_of_many_values_name_some(spl: bool, values: int) -> None:
    axis = Axis("escape.turn_angle_deg", tuple(range(6, 2 * values + 5, 2)))
    figures = drawn(maps_figures(results_of(SLIPS, axis, spl=spl), "pledge"))
    assert len(figures) == len(IN_A_FOREST) - (not spl)
    assert all(len(figure.xaxis[0].major_label_overrides) <= 8 for figure in figures)


def test_change_is_taken_trial_by_trial_and_only_in_the_same_layouts() -> None:
    swept = results_of(ANGLES)
    assert swept.now == 2
    assert swept.change(2, "pledge") is None
    change = swept.change(1, "pledge")
    assert change is not None
    gains = [(36 / (70 + n) if n else 0.0) - (36 / (80 + n) if n > 1 else 0.0) for n in range(8)]
    assert change[::4] == pytest.approx((np.mean(gains), 8))
    at_site = replace(swept.results.plan.base, site="extended-maze")
    grid = Grid(Results(Sweep(at_site, (Axis("vehicle.width_m", (0.2, 0.4, 0.6), 0.6),)), swept.results.rows))
    assert [grid.change(point, "pledge") for point in range(3)] == [None] * 3


@pytest.mark.parametrize("axes", [(ANGLES,), (ANGLES, SLIPS)], ids=["curves", "maps"])
def test_page_is_whole_and_the_same_each_time(
    tmp_path: Path, axes: tuple[Axis, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = make_sweep(fake_trials.campaign_of(3, "pledge", "levy-walk"), axes)
    run_all(sweep, tmp_path, run_trial=fake_trials.quick)
    assert cli.run(["report", str(tmp_path)]) == 0
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    page = Outline(text)
    assert page.tags["figure"] == 2 * len(axes), "two algorithms on two keys; none escapes, so there is no path"
    assert page.tags["tr"] == 1 + 2 * (1 + len(sweep.points))
    assert page.links == []
    assert "escape.turn_angle_deg" in text
    write_sweep_report(Results.open(tmp_path))
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == text


def test_unfinished_and_damaged_sweeps_are_told(tmp_path: Path) -> None:
    sweep = make_sweep(fake_trials.campaign_of(3), [SLIPS])
    run_all(sweep, tmp_path, run_trial=fake_trials.quick)
    whole = (tmp_path / TRIALS).read_text()
    rows = Results.open(tmp_path).rows
    assert [(row.point, row.trial) for row in rows] == [(p, n) for p in range(2) for n in range(3)]
    (tmp_path / TRIALS).write_text(whole.rpartition("\n1,")[0] + "\n")
    with pytest.raises(BadInput, match="is not finished, it has 5 of 6 trials"):
        Results.open(tmp_path)
    assert "<p>Unfinished: 5 of 6 trials." in write_sweep_report(Results.open(tmp_path, unfinished=True)).read_text()
    (tmp_path / TRIALS).write_text(whole.partition("\n1,")[0] + "\n")
    assert "<p>Unfinished: 3 of 6 trials." in write_sweep_report(Results.open(tmp_path, unfinished=True)).read_text()
    (tmp_path / TRIALS).unlink()
    with pytest.raises(BadInput, match="none of its 6 trials has ended yet"):
        write_sweep_report(Results.open(tmp_path, unfinished=True))
    (tmp_path / "campaign.json").write_text('{"axes": [1]}')
    with pytest.raises(BadInput, match=r"campaign\.json is damaged: "):
        Results.open(tmp_path)


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ([{"values": [*range(10_000)]}] * 2, r"100,000,000 trials, allowed are 1,000,000"),
        ([{"values": [2, math.nan]}], r"axes\.0\.values\.1"),
        ([{"values": [2, 10**400]}], r"axes\.0\.values\.1"),
        ([{"now": -1e300}], r"axes\.0\.now"),
    ],
)
def test_sweep_that_nobody_has_run_is_refused(tmp_path: Path, axes: list[dict[str, Any]], said: str) -> None:
    settings = make_sweep(fake_trials.campaign_of(1), [SLIPS]).settings()
    settings["axes"] = [settings["axes"][0] | axis for axis in axes]
    (tmp_path / "campaign.json").write_text(json.dumps(settings))
    with pytest.raises(BadInput, match=rf"campaign\.json is damaged: .*{said}"):
        Results.open(tmp_path)
