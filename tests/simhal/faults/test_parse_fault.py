"""``--fault``: what it asks for, and what is said of what it cannot."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest

from tests.config.rover_texts import load, rover_toml
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput
from wayfarer.simhal.faults.kinds import BEGINS_S, KINDS, Fault, misfit, parse_fault, parts_of
from wayfarer.simhal.faults.readings import Becomes
from wayfarer.simhal.faults.world import Drive, Slope
from wayfarer.simhal.world.physics import Depth


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("silent:compass", Fault(BEGINS_S, inf, "compass", "silent")),
        ("silent:compass@20", Fault(20.0, inf, "compass", "silent")),
        ("silent:compass@20.5+3", Fault(20.5, 3.0, "compass", "silent")),
        ("nack:motors@0+0.25", Fault(0.0, 0.25, "motors", "nack")),
        ("snag@7", Fault(7.0, inf, "world", "snag")),
        ("becomes", Fault(BEGINS_S, inf, "motion", "becomes", Becomes("quality"))),
        ("drive", Fault(BEGINS_S, inf, "world", "drive", Drive(left_gain=0.0, right_gain=1.0))),
        ("slope", Fault(BEGINS_S, inf, "world", "slope", Slope(pitch_deg=25.0))),
    ],
)
def test_option_is_a_fault_of_its_kind(text: str, fault: Fault) -> None:
    assert parse_fault(text) == fault


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_can_be_asked_for_at_each_of_its_parts(name: str) -> None:
    for part in parts_of(KINDS[name](**KINDS[name].typical)):
        assert parse_fault(f"{name}:{part}").target == part


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("silnt:compass", "unknown kind of fault 'silnt': did you mean silent?"),
        ("", "unknown kind of fault ''"),
        ("silent:compas", "unknown part for --fault silent 'compas': did you mean compass?"),
        ("silent", "--fault silent: name the part: silent:compass, silent:motion, silent:contact"),
        ("offset:motion", "known: compass"),
        ("silent:compass@soon", "'soon' is no time of 0 to 1,000,000 s"),
        ("silent:compass@", "'' is no time"),
        ("silent:compass@5+", "'' is no time"),
        ("silent:compass@-1", "'-1' is no time"),
        ("silent:compass@nan", "'nan' is no time"),
        ("silent:compass@5+inf", "'inf' is no time"),
        ("silent:compass@5+0", "must last longer than 0 s"),
    ],
)
def test_option_that_is_no_fault_is_refused(text: str, says: str) -> None:
    with pytest.raises(BadInput) as refused:
        parse_fault(text)
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("text", "rover", "depth", "says"),
    [
        ("nack:compass", "sim", Depth.DEVICE, 'it needs depth "bus"'),
        ("silent:contact", "minirover", Depth.DEVICE, "no [parts.contact]"),
        ("same_picture", "forestrover", Depth.BUS, 'does not apply to driver = "pmw3901"'),
        ("silent:compass", "minirover", Depth.DEVICE, None),
        ("nack:compass", "minirover", Depth.BUS, None),
    ],
)
def test_rover_and_depth_decide_what_can_happen(text: str, rover: str, depth: Depth, says: str | None) -> None:
    why = misfit(parse_fault(text), load_rover(rover), depth)
    assert why == says or (says and says in (why or ""))


def test_rover_without_parts_in_its_file_has_all_but_a_receiver(tmp_path: Path) -> None:
    bare = load(tmp_path, rover_toml())
    assert misfit(parse_fault("silent:contact"), bare, Depth.DEVICE) is None
    assert misfit(parse_fault("silent:position"), bare, Depth.DEVICE) == "rover 'test' has no [parts.position]"
