from __future__ import annotations

import io
from dataclasses import replace

import pytest
from rich.console import Console

from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import AlgorithmSummary, summarise
from wayfarer.experiments.tables import print_table, spl_hint

ROWS = [TrialRow(n, "x", 0, 0, 1, "escaped", 247.5 + n % 400, 1.0, 999.9, 888, 9, 39.9, 0.123) for n in range(999)]
FULL = summarise("x", [*ROWS, TrialRow(999, "x", 0, 0, 1, "fault")])


def printed(summaries: list[AlgorithmSummary], width: int) -> str:
    text = io.StringIO()
    print_table(Console(file=text, width=width), summaries)
    return text.getvalue()


@pytest.mark.parametrize("width", [80, 100, 140])
def test_table_is_whole_at_every_width(width: int) -> None:
    summaries = [replace(FULL, algorithm=name) for name in ("forest-pledge", "levy-walk", "oo-react")]
    text = printed(summaries, width)
    assert "…" not in text
    assert all(len(line.rstrip()) <= width for line in text.splitlines())
    path = f"{FULL.path_mean_m:.1f} ± {FULL.path_sd_m:.1f}"
    for figure in ("99.9 [99.4, 100.0]", path, f"{FULL.path_median_m:.1f}", "0.123", "999.9", "888.0"):
        assert text.count(figure) == 3


def test_wide_console_shows_one_table_and_a_narrow_one_two() -> None:
    assert printed([FULL], 140).count("algorithm") == 1
    assert printed([FULL], 80).count("algorithm") == 2


def test_papers_row_stands_below_ours_where_the_paper_has_one() -> None:
    lines = printed([replace(FULL, algorithm=name) for name in ("pledge", "cv-react")], 140).splitlines()
    ours = next(number for number, line in enumerate(lines) if line.split()[:1] == ["pledge"])
    assert lines[ours + 1].split() == ["paper", "82.5", "±", "30.8"]
    assert sum("paper" in line for line in lines) == 1


def test_faults_have_a_column_only_when_there_are_any() -> None:
    assert "faults" in printed([FULL], 140)
    assert "faults" not in printed([summarise("x", ROWS)], 140)


def test_spl_has_a_column_only_where_it_is_known() -> None:
    unknown = summarise("x", [each._replace(shortest_path_m=None, spl=None) for each in ROWS])
    assert "SPL" not in printed([unknown], 140)
    assert "--spl" in spl_hint([unknown])
    assert "SPL" in printed([unknown, FULL], 140)
    assert spl_hint([unknown, FULL]) == ""


def test_unknown_values_are_left_empty() -> None:
    text = printed([summarise("x", [TrialRow(0, "x", 0, 0, 1, "fault")])], 140)
    assert "None" not in text
    assert "nan" not in text
