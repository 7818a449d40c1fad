"""The paper's figure: a file with text as text, of the table's numbers, and the same bytes each time."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from matplotlib.patches import Rectangle

from tests.conftest import Run, refusal
from tests.reports.campaigns import ALGORITHMS, STRANGERS, row, rows_of
from wayfarer.experiments.measures import summarise
from wayfarer.experiments.results import Results
from wayfarer.logview import palette
from wayfarer.reports.paper_figure import paper_figure, write_paper_figure

SAMPLE = next(each for each in sorted((Path(__file__).parents[2] / "field_logs").iterdir()) if each.is_dir())


@pytest.fixture(scope="module")
def results(finished: Path) -> Results:
    return Results.open(finished)


def of(results: Results, *names: str, **changes: Any) -> Results:
    """Results of these algorithms, with as many failures as places before them, of 40 trials each."""
    rows = [each._replace(**changes) for own in rows_of(names).values() for each in own]
    return Results(replace(results.plan.base, algorithms=names), rows)


def summary(results: Results, name: str) -> dict[str, Any]:
    return summarise(name, results.by_algorithm[name])


def test_boxes_bars_and_line_are_those_of_the_rows(results: Results) -> None:
    shown = of(results, "levy-walk", "forest-pledge", STRANGERS[1])
    boxes, bars = paper_figure(shown).axes
    assert [text.get_text() for text in boxes.get_xticklabels()] == ["forest-pledge", "levy-walk", STRANGERS[1]]
    assert [text.get_text() for text in boxes.texts] == ["Pledge-inspired", "Stochastic", "Others"]
    drawn = [bar.get_height() for bar in bars.patches if isinstance(bar, Rectangle)]
    assert drawn == pytest.approx([100.0 - summary(shown, name)["success_percent"] for name in
                                   ("forest-pledge", "levy-walk", STRANGERS[1])])  # fmt: skip
    assert drawn == pytest.approx([2.5, 0.0, 5.0])
    medians = [line.get_ydata()[0] for line in boxes.lines if line.get_linewidth() == 1.6]  # type: ignore[index]
    assert medians == pytest.approx([summary(shown, name)["path_median_m"] for name in
                                     ("forest-pledge", "levy-walk", STRANGERS[1])])  # fmt: skip
    level, *between = [line for line in boxes.lines if line.get_linestyle() == "--"]
    assert (level.get_color(), list(level.get_ydata())) == (palette.RED, [39.0, 39.0])  # type: ignore[arg-type]
    assert [list(line.get_xdata()) for line in between] == [[0.5, 0.5], [1.5, 1.5]]  # type: ignore[arg-type]


def test_line_is_the_straight_one_where_no_shortest_path_is_known(results: Results) -> None:
    def legend(shown: Results) -> list[str]:
        return [text.get_text() for text in paper_figure(shown).legends[0].get_texts()]

    failed = "did not get out (right axis)"
    assert legend(results) == ["shortest distance, 38.8 m (mean shortest path)", failed]
    rows = [each._replace(shortest_path_m=None) for each in results.rows]
    unknown = Results(results.plan, rows, results.folder)
    assert legend(unknown) == ["shortest distance, 37.5 m (a straight line)", failed]
    assert legend(of(results, *STRANGERS, shortest_path_m=None)) == [failed], "code of others is not imported for it"


@pytest.mark.parametrize("ended", [("escaped", 80.0), ("entrapped", 1000.0), ("fault", None)])
def test_campaign_of_one_trial_is_drawn_without_a_warning(
    results: Results, tmp_path: Path, ended: tuple[str, float | None]
) -> None:
    one = replace(results.plan.base, algorithms=("pledge",))
    write_paper_figure(Results(one, [row("pledge", 0, *ended)], results.folder), tmp_path / "one.svg")
    assert ">pledge<" in (tmp_path / "one.svg").read_text()


def test_text_is_text_and_a_name_is_no_formula(results: Results, tmp_path: Path) -> None:
    names = (r"a$\bad{$", "_mine:Own")
    shown = of(results, *names)
    for name in ("figure.svg", "figure.pdf", "FIGURE.PNG"):
        write_paper_figure(shown, tmp_path / name)
    texts = re.findall(r"<text[^>]*>([^<]+)</text>", (tmp_path / "figure.svg").read_text())
    assert {*names, "path to the destination line, m", "trials that did not get out, %"} <= set(texts)
    pdf = (tmp_path / "figure.pdf").read_bytes()
    assert b"/FontFile2" in pdf, "TrueType"
    assert b"/Subtype /Type3" not in pdf
    assert (tmp_path / "FIGURE.PNG").read_bytes().startswith(b"\x89PNG")


def test_same_results_give_the_same_bytes_whatever_style_a_reader_has(results: Results, tmp_path: Path) -> None:
    for ending in ("svg", "pdf", "png"):
        write_paper_figure(results, tmp_path / f"a.{ending}")
        with mpl.rc_context({"font.size": 20.0, "svg.fonttype": "path"}):
            write_paper_figure(results, tmp_path / f"b.{ending}")
            assert mpl.rcParams["font.size"] == 20.0, "it is left as it was"
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes(), ending


def test_command_draws_the_figure_and_no_page(run: Run, finished: Path, tmp_path: Path) -> None:
    before, out = sorted(finished.iterdir()), tmp_path / "figure.svg"
    assert run("report", finished, "--figure", out) == (0, f"the figure is {out}\n", f"Next: xdg-open {out}\n")
    assert all(name in out.read_text() for name in ALGORITHMS)
    assert sorted(finished.iterdir()) == before


def test_what_cannot_be_drawn_is_one_line(run: Run, finished: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for what, figure, said in (
        (finished, "a.jpg", r"a\.jpg: expected a name that ends in \.pdf, \.svg or \.png"),
        (finished, "file/a.pdf", r"a\.pdf cannot be written: Not a directory"),
        (SAMPLE, "a.pdf", r"--figure draws a campaign, and \S+ is none"),
        (tmp_path, "a.pdf", r"--figure draws a campaign, and \S+ is none"),
    ):
        assert re.search(said, refusal(run, "report", what, "--figure", tmp_path / figure))
    for other in ("--out=a.html", "--gallery=3", "--jobs=2"):
        assert "do not go together" in refusal(run, "report", finished, "--figure", tmp_path / "a.pdf", other)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
