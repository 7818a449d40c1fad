"""Figures for papers: vector files with text, of the page's numbers, and the same bytes each time."""

from __future__ import annotations

import re
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import pytest

from tests.conftest import Run, refusal
from tests.experiments.report.campaigns import ALGORITHMS
from wayfarer.experiments.report.load_results import read_results
from wayfarer.experiments.report.paper_figures import STYLE, WIDTHS_IN, escape_curves_figure, write_figures
from wayfarer.experiments.tables import number_text


@pytest.fixture(scope="module")
def figures(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("figures") / "new"
    write_figures(read_results(finished), folder)
    return folder


def test_each_figure_is_there_for_one_column_and_two(figures: Path) -> None:
    names = {f"{name}-{columns}" for name in ("escape-curves", "paths", "comparison") for columns in WIDTHS_IN}
    assert {path.name for path in figures.iterdir()} == {f"{name}.{form}" for name in names for form in ("svg", "pdf")}
    for columns, width_in in WIDTHS_IN.items():
        svg = (figures / f"paths-{columns}.svg").read_text()
        assert f'width="{72 * width_in:g}pt"' in svg


def test_text_is_text_and_says_the_numbers_of_the_table(figures: Path, finished: Path) -> None:
    texts = re.findall(r"<text[^>]*>([^<]+)</text>", (figures / "escape-curves-1col.svg").read_text())
    for name, summary in read_results(finished).summaries.items():
        assert f"{name}, {number_text(summary.success_percent)} %" in texts
    pdf = (figures / "comparison-2col.pdf").read_bytes()
    assert b"/Type /FontDescriptor" in pdf
    assert b"/FontFile2" in pdf, "TrueType"
    assert b"/Subtype /Type3" not in pdf


def test_same_results_give_the_same_bytes_whatever_style_a_reader_has(
    figures: Path, finished: Path, tmp_path: Path
) -> None:
    with mpl.rc_context({"font.size": 20.0, "svg.fonttype": "path"}):
        written = write_figures(read_results(finished), tmp_path)
        assert mpl.rcParams["font.size"] == 20.0, "it is left as it was"
    for path in written:
        assert path.read_bytes() == (figures / path.name).read_bytes(), path.name


def test_figures_of_a_run_and_a_folder_that_is_a_file_are_refused(run: Run, finished: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert "is a file" in refusal(run, "report", finished, "--figures", tmp_path / "file")
    log = Path(__file__).resolve().parents[3] / "field_logs"
    first = next(each for each in sorted(log.iterdir()) if each.is_dir())
    assert "--figures draws a campaign" in refusal(run, "report", first, "--figures", tmp_path / "new")
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


def test_curves_and_rows_are_of_every_algorithm(figures: Path) -> None:
    for name in ("paths", "escape-curves"):
        svg = (figures / f"{name}-2col.svg").read_text()
        assert all(algorithm in svg for algorithm in ALGORITHMS), name


def test_name_of_an_algorithm_is_no_formula_and_stands_in_the_legend(finished: Path) -> None:
    results, names = read_results(finished), (r"a$\bad{$", "_mine:Own")
    settings = results.settings.model_copy(update={"algorithms": list(names)})
    odd = replace(results, settings=settings, rows=[results.rows[0]._replace(algorithm=name) for name in names])
    file = BytesIO()
    with mpl.rc_context(dict(STYLE)):
        escape_curves_figure(odd, WIDTHS_IN["1col"]).savefig(file, format="svg")
    assert all(f">{name}, ".encode() in file.getvalue() for name in names)
