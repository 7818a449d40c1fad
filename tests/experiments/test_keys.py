"""``--set``: keys that are set or drawn for each trial, what is kept and told of them, and what is refused."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import Run, refusal
from tests.experiments.fake_trials import campaign_of
from tests.simhal.commands import facts_of, succeed
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Task
from wayfarer.experiments.checks import make_campaign
from wayfarer.experiments.keys import current, descriptions, replace_set
from wayfarer.experiments.results import Results
from wayfarer.simhal.world.physics import FIELD, PHYSICS

SIM = ("sim", "--jobs", "1", "--trials", "1", "--budget-m", "5")
BLIND = (*SIM, "--set", "sim.blind_share=0.3", "--set", "sim.blind_quality=0.4")


def with_keys(*texts: str, **settings: Any) -> Any:
    return make_campaign({"set": texts, **settings}, "--{}".format)


def test_named_senses_and_single_errors_go_together_and_the_single_one_counts() -> None:
    field = replace(PHYSICS, **FIELD)
    assert with_keys("senses=ideal").fixed.physics == PHYSICS
    assert with_keys("senses=field").fixed.physics == field
    assert with_keys("sim.compass_lag_s=0", "senses=field").fixed.physics == replace(field, compass_lag_s=0.0)


@pytest.mark.process  # MuJoCo's first import starts one
def test_every_key_that_is_a_number_can_be_drawn_about_what_it_is_now() -> None:
    for physics in ("light", "mujoco"):
        for key, now in current(make_campaign({"physics": physics})).items():
            if isinstance(now, int | float) and not isinstance(now, bool):
                try:
                    campaign = make_campaign({"physics": physics, "set": {key: (now, now + 1e-6)}})
                except BadInput as error:
                    assert any(each in str(error) for each in ("effect", "allowed", "integer")), key
                else:
                    (value,) = campaign.drawn(3).values()
                    assert now <= value <= now + 2e-5 * abs(now) + 1e-6, key


def test_drawn_values_reach_what_a_trial_is_made_of() -> None:
    campaign = with_keys(
        "sim.slope_deg=5:10", "slip_mean_m=2:4", "budget_m=300:400", "sim.trees_per_ha=100:200",
        "escape.turn_angle_deg=20:40", "progress.anomalies_max=3:9", trials=8,
    )  # fmt: skip
    trees = set()
    for trial in range(8):
        drawn = campaign.drawn(trial)
        spec = campaign.spec(Task("forest-pledge", trial), campaign.make_forest(trial))
        assert spec.drawn == drawn
        assert spec.physics == replace(PHYSICS, slope_deg=drawn["sim.slope_deg"], slip_mean_m=drawn["slip_mean_m"])
        assert (spec.budget_m, spec.rover.escape.turn_angle_deg) == (drawn["budget_m"], drawn["escape.turn_angle_deg"])
        assert spec.rover.progress.anomalies_max == drawn["progress.anomalies_max"] in range(3, 10)
        trees.add(len(spec.forest.trees_m))
    assert len(trees) > 1


def test_another_drawn_key_changes_nothing_for_the_first() -> None:
    alone, both = with_keys("sim.slope_deg=0:15"), with_keys("sim.compass_bias_deg=-9:9", "sim.slope_deg=0:15")
    assert [alone.drawn(n)["sim.slope_deg"] for n in range(9)] == [both.drawn(n)["sim.slope_deg"] for n in range(9)]
    biases = [both.drawn(n)["sim.compass_bias_deg"] for n in range(50)]
    assert -9 <= min(biases) < -7 < 7 < max(biases) <= 9


def test_what_is_fixed_and_an_option_too_is_kept_as_the_option() -> None:
    campaign = with_keys("slip_mean_m=3", "ground=mud", "sim.slope_deg=4:4.0")
    assert (campaign.slip_mean_m, campaign.ground, campaign.set) == (3, "mud", {"sim.slope_deg": 4})


def test_numbers_of_numpy_are_numbers() -> None:
    campaign = make_campaign({"trials": np.int64(7), "set": {"sim.slope_deg": np.array([1.0, 2.0], dtype=np.float32)}})
    assert (campaign.trials, campaign.ranges) == (7, {"sim.slope_deg": (1.0, 2.0)})
    assert json.loads(json.dumps(campaign.settings()))["set"] == {"sim.slope_deg": [1.0, 2.0]}


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        ("sim.blind_shar=0.3", "unknown key 'sim.blind_shar': did you mean sim.blind_share"),
        ("blind_share", r"--set blind_share: write KEY=VALUE, or KEY=LOW:HIGH"),
        ("senses=feild", "unknown value of the key senses 'feild': did you mean field"),
        ("sim.blind_share=2", r"key 'sim.blind_share' = 2: .* allowed is 0 to 1"),
        ("sim.blind_share=much", "key 'sim.blind_share' = 'much': input should be a valid number"),
        ("sim.blind_share=nan", "key 'sim.blind_share' = 'nan'"),
        ("sim.blind_share=0.1:2", r"key 'sim.blind_share' = 2.0: .* allowed is 0 to 1"),
        ("sim.slope_deg=15:0", r"--set sim.slope_deg = '15:0': expected a value, or LOW:HIGH .* LOW first"),
        ("sim.slope_deg=1 sim.slope_deg=2", "--set sim.slope_deg is there twice"),
        ("progress.anomalies_max=1.5:3", "key 'progress.anomalies_max' = 1.5"),
        ("senses=0:1", "key 'senses' is not a number: it cannot be drawn"),
        ("ground=0:1", "key 'ground' is not a number: it cannot be drawn"),
        ("anomaly_source=smell", "key 'anomaly_source' = 'smell'"),
        ("sim.slope_direction_deg=90", "key 'sim.slope_direction_deg' has an effect only with sim.slope_deg"),
        ("sim.friction=0.3", "key 'sim.friction' has an effect only in MuJoCo; add --physics mujoco"),
        ("footprint_m=0.4 vehicle.width_m=0.2", "set the same value"),
    ],
)
def test_what_is_no_key_or_no_value_of_one_is_refused(texts: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        with_keys(*texts.split())


def test_senses_are_kept_told_and_rebuilt(run: Run, tmp_path: Path) -> None:
    succeed(run, *BLIND, "--out", tmp_path / "out", "--log-dir", tmp_path / "log")
    kept = {"blind_share": 0.3, "blind_quality": 0.4}
    settings = json.loads((tmp_path / "out" / "campaign.json").read_text(encoding="utf-8"))
    assert settings["set"] == {f"sim.{name}": value for name, value in kept.items()}
    results = Results.open(tmp_path / "out")
    assert results.rebuild().fixed.physics == replace(PHYSICS, **kept)
    assert facts_of(results)["sim.blind_share"] == "0.3"
    (log,) = (path for path in (tmp_path / "log").rglob("*.jsonl"))
    assert json.loads(log.read_text(encoding="utf-8").splitlines()[0])["sim"] == kept


def test_drawn_key_of_the_rover_file_is_a_column_and_the_page_runs_its_trial_again(run: Run, tmp_path: Path) -> None:
    asked = (*SIM, "--trials", "3", "--set", "escape.turn_angle_deg=20:60", "--set", "progress.anomalies_max=50:99")
    succeed(run, *asked, "--out", tmp_path / "out")
    rows = list(csv.DictReader((tmp_path / "out" / "trials.csv").read_text(encoding="utf-8").splitlines()))
    assert list(rows[0])[-2:] == ["escape.turn_angle_deg", "progress.anomalies_max"]
    assert all(20 <= float(row["escape.turn_angle_deg"]) <= 60 for row in rows)
    assert all(int(row["progress.anomalies_max"]) in range(50, 100) for row in rows)
    succeed(run, "report", tmp_path / "out", "--gallery", "1", "--jobs", "1")
    assert "Not drawn" not in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_sweep_has_the_keys_that_it_does_not_sweep(run: Run, tmp_path: Path) -> None:
    swept = (
        "sweep",
        "sim.blind_share=0,0.3",
        "--trials",
        "1",
        "--budget-m",
        "5",
        "--jobs",
        "1",
        "--out",
        tmp_path / "o",
    )
    succeed(run, *swept, "--set", "sim.blind_quality=0.4", "--set", "sim.slope_deg=1:2")
    settings = json.loads((tmp_path / "o" / "campaign.json").read_text(encoding="utf-8"))
    assert settings["axes"] == [{"key": "sim.blind_share", "values": [0, 0.3], "now": 0.0}]
    assert settings["set"] == {"sim.blind_quality": 0.4, "sim.slope_deg": [1.0, 2.0]}
    seeing, blind = csv.DictReader((tmp_path / "o" / "trials.csv").read_text(encoding="utf-8").splitlines())
    assert seeing["sim.slope_deg"] == blind["sim.slope_deg"], "points are paired"
    assert seeing["path_m"] != blind["path_m"]
    assert "is there twice, swept or in --set" in refusal(run, *swept, "--set", "sim.blind_share=0.2", "--resume")


@pytest.mark.parametrize(
    ("axis", "other", "said"),
    [
        ("slip_mean_m=2,5", ("--slip-mean-m", "3"), "--slip-mean-m and the key 'slip_mean_m' set the same value"),
        ("slip_mean_m=2,5", ("--set", "slip_mean_m=3"), "key 'slip_mean_m' is there twice, swept or in --set"),
        ("ground=ideal,mud", ("--ground", "mud"), "--ground and the key 'ground' set the same value"),
        ("footprint_m=0.2,0.4", ("--set", "vehicle.length_m=1"), "keys 'footprint_m' and 'vehicle.length_m' set the"),
        ("vehicle.width_m=0.2,0.4", ("--set", "footprint_m=1"), "keys 'footprint_m' and 'vehicle.width_m' set the"),
    ],
)
def test_what_is_swept_has_no_other_value_beside_it(
    run: Run, tmp_path: Path, axis: str, other: tuple[str, ...], said: str
) -> None:
    assert said in refusal(run, "sweep", axis, "--trials", "1", "--out", tmp_path / "o", *other)
    assert not (tmp_path / "o").exists()


def test_direction_of_a_swept_slope_may_be_drawn(run: Run, tmp_path: Path) -> None:
    swept = ("sweep", "sim.slope_deg=0,3", "--trials", "2", "--budget-m", "5", "--jobs", "1", "--out", tmp_path / "o")
    succeed(run, *swept, "--set", "sim.slope_direction_deg=0:360")
    rows = list(csv.DictReader((tmp_path / "o" / "trials.csv").read_text(encoding="utf-8").splitlines()))
    directions_deg = [float(row["sim.slope_direction_deg"]) for row in rows]
    assert [(row["sim.slope_deg"], row["trial"]) for row in rows] == [("0", "0"), ("0", "1"), ("3", "0"), ("3", "1")]
    assert all(0.0 <= direction_deg <= 360.0 for direction_deg in directions_deg)
    assert directions_deg[:2] == directions_deg[2:], "points are paired"
    assert directions_deg[0] != directions_deg[1]


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("sim.nope", "sim.blind_cell_m, "),
        ("escape.algorithm", "escape.back_off_m, "),
        ("sim.compass_noise", "did you mean sim.compass_noise_deg"),
    ],
)
def test_unknown_key_is_refused_with_those_that_there_are(run: Run, key: str, said: str) -> None:
    assert said in refusal(run, *SIM, "--set", f"{key}=3")


def test_part_that_counts_draws_whole_numbers_also_if_its_file_says_none() -> None:
    """Only the driver knows which of its numbers count something: none but the address does."""
    drawn = {"parts.motors.address": (128, 135), "parts.compass.heading_offset_deg": (0, 5)}
    campaign = make_campaign({"rover": "forestrover", "trials": 9, "set": drawn})
    addresses = {campaign.drawn(trial)["parts.motors.address"] for trial in range(9)}
    assert {type(address) for address in addresses} == {int}
    assert len(addresses) > 1
    assert type(campaign.drawn(0)["parts.compass.heading_offset_deg"]) is float


@pytest.mark.process  # as above
def test_each_key_of_the_simulator_is_described() -> None:
    keys = current(campaign_of(1)).keys() | current(make_campaign({"physics": "mujoco"})).keys()
    assert keys >= descriptions().keys()
    assert {key for key in keys - descriptions().keys() if key.startswith("sim.")} == set()
    assert all(descriptions().values())


def test_key_that_is_set_is_what_it_is_now() -> None:
    assert current(replace_set(campaign_of(1), {"sim.slope_deg": 4.0, "escape.turn_angle_deg": 77.0})).items() >= {
        ("sim.slope_deg", 4.0),
        ("escape.turn_angle_deg", 77.0),
    }
