"""What commands print on a terminal of 60 and of 80 columns: whole, and on lines that fit."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.test_compare import out_at_once
from tests.conftest import Run
from wayfarer import cli

FIELD_LOGS = Path(cli.__file__).parents[2] / "field_logs"


@pytest.fixture
def results(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Results of the two algorithms with the longest names, with paths that differ by 200 m."""

    def far_apart(*arguments: object) -> object:
        result = out_at_once(*arguments)  # type: ignore[arg-type]
        return result._replace(path_m=200.0 + result.path_m * (7.0 if result.algorithm == "retry-pledge" else -1.0))

    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", far_apart)
    asked = ("--algorithm", "forest-pledge,retry-pledge", "--trials", 6, "--jobs", 1, "--out", tmp_path / "results")
    assert run("sim", *asked)[0] == 0
    return tmp_path / "results"


@pytest.mark.parametrize(
    "arguments",
    [
        ("sim", "--algorithm", "retry-pledge,levy-walk", "--trials", 8, "--jobs", 1),
        ("sim", "--site", "dense-obstruction", "--rover", "forestrover", "--trials", 4, "--jobs", 1),
        ("sweep", "escape.turn_angle_deg=60,90", "ground=leaf-litter,mud", "--rover", "forestrover", "--algorithm",
         "retry-pledge", "--trials", 2, "--jobs", 1, "--out", "sweep"),
        ("sweep", "sim.compass_noise_deg=0:20:10", "escape.probe_straight_m=1", "--trials", 2, "--jobs", 1,
         "--out", "sweep"),
        ("compare", "results"),
        ("list",),
        ("list", "--conditions"),
        ("list", "--faults"),
        ("logs", "summary", "--log-dir", FIELD_LOGS),
    ],
    ids=lambda arguments: " ".join(map(str, arguments[:2])),
)  # fmt: skip
@pytest.mark.parametrize("columns", ["80", "0", ""])
def test_output_fits_80_columns_and_nothing_is_cut_off(
    run: Run, results: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[object, ...], columns: str
) -> None:
    """A width of 0, as some terminals and services have it, is none."""
    monkeypatch.chdir(results.parent)
    monkeypatch.setenv("COLUMNS", columns)
    code, out, err = run(*arguments)
    assert code == 0, err
    assert len(out.splitlines()) > 3
    assert [line for line in out.splitlines() if len(line) > 80 or "…" in line] == []
