from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.experiments.fake_trials import campaign_of
from wayfarer.errors import BadInput, UnknownName
from wayfarer.experiments.campaign import Axis, Campaign, Task
from wayfarer.experiments.keys import current, replace_set
from wayfarer.experiments.results import Results
from wayfarer.experiments.settings import Value
from wayfarer.experiments.sweep import MOST_VALUES, Sweep, make_sweep, parse_axis
from wayfarer.simhal.world.forest_file import ForestFile
from wayfarer.simhal.world.physics import PHYSICS, GroundName, PhysicsName

BASE = campaign_of(4)


def sweep_of(**values: tuple[Value, ...]) -> Sweep:
    return make_sweep(BASE, [Axis(key.replace("__", "."), each) for key, each in values.items()])


def test_every_known_key_can_be_swept_over_what_it_is_now() -> None:
    for key, now in current(BASE).items():
        if now is not None and not isinstance(now, list):
            assert replace_set(BASE, {key: now}).fixed == BASE.fixed, key


def test_each_kind_of_key_reaches_what_a_trial_is_made_of() -> None:
    values: dict[str, Value] = {
        "escape.turn_angle_deg": 45, "footprint_m": 0.6, "slip_mean_m": 3, "budget_m": 500, "ground": "mud",
        "sim.trees_per_ha": 40, "sim.compass_bias_deg": -12.5, "progress.anomalies_max": 20, "parts.contact.front": 6,
    }  # fmt: skip
    campaign = replace_set(BASE, values)
    spec = campaign.spec(Task("forest-pledge", 0), campaign.make_forest(0))
    assert spec.rover.escape.turn_angle_deg == 45
    assert (spec.rover.vehicle.length_m, spec.rover.vehicle.width_m) == (0.6, 0.6)
    assert (spec.physics.slip_mean_m, spec.budget_m, spec.ground) == (3, 500, GroundName.mud)
    assert len(spec.forest.trees_m) == 10
    assert spec.physics == replace(PHYSICS, compass_bias_deg=-12.5, slip_mean_m=3)
    assert spec.rover.progress.anomalies_max == 20
    assert spec.rover.parts["contact"]["front"] == 6


def test_all_points_meet_the_same_forests_and_seeds() -> None:
    sweep = sweep_of(escape__turn_angle_deg=(10, 30), slip_mean_m=(2, 10))
    values = Results(sweep).swept
    assert [tuple(each.values()) for each in values] == [(10, 2), (10, 10), (30, 2), (30, 10)]
    assert [
        (met.rover.escape.turn_angle_deg, met.physics.slip_mean_m) for met in (point.fixed for point in sweep.points)
    ] == [tuple(v.values()) for v in values]
    for trial in range(BASE.trials):
        met = {(p.trial_seed(trial), p.make_forest(trial)) for p in sweep.points}
        assert met == {(BASE.trial_seed(trial), BASE.make_forest(trial))}


def test_denser_forest_has_the_trees_of_the_sparser_one_and_more() -> None:
    sparse, dense = (point.make_forest(0) for point in sweep_of(sim__trees_per_ha=(40, 400)).points)
    assert dense.trunks == sparse.trunks
    assert dense.trees_m[:10] == sparse.trees_m
    assert (len(sparse.trees_m), len(dense.trees_m)) == (10, 100)


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("escape.turn_angel_deg", "escape.turn_angle_deg"),
        ("turn_angle_deg", "escape.turn_angle_deg"),
        ("sim.slip_mean_m", "slip_mean_m"),
        ("footprint", "footprint_m"),
        ("sim.compass_noise", "sim.compass_noise_deg"),
    ],
)
def test_unknown_key_is_told_with_the_nearest(key: str, near: str) -> None:
    with pytest.raises(UnknownName, match=f"unknown key '{key}': did you mean .*{near}"):
        make_sweep(BASE, [Axis(key, (1,))])


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("escape.turn_angle_deg", 190, "key 'escape.turn_angle_deg' = 190: .* allowed is 5 to 180 degrees"),
        ("footprint_m", 0, "key 'vehicle.length_m' = 0: .* allowed is 0.1 to 5 metres"),
        ("slip_mean_m", -2, "key 'slip_mean_m' = -2: .* allowed is above 0 to 1000"),
        ("budget_m", 0, "key 'budget_m' = 0: "),
        ("sim.compass_bias_deg", 200, "key 'sim.compass_bias_deg' = 200: .* allowed is -180 to 180"),
        ("sim.trees_per_ha", 5000, "key 'sim.trees_per_ha' = 5000: .* allowed is 0 to 1000"),
        ("progress.anomalies_max", 2.5, "key 'progress.anomalies_max' = 2.5: "),
        ("anomaly_source", "smell", "key 'anomaly_source' = 'smell': "),
        ("control_hz", 1, "key 'control_hz' = 1: too slow"),
        ("parts.contact.frnot", 1, "unknown key 'parts.contact.frnot'; did you mean 'front'"),
        ("parts.wings.flap", 1, "parts.wings"),
    ],
)
def test_value_out_of_range_is_told_as_in_a_rover_file(key: str, value: Value, told: str) -> None:
    with pytest.raises(BadInput, match=told):
        make_sweep(BASE, [Axis(key, (value,))])


def test_keys_that_do_not_go_together_are_refused() -> None:
    with pytest.raises(BadInput, match="set the same value"):
        sweep_of(footprint_m=(0.4,), vehicle__width_m=(0.2,))
    with pytest.raises(BadInput, match="key 'slip_mean_m' is there twice"):
        make_sweep(BASE, [Axis("slip_mean_m", (2,)), Axis("slip_mean_m", (10,))])
    with pytest.raises(BadInput, match="more cannot be drawn"):
        sweep_of(slip_mean_m=(2,), budget_m=(100,), footprint_m=(0.4,))


IN_MUJOCO = replace(BASE, physics=PhysicsName.mujoco)
FILE = ForestFile("forests.jsonl", "", (BASE.make_forest(0),))


@pytest.mark.parametrize(
    ("campaign", "key", "option"),
    [
        (replace(BASE, forests=FILE), "sim.trees_per_ha", "--forests"),
        (replace(BASE, site="extended-maze"), "sim.trees_per_ha", "--site"),
        (IN_MUJOCO, "ground", "--physics mujoco"),
        (IN_MUJOCO, "sim.motor_lag_s", "--physics mujoco"),
    ],
)
def test_key_that_would_change_nothing_is_refused(campaign: Campaign, key: str, option: str) -> None:
    with pytest.raises(BadInput, match=f"key '{key}' has no effect with {option}"):
        make_sweep(campaign, [Axis(key, (current(BASE)[key],))])


def test_terrain_of_mujoco_is_swept_by_name() -> None:
    drawn = replace_set(IN_MUJOCO, {"sim.torque_scale": (1.0, 3.0)})
    sweep = make_sweep(drawn, [Axis("sim.friction", (0.3, 0.8))])
    met = [point.conditions(point.drawn(3)).terrain for point in sweep.points]
    assert [each.friction for each in met if each] == [0.3, 0.8]
    assert {each.torque_scale for each in met if each} == set(drawn.drawn(3).values())
    assert sweep.settings()["axes"][0]["now"] == 0.5
    assert current(drawn)["sim.torque_scale"] is None, "it has no one value"
    with pytest.raises(BadInput, match=r"key 'sim.friction' = 3: .* 0.02 to 2"):
        make_sweep(drawn, [Axis("sim.friction", (3,))])
    with pytest.raises(BadInput, match="add --physics mujoco"):
        make_sweep(BASE, [Axis("sim.friction", (0.3,))])


def test_too_many_trials_are_refused() -> None:
    with pytest.raises(BadInput, match="1,200,000 trials, allowed are 1,000,000"):
        make_sweep(replace(BASE, trials=400_000), [Axis("slip_mean_m", (1, 2, 3))])


# -- axes as a command line has them -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("k=10:50:10", (10, 20, 30, 40, 50)),
        ("k=0.2:0.8:0.2", (0.2, 0.4, 0.6, 0.8)),
        ("k=0:1:0.3", (0, 0.3, 0.6, 0.9)),
        ("k=3:1:-1", (3, 2, 1)),
        ("k=-30:30:30", (-30, 0, 30)),
        ("k=5:5:1", (5,)),
        (" k = 1, 2.5 ,1e1", (1, 2.5, 10)),
        ("k=7,7,7.0", (7,)),
        ("k=motion,contact", ("motion", "contact")),
        ("k=true,false", (True, False)),
    ],
)
def test_lists_and_ranges_give_their_values(text: str, values: tuple[object, ...]) -> None:
    axis = parse_axis(text)
    assert axis.key == "k"
    assert axis.values == values
    assert list(map(type, axis.values)) == list(map(type, values))


@pytest.mark.parametrize(
    "text",
    [
        "k", "k=", "=1", "k=1,,2", "k=1,", "k=1:2", "k=1:2:3:4", "k=1:2:0", "k=0:0:0", "k=1:2:-1", "k=a:b:c",
        "k=1:inf:1", "k=1:1e999999:1", "k=0:1:1e-999999", "k=1:nan:1", "k=nan:2:1", "k=0:1:1e-9", "k=1e999999:2:1", "",
    ],
)  # fmt: skip
def test_what_is_no_axis_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(BadInput, match=r"KEY=VALUES|FIRST:LAST:STEP|between two commas") as raised:
        parse_axis(text)
    assert "\n" not in str(raised.value)


@given(first=st.integers(-1000, 1000), step=st.integers(1, 99), count=st.integers(1, MOST_VALUES))
def test_range_in_hundredths_is_exact_and_ends_where_it_should(first: int, step: int, count: int) -> None:
    last = first + (count - 1) * step
    axis = parse_axis(f"k={first / 100}:{last / 100}:{step / 100}")
    assert axis.values == tuple((first + number * step) / 100 for number in range(count))


@given(text=st.text())
def test_any_text_is_an_axis_or_bad_input(text: str) -> None:
    with suppress(BadInput):
        assert parse_axis(text).values
