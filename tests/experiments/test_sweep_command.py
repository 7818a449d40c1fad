from __future__ import annotations

import csv
from pathlib import Path

import pytest

from tests.experiments import fake_trials
from wayfarer.cli import run_trials
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Axis
from wayfarer.experiments.recorded import SETTINGS
from wayfarer.experiments.results import TRIALS, Results
from wayfarer.experiments.run import RunTrial, TrialRunner
from wayfarer.experiments.sweep import Sweep, make_sweep
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec

AXES = (Axis("escape.turn_angle_deg", (10, 30.5)), Axis("anomaly_source", ("motion", "contact")))
SMALL = make_sweep(fake_trials.campaign_of(6, "pledge", "levy-walk"), AXES)
EVERY = 2 * 2 * 2 * 6


def angle_matters(spec: TrialSpec) -> TrialResult:
    result = fake_trials.quick(spec)
    return result._replace(path_m=result.path_m + spec.rover.escape.turn_angle_deg)


def run(
    out: Path, sweep: Sweep = SMALL, *, resume: bool = False, jobs: int = 1, trial: RunTrial = angle_matters
) -> int:
    return run_trials.run_all(sweep, out, resume=resume, jobs=jobs, run_trial=trial)


def table(out: Path) -> list[dict[str, str]]:
    with (out / TRIALS).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_row_for_each_trial_has_the_swept_values_before_it(tmp_path: Path) -> None:
    assert run(tmp_path / "out") == 0
    rows = table(tmp_path / "out")
    keys = [(r["point"], r["escape.turn_angle_deg"], r["anomaly_source"], r["algorithm"], r["trial"]) for r in rows]
    assert keys == [
        (str(2 * a + s), angle, source, algorithm, str(trial))
        for a, angle in enumerate(("10", "30.5"))
        for s, source in enumerate(("motion", "contact"))
        for algorithm in ("pledge", "levy-walk")
        for trial in range(6)
    ]
    by_key = dict(zip(keys, rows, strict=True))
    further_m = [
        float(by_key["2", "30.5", "motion", "pledge", str(n)]["path_m"])
        - float(by_key["0", "10", "motion", "pledge", str(n)]["path_m"])
        for n in range(6)
    ]
    assert further_m == pytest.approx([20.5] * 6, abs=0.002)


@pytest.mark.process
def test_jobs_change_nothing(tmp_path: Path) -> None:
    assert run(tmp_path / "one") == run(tmp_path / "two", jobs=2) == 0
    assert (tmp_path / "one" / TRIALS).read_bytes() == (tmp_path / "two" / TRIALS).read_bytes()


def test_interrupted_sweep_goes_on_to_the_same_table(tmp_path: Path) -> None:
    assert run(tmp_path / "whole") == 0
    some, runner = Results(SMALL).missing()[5:30:3], TrialRunner(SMALL, run_trial=angle_matters)
    with Results.kept(SMALL, tmp_path / "out") as results:
        for task in some:
            results.add(runner(task).row)
    unfinished = tmp_path / "out" / TRIALS
    unfinished.write_text(unfinished.read_text()[:-9])  # the last line is torn
    asked: list[TrialSpec] = []

    def counted(spec: TrialSpec) -> TrialResult:
        asked.append(spec)
        return angle_matters(spec)

    assert run(tmp_path / "out", resume=True, trial=counted) == 0
    assert len(asked) == EVERY - len(some) + 1
    assert (tmp_path / "out" / TRIALS).read_bytes() == (tmp_path / "whole" / TRIALS).read_bytes()
    asked.clear()
    assert run(tmp_path / "out", resume=True, trial=counted) == 0
    assert asked == [], "what is finished is not run again"


def test_each_point_has_its_forests_although_algorithms_share_one() -> None:
    plan = make_sweep(fake_trials.campaign_of(2, "pledge", "levy-walk"), [Axis("sim.trees_per_ha", (40, 400))])
    met: list[tuple[int, int]] = []

    def remembered(spec: TrialSpec) -> TrialResult:
        met.append((spec.trial, len(spec.forest.trees_m)))
        return fake_trials.quick(spec)

    runner = TrialRunner(plan, run_trial=remembered)
    rows = [runner(task).row for task in Results(plan).missing()]
    assert met == [(trial, trees) for trial in range(2) for trees in (10, 100) for _ in range(2)]
    assert [row.point for row in rows] == [0, 0, 1, 1] * 2


@pytest.mark.parametrize(
    ("other", "difference"),
    [
        (make_sweep(SMALL.base, AXES[:1]), "axes.2.key is 'anomaly_source' there and None here"),
        (make_sweep(SMALL.base, AXES[::-1]), "axes.1.key is 'escape.turn_angle_deg' there and 'anomaly_source' here"),
        (make_sweep(SMALL.base, (Axis(AXES[0].key, (10, 31)), AXES[1])), r"axes.1.values is \[10, 30.5\] there"),
        (make_sweep(fake_trials.campaign_of(7, "pledge", "levy-walk"), AXES), "trials is 6 there and 7 here"),
    ],
)
def test_another_sweeps_folder_is_refused_by_its_first_difference(
    tmp_path: Path, other: Sweep, difference: str
) -> None:
    with Results.kept(SMALL, tmp_path):
        pass
    with pytest.raises(BadInput, match=f"belongs to another sweep: {difference}"):
        run(tmp_path, other, resume=True)


@pytest.mark.parametrize("damage", ["{}", "[]", '{"axes": [1]}', '{"axes": [], "campaign": 1}', "not json"])
def test_folder_without_a_sweeps_settings_is_refused(tmp_path: Path, damage: str) -> None:
    (tmp_path / SETTINGS).write_text(damage)
    with pytest.raises(BadInput, match=r"holds no campaign|belongs to another sweep"):
        run(tmp_path, resume=True)


def test_settings_say_what_the_campaign_has_without_a_sweep() -> None:
    angle, source = SMALL.settings()["axes"]
    assert angle == {"key": "escape.turn_angle_deg", "values": [10, 30.5], "now": 30.0}
    assert source["now"] == "motion"
