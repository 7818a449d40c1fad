"""The one description of a campaign's settings: complete, the same for all who use it, and read back as written."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

from wayfarer import cli
from wayfarer.experiments.checks import make_campaign
from wayfarer.experiments.recorded import recorded
from wayfarer.experiments.settings import FORMS, NAMES, CampaignSettings, option_of, plain_kind, sentences

KEYS = {
    "sim.slope_deg": (0, 45), "sim.compass_bias_deg": (-180, 180), "escape.turn_angle_deg": (5, 180),
    "progress.anomalies_max": (1, 1000), "sim.trees_per_ha": (0, 1000),
}  # fmt: skip


def test_every_setting_has_a_sentence_and_is_checked_by_its_type_or_has_a_form() -> None:
    about = sentences(CampaignSettings)
    assert about.keys() == {*NAMES, "version", "files"}
    assert {*plain_kind().__dataclass_fields__, *FORMS} == set(NAMES)


@pytest.mark.parametrize("command", ["sim", "sweep"])
def test_command_has_an_option_for_every_setting_that_says_its_sentence(command: str) -> None:
    group: Any = typer.main.get_command(cli.app)
    options = {each.name: each for each in group.get_command(None, command).params}
    for name, sentence in sentences(CampaignSettings).items():
        if name in NAMES:
            assert option_of(name) in options[name].opts
            assert options[name].help.startswith(sentence.replace("``", ""))


@st.composite
def asked(draw: st.DrawFn) -> dict[str, Any]:
    """Keys that are set or drawn, beside other settings."""
    keys: dict[str, Any] = {}
    for key in draw(st.sets(st.sampled_from(sorted(KEYS)))):
        ends = sorted(draw(st.lists(st.integers(*KEYS[key]), min_size=2, max_size=2)))
        keys[key] = draw(st.sampled_from([ends[0], tuple(ends), f"{ends[0]}:{ends[1]}"]))
    return {
        "set": keys, "trials": draw(st.integers(1, 10**6)), "seed": draw(st.integers(0, 2**63 - 1)),
        "ground": draw(st.sampled_from(["ideal", "mud"])), "faults": draw(st.sampled_from([(), "silent:compass"])),
        "slip_mean_m": draw(st.floats(0.1, 1000)), "rover": draw(st.sampled_from(["sim", "minirover"])),
    }  # fmt: skip


@given(asked())
def test_campaign_is_read_back_as_it_was_written(settings: dict[str, Any]) -> None:
    campaign = make_campaign(settings)
    written = json.loads(json.dumps(campaign.settings()))
    again = recorded(written).base
    assert again.settings() == written
    assert replace(again, rover=campaign.rover) == campaign
    for trial in (0, 7):
        drawn = again.drawn(trial)
        assert replace(again, rover=campaign.rover).conditions(drawn) == campaign.conditions(campaign.drawn(trial))
