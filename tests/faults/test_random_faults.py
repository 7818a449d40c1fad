"""Faults by chance break no safety rule: any of them, several at once, with operator commands between them.

Any interleaving, also with faults that end and a board that is opened again, is ``daemon_machine.py``'s.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.faults.broken_product import breaks_the_product
from tests.faults.fault_strategies import (
    LONGEST_S,
    PLACES,
    RIGS,
    broken_rules,
    faults,
    possible_faults,
    quick_settings,
    scenarios,
)
from tests.faults.test_safety_rules import gate_drives
from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.faults.kinds import KINDS
from wayfarer.simhal.faults.wires import FaultyWire
from wayfarer.simhal.world.physics import Depth
from wayfarer.testing.scenario import Expectation, ResponseLevel, Scenario, read_scenarios
from wayfarer.testing.scenario_run import run_scenario

FOUND = sorted((Path(__file__).parent / "found").glob("*.toml"))


def keeps_the_rules(scenario: Scenario) -> None:
    assert broken_rules(run_scenario(scenario)) == ()


def tried(examples: int, **others: Any) -> Any:
    """``keeps_the_rules`` with so many scenarios."""
    bound = settings(max_examples=examples, suppress_health_check=[HealthCheck.too_slow], **others)
    return bound(given(scenario=scenarios())(keeps_the_rules))


test_random_faults_break_no_safety_rule = tried(20)
test_many_random_faults_break_no_safety_rule = pytest.mark.long(tried(300))


@breaks_the_product
def test_gate_that_drives_while_disarmed_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    gate_drives(monkeypatch)
    with pytest.raises(AssertionError, match="rule 1: motion commanded while"):
        tried(5, phases=[Phase.generate])()


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.stem)
def test_scenario_that_broke_a_rule_once_breaks_none_any_more(path: Path) -> None:
    (scenario,) = read_scenarios(path)
    assert broken_rules(run_scenario(scenario)) == ()


# -- what is drawn -----------------------------------------------------------------------------------------------------


def test_every_kind_of_fault_can_be_drawn_on_some_rover() -> None:
    drawn = {place.kind for place in PLACES}
    of_no_shipped_rover = {"late_bytes"}  # none has a part that answers on a serial line
    nowhere = {name for name, kind in KINDS.items() if set(kind.targets) <= {"position"}}
    assert set(KINDS) - drawn == nowhere | of_no_shipped_rover


@pytest.mark.parametrize(("rover", "depth"), RIGS)
@settings(max_examples=1, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_whatever_is_possible_begins_and_ends_in_a_run(rover: str, depth: Depth, data: st.DataObject) -> None:
    config = load_rover(rover)
    places = [place for place in possible_faults(config, depth) if place.kind != "task_crash"]
    drawn = [data.draw(faults(place, st.just(1.0 + index / 5))) for index, place in enumerate(places)]
    begun = {replace(fault, for_s=0.3) for fault in drawn}
    scenario = Scenario(
        name="all", expect=Expectation(ResponseLevel.NONE, 0.0), faults=tuple(begun), rover=rover, depth=depth,
        for_s=drawn[-1].at_s + LONGEST_S + 1.0, settings=quick_settings(config),
    )  # fmt: skip
    run_result = run_scenario(scenario)
    assert (run_result.broken, run_result.error) == ((), None)
    assert {fault for _, fault, begins in run_result.recorder.faults if begins} == begun
    assert {fault for _, fault, begins in run_result.recorder.faults if not begins} == begun


def test_noise_that_comes_out_as_a_strange_command_is_passed_over() -> None:
    """Found by a soak: three bits of a packet for the motors, of which the checksum was right again."""
    heard: list[int] = []

    class Picky:
        def receive(self, data: bytes) -> bytes:
            heard.extend(data)
            if data == b"\x21":
                raise ChipMisuse("no such command")
            return b""

    wire = FaultyWire("here", Picky())
    wire.writes.append(lambda data: b"\x80\x21\x01")
    wire.receive(b"\x80\x00\x00")
    assert heard == [0x80, 0x21, 0x01]
    wire.writes.clear()
    with pytest.raises(ChipMisuse):
        wire.receive(b"\x21")


@pytest.mark.parametrize("depth", Depth)
def test_rover_without_parts_can_have_faults_at_device_depth_only(tmp_path: Path, depth: Depth) -> None:
    file = tmp_path / "bare.toml"
    file.write_text('name = "bare"\n[vehicle]\nlength_m = 0.4\nwidth_m = 0.4\ntrack_m = 0.5\nmax_speed_m_s = 1.0\n')
    assert bool(possible_faults(load_rover(str(file)), depth)) is (depth is Depth.DEVICE)
