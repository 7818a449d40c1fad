"""Search spaces: what is taken, and what is refused in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.experiments import fake_trials
from tests.experiments.tuning.settings_matter import FORESTS
from wayfarer.config.rover_file import load_rover, rover_names
from wayfarer.errors import BadInput
from wayfarer.experiments.tuning.forests import content_of, development, held_out
from wayfarer.experiments.tuning.overlay import overlaid
from wayfarer.experiments.tuning.space import DEFAULT_SPACE, search_space
from wayfarer.simhal.world.forest_file import forests_in

CAMPAIGN = fake_trials.campaign_of(4)


@pytest.mark.parametrize("rover", rover_names())
def test_usual_space_lies_around_the_present_values_of_each_rover(rover: str) -> None:
    space = search_space(replace(CAMPAIGN, rover=load_rover(rover)), ())
    assert [each.key for each in space] == list(DEFAULT_SPACE)
    assert all(each.low < each.now < each.high and each.log for each in space)


def test_any_number_of_the_rover_file_can_be_searched() -> None:
    turn, tries, speed = search_space(
        CAMPAIGN, ["escape.turn_angle_deg=10:90", "detector.cannot_turn_tries=1:6", "vehicle.max_speed_m_s=0.5:2:log"]
    )
    assert turn == ("escape.turn_angle_deg", 10.0, 90.0, False, False, 30.0)
    assert (tries.whole, tries.rounded(2.6)) == (True, 3)
    assert speed.log
    assert (turn.rounded(12.34567), turn.rounded(90.00001)) == (12.35, 90.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "write KEY=LOW:HIGH"),
        ("escape.turn_angle_deg", "write KEY=LOW:HIGH"),
        ("escape.turn_angle_deg=10,20", "write KEY=LOW:HIGH"),
        ("escape.turn_angle_deg=10:20:lin", "write KEY=LOW:HIGH"),
        ("escape.turn_angle_deg=a:20", "expected two numbers"),
        ("escape.turn_angle_deg=nan:20", "LOW must be below HIGH"),
        ("escape.turn_angle_deg=20:10", "LOW must be below HIGH"),
        ("escape.turn_angle_deg=20:20", "LOW must be below HIGH"),
        ("escape.turn_angle_deg=10:200", r"key 'escape.turn_angle_deg' = 200.0: .*; allowed is above 0 to 180"),
        ("escape.turn_angel_deg=10:20", "did you mean escape.turn_angle_deg"),
        ("anomaly_source=0:1", "unknown number of the rover file"),
        ("sim.compass_noise_deg=0:1", "unknown number of the rover file"),
        ("detector.cannot_turn_tries=1.5:3", "expected two whole numbers"),
        ("safety.tick_late_s=0:1:log", "must begin above 0"),
    ],
)
def test_other_ranges_are_refused(text: str, said: str) -> None:
    with pytest.raises(BadInput, match=said) as refused:
        search_space(CAMPAIGN, [text])
    assert "\n" not in str(refused.value)


def test_two_ranges_of_one_key_are_refused() -> None:
    with pytest.raises(BadInput, match="has two ranges"):
        search_space(CAMPAIGN, ["escape.turn_angle_deg=10:20", "escape.turn_angle_deg=20:30"])


def test_held_out_forests_have_numbers_that_the_search_never_sees() -> None:
    generated = replace(CAMPAIGN, trials=5)
    of_a_file = replace(CAMPAIGN, forests=FORESTS)
    for base in (generated, of_a_file):
        seen = {forest.forest for forest in forests_in("", content_of(development(base)))}
        kept = {forest.forest for forest in forests_in("", content_of(held_out(base, 6)))}
        assert seen
        assert kept
        assert not seen & kept
    site = replace(CAMPAIGN, rover=load_rover("minirover"), scenario="dense-obstruction")
    assert {held_out(site, 6).trial_seed(n) for n in range(6)} & {site.trial_seed(n) for n in range(9)} == set()


@pytest.mark.parametrize(("parity", "lacks"), [(0, "an odd"), (1, "an even")])
def test_file_of_one_parity_is_refused_before_the_search(parity: int, lacks: str) -> None:
    half = replace(FORESTS, forests=FORESTS.forests[parity::2])
    with pytest.raises(BadInput, match=f"none with {lacks} number"):
        development(replace(CAMPAIGN, forests=half))


# -- the tuned rover file ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rover", rover_names())
def test_tuned_file_is_the_rovers_with_these_values_only(rover: str, tmp_path: Path) -> None:
    path = tmp_path / "tuned.toml"
    changed = {
        "escape.turn_angle_deg": (30.0, 41.5),
        "control_hz": (20.0, 25.0),
        "detector.cannot_turn_tries": (3, 4),
    }
    path.write_text(overlaid(rover, changed, ["why:" + " word" * 40, "", "end"]), encoding="utf-8")
    before, after = load_rover(rover), load_rover(str(path))
    assert after.escape.turn_angle_deg == 41.5
    tuned = {
        "control_hz": 25.0,
        "escape": replace(before.escape, turn_angle_deg=41.5),
        "detector": replace(before.detector, cannot_turn_tries=4),
    }
    assert after == before.model_copy(update=tuned)


def test_file_that_hides_its_keys_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.toml"
    path.write_text(
        'name = "odd"\nescape = {turn_angle_deg = 20.0}\n'
        "[vehicle]\nlength_m = 0.4\nwidth_m = 0.4\ntrack_m = 0.5\nmax_speed_m_s = 1.0\n"
    )
    with pytest.raises(BadInput, match=r"odd\.toml: its keys cannot be changed by tune"):
        overlaid(str(path), {"escape.turn_angle_deg": (20.0, 20.0)})
