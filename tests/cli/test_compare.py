from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from tests.experiments import fake_trials
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec


def out_at_once(spec: TrialSpec, log_dir: Path | None = None, /) -> TrialResult:
    """A trial that gets out, on a path that is a metre longer for each letter of its algorithm."""
    path_m = 40.0 + spec.seed % 1000 / 7 + len(spec.algorithm)
    return fake_trials.quick(spec)._replace(outcome="escaped", path_m=path_m, spl=37.5 / path_m)


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command in this process, with trials that end at once."""
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", out_at_once)
    return run


@pytest.fixture
def results(run: Run, tmp_path: Path) -> Path:
    folder = tmp_path / "results"
    asked = ("--algorithm", "pledge,forest-pledge,levy-pledge", "--trials", 6, "--jobs", 1, "--out", folder)
    assert run("sim", *asked)[0] == 0
    return folder


def told(out: str) -> list[list[str]]:
    """The rows of algorithms, by their words; in a sentence below the table the second word is "against"."""
    lines = [words for line in out.splitlines() if (words := line.split())[:1] and words[0].endswith("pledge")]
    return [words for words in lines if words[1] != "against"]


def test_each_algorithm_has_one_line_and_the_one_compared_with_comes_first(
    run: Run, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    code, out, err = run("compare", results)
    assert (code, err) == (0, "")
    lines = told(out)
    assert [line[0] for line in lines] == ["forest-pledge", "pledge", "levy-pledge"]


def test_a_path_that_is_two_metres_shorter_in_every_pair_is_told_as_such(
    run: Run, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    _, out, _ = run("compare", results, "--against", "forest-pledge")
    line = next(line for line in out.splitlines() if "levy-pledge" in line)
    assert "0, at most 50.0" in line, "no pair differs in success: at most 3 in 6 layouts"
    assert "-2.0 " in line
    assert "levy-pledge against forest-pledge: success the same in 6 pairs" in out


def test_first_algorithm_is_compared_with_where_none_is_named_and_forest_pledge_is_not_there(
    run: Run, tmp_path: Path
) -> None:
    asked = ("--algorithm", "levy-pledge,pledge", "--trials", 2, "--jobs", 1, "--out", tmp_path / "out")
    assert run("sim", *asked)[0] == 0
    assert "pledge against levy-pledge" in run("compare", tmp_path / "out")[1]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{results}", "--against", "levy-walk"], "no trial of 'levy-walk' to compare with; --against takes one of"),
        (["{results}/missing"], "no such folder; give one that `wayfarer sim --out` has filled"),
    ],
)
def test_what_cannot_be_compared_is_one_line(run: Run, results: Path, arguments: list[str], said: str) -> None:
    assert said in refusal(run, "compare", *(argument.format(results=results) for argument in arguments))
