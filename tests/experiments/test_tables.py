"""Tables in a terminal: numbers are never cut at 60 columns, and at 100 the whole table is there."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from tests.experiments.fake_trials import campaign_of
from wayfarer.config.rover_file import laid_over, load_rover
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.experiments.campaign import Axis, Campaign
from wayfarer.experiments.measures import compare
from wayfarer.experiments.paper import FIELD_TRIALS, FORESTS, reported
from wayfarer.experiments.results import Results
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.sweep import Sweep
from wayfarer.experiments.tables import (
    NO_SPL,
    comparison_table,
    layouts_note,
    layouts_of_points,
    result_sentences,
    table_of,
)
from wayfarer.logview.terminal_table import TextTable, print_whole
from wayfarer.simhal.world.forest_file import read_forest_file

PLAIN = replace(campaign_of(1), rover=load_rover("sim"))
ROWS = [
    TrialRow(n, "x", n, 0, n, "escaped", 247.5 + n * 7 % 400, 1.0, 999.9 + n % 3, 888, 9, 39.9, 0.123)
    for n in range(998)
]
ROWS += [TrialRow(998, "x", 998, 0, 1, "left_bounds", 300.0), TrialRow(999, "x", 999, 0, 1, "entrapped", 999.0)]


def printed(table: TextTable, width: int = 140) -> str:
    text = io.StringIO()
    print_whole(Console(file=text, width=width), table)
    return text.getvalue()


def forests(rows: Mapping[str, Sequence[TrialRow]], **options: Any) -> TextTable:
    own = [row._replace(algorithm=name) for name, trials in rows.items() for row in trials]
    return table_of(Results(replace(PLAIN, algorithms=tuple(rows)), own), **options)


@pytest.mark.parametrize("width", [60, 80, 100, 140])
def test_no_number_is_cut_at_any_width(width: int) -> None:
    text = printed(forests(dict.fromkeys(CATALOGUE, ROWS)), width)
    assert "…" not in text
    assert all(len(line.rstrip()) <= width for line in text.splitlines())
    for figure in ("99.9 [99.4, 100.0]", "444.3 [437.1, 451.5]", "115.7", "0.123", "1000.9"):
        assert text.count(figure) == len(CATALOGUE), figure


def test_table_is_whole_at_100_columns_and_in_parts_at_60() -> None:
    assert printed(forests(dict.fromkeys(CATALOGUE, ROWS)), 100).count("algorithm") == 1
    assert printed(forests({"x": ROWS}), 60).count("algorithm") == 2


def test_others_that_are_alike_are_not_counted_out_of_themselves() -> None:
    def said(**times: float) -> str:
        rows = [row._replace(shortest_path_m=None, spl=None) for row in ROWS[:40]]
        own = [
            row._replace(algorithm=name, path_m=row.path_m and row.path_m * by)
            for name, by in times.items()
            for row in rows
        ]
        (_, differences) = result_sentences(Results(replace(PLAIN, algorithms=tuple(times)), own))
        return differences

    same = "The 2 others show no certain difference in success. "
    assert said(x=1.0, y=1.0, z=1.0) == same + "The 2 others show no certain difference in path."
    assert said(x=1.0, y=2.0, z=3.0).startswith(same + "The 2 others have a longer path (by ")
    both = r"Of the 2 others, 1 has a longer path \(by .*\), 1 shows no certain difference in path\."
    assert re.fullmatch(re.escape(same) + both, said(x=1.0, y=1.0, z=3.0))


def test_comparison_is_whole_at_100_columns() -> None:
    base = [each._replace(algorithm="forest-pledge") for each in ROWS]
    others = [each._replace(algorithm="retry-pledge", path_m=each.path_m and each.path_m * 0.5) for each in ROWS]
    table = comparison_table(compare([*base, *others]))
    text = printed(table, 100)
    assert len(text.splitlines()[0]) <= 100
    assert text.count("forest/noise") == 1
    assert printed(table, 60).count("-222.1 [-225.7, -218.5]") == text.count("-222.1 [-225.7, -218.5]") == 1


def test_row_is_a_list_under_its_name_if_not_even_one_column_fits() -> None:
    lines = printed(forests({"my_package.my_module:MyAlgorithm": ROWS}), 40).splitlines()
    assert lines[0] == "my_package.my_module:MyAlgorithm"
    assert "  success % [95 %]: 99.9 [99.4, 100.0]" in lines


def test_papers_row_is_below_ours_if_the_paper_has_one() -> None:
    lines = printed(forests(dict.fromkeys(("pledge", "cv-react"), ROWS))).splitlines()
    ours = next(number for number, line in enumerate(lines) if line.split()[:1] == ["pledge"])
    assert lines[ours + 1].split() == ["paper", "82.5", "30.8"]
    assert sum(line.strip().startswith("paper") for line in lines) == 1


def test_columns_of_what_never_happens_are_not_there() -> None:
    assert "faults" not in printed(forests({"x": ROWS}))
    assert "faults" in printed(forests({"x": [*ROWS, TrialRow(1000, "x", 1000, 0, 1, "fault")]}))
    unknown = [each._replace(shortest_path_m=None, spl=None) for each in ROWS]
    assert (NO_SPL in forests({"x": unknown}).notes, "SPL" in forests({"x": unknown}).titles) == (True, False)
    assert (NO_SPL in forests({"x": ROWS}).notes, "SPL" in forests({"x": ROWS}).titles) == (False, True)


def test_unknown_values_are_left_empty() -> None:
    text = printed(forests({"x": [TrialRow(0, "x", 0, 0, 1, "fault")]}, full=True))
    assert "None" not in text
    assert "nan" not in text


# -- the paper's row ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [
        {"slip_mean_m": 2.0}, {"budget_m": 100.0}, {"set": {"senses": "field"}},
        {"rover": load_rover("minirover")}, {"rover": laid_over(PLAIN.rover, {"vehicle": {"width_m": 0.5}})},
        {"rover": PLAIN.rover.with_anomaly_source("contact")}, {"faults": ("silent:compass@20",)},
        {"site": "extended-maze"}, {"site": "forest-escape", "rover": load_rover("minirover")},
    ],
    ids=str,
)  # fmt: skip
def test_paper_has_no_figures_of_what_it_did_not_run(change: dict[str, Any]) -> None:
    assert reported(replace(PLAIN, **change).settings()) == {}


def test_paper_has_figures_of_its_rover_in_its_forests_and_of_its_two_at_its_sites() -> None:
    assert reported(PLAIN.settings()) == reported(replace(PLAIN, seed=3, spl=True, trials=9).settings()) == FORESTS
    assert reported(replace(PLAIN, forests=read_forest_file("reference")).settings()) == FORESTS
    for site, rover in FIELD_TRIALS:
        there = Campaign(("levy-walk",), 1, load_rover(rover), site=site)
        assert reported(there.settings())["levy-walk"]["interventions"] == {"forestrover": 1.1, "minirover": 0.6}[rover]


# -- sweeps ------------------------------------------------------------------------------------------------------------


def sweep(key: str, values: list[Any], **change: Any) -> Results:
    campaign = replace(PLAIN, rover=load_rover("minirover"), **change)
    return Results(Sweep(campaign, (Axis(key, tuple(values)),)))


def test_points_at_a_site_met_the_same_layouts_only_if_they_have_the_same_room() -> None:
    widths = [0.2, 0.377, 0.6]
    layouts = layouts_of_points(sweep("vehicle.width_m", widths, site="extended-maze"))
    assert (layouts[0] == layouts[1], layouts[1] == layouts[2]) == (True, False)
    assert "vehicle.width_m=0.2 and vehicle.width_m=0.377; vehicle.width_m=0.6." in layouts_note(
        sweep("vehicle.width_m", widths, site="extended-maze")
    )
    assert len(set(layouts_of_points(sweep("footprint_m", [0.2, 0.6], site="extended-maze")))) == 2
    for same in (sweep("footprint_m", widths), sweep("escape.turn_angle_deg", [1, 2], site="extended-maze")):
        assert layouts_note(same).startswith("All points met the same layouts")
