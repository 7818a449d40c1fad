"""Faults by chance: all that can happen is drawn, within its ranges, the same for the same seed; and many trials."""

from __future__ import annotations

import json
import os
import signal
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from math import inf
from pathlib import Path
from random import Random
from typing import Any, get_type_hints

import pytest
from annotated_types import Interval
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fault_scenarios.broken_product import breaks_the_product
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput, UnknownName
from wayfarer.fault_scenarios import random_runs
from wayfarer.fault_scenarios.random_runs import ROWS_FILE, RandomTrial, broken_rules, run_random, run_seed
from wayfarer.fault_scenarios.random_scenarios import (
    LONGEST_S,
    ROVERS,
    FaultTarget,
    draw_fault,
    draw_params,
    draw_scenario,
    possible_faults,
)
from wayfarer.fault_scenarios.runner import run_scenario
from wayfarer.fault_scenarios.scenario import Command, Expectation, ResponseLevel, Scenario
from wayfarer.fault_scenarios.scenario_file import read_scenarios
from wayfarer.fault_scenarios.scenario_writer import as_toml
from wayfarer.fault_scenarios.shrink import shrink
from wayfarer.hal import WheelCommand
from wayfarer.safety.gate import Gate
from wayfarer.simhal.build_rover import Depth
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.faults.kinds import KINDS, Fault
from wayfarer.simhal.faults.wires import FaultyWire

RIGS = [(rover, depth) for rover in ROVERS for depth in Depth]
PLACES = sorted({place for rover, depth in RIGS for place in possible_faults(load_rover(rover), depth)})
SEEDS = st.integers(0, 2**31 - 1)
FOUND = sorted((Path(__file__).parent / "found").glob("*.toml"))


# -- what is drawn -----------------------------------------------------------------------------------------------------


def test_every_kind_of_fault_can_be_drawn_on_some_rover() -> None:
    drawn = {place.kind for place in PLACES}
    assert set(KINDS) - drawn == {name for name, kind in KINDS.items() if set(kind.targets) <= {"position"}}


@pytest.mark.parametrize(("rover", "depth"), RIGS)
def test_whatever_is_possible_begins_and_ends_in_a_run(rover: str, depth: Depth) -> None:
    rng = Random(0)
    places = [place for place in possible_faults(load_rover(rover), depth) if place.kind != "task_crash"]
    faults = [replace(draw_fault(place, 1.0 + index / 5, rng), for_s=0.3) for index, place in enumerate(places)]
    scenario = replace(draw_scenario(0, rover, depth), faults=tuple(faults), for_s=faults[-1].at_s + LONGEST_S + 1.0)
    run_result = run_scenario(scenario)
    assert (run_result.broken, run_result.error) == ((), None)
    assert {fault for _, fault, begins in run_result.recorder.faults if begins} == set(faults)
    assert {fault for _, fault, begins in run_result.recorder.faults if not begins} == set(faults)


@given(place=st.sampled_from(PLACES), seed=SEEDS)
def test_parameters_are_within_their_ranges(place: FaultTarget, seed: int) -> None:
    params = draw_params(place, Random(seed))
    for name, hint in get_type_hints(type(params), include_extras=True).items():
        for interval in getattr(hint, "__metadata__", ()):
            assert_within(interval, getattr(params, name))


def assert_within(interval: Any, value: float) -> None:
    assert isinstance(interval, Interval)
    assert interval.ge is None or value >= interval.ge  # type: ignore[operator]
    assert interval.gt is None or value > interval.gt  # type: ignore[operator]
    assert interval.le is None or value <= interval.le  # type: ignore[operator]


@settings(max_examples=30)
@given(seed=SEEDS)
def test_scenario_is_that_of_its_seed_also_where_its_rover_and_depth_are_named(seed: int) -> None:
    scenario = draw_scenario(seed)
    assert draw_scenario(seed, scenario.rover, scenario.depth) == scenario
    assert all(0.0 <= fault.at_s <= scenario.for_s for fault in scenario.faults)
    places = [(fault.kind, fault.target) for fault in scenario.faults]
    assert len(set(places)) == len(places), "the same fault twice at once"


@settings(max_examples=30)
@given(seed=SEEDS)
def test_scenario_that_was_drawn_is_read_back_from_its_file(seed: int, tmp_path_factory: Any) -> None:
    scenario = draw_scenario(seed)
    path = tmp_path_factory.getbasetemp() / "again.toml"
    path.write_text(as_toml(replace(scenario, expect=Expectation(ResponseLevel.HOLD, 5.0))), encoding="utf-8")
    (read,) = read_scenarios(path)
    assert replace(read, expect=scenario.expect) == scenario


# -- many of them ------------------------------------------------------------------------------------------------------


def run(trials: int, seed: int = 0, jobs: int = 1, out: Path | None = None, **asked: Any) -> tuple[int, str]:
    """The exit code of a run, and what it printed."""
    rig = {"rover": "sim", "depth": Depth.DEVICE} | asked
    with redirect_stdout(StringIO()) as printed:
        code = run_random(trials, rig["rover"], rig["depth"], seed, jobs, out)
    return code, printed.getvalue()


def test_trials_are_summed_up_and_each_has_its_row(tmp_path: Path) -> None:
    code, printed = run(4, seed=3, out=tmp_path / "new")
    rows = [json.loads(line) for line in (tmp_path / "new" / ROWS_FILE).read_text().splitlines()]
    assert code == 0
    assert [row["seed"] for row in rows] == [3, 4, 5, 6]
    assert "4 trials, " in printed
    assert "broken rules: in 0 trials" in printed
    assert all(row["ticks"] > 0 and row["faults"] for row in rows)


@pytest.mark.long
def test_rows_are_the_same_on_any_number_of_workers(tmp_path: Path) -> None:
    for jobs in (1, 2):
        assert run(8, jobs=jobs, out=tmp_path / str(jobs), rover=None, depth=None)[0] == 0
    assert (tmp_path / "1" / ROWS_FILE).read_bytes() == (tmp_path / "2" / ROWS_FILE).read_bytes()


@breaks_the_product
def test_broken_rule_ends_with_1_and_leaves_the_smallest_scenario_that_breaks_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(Gate, "limit", lambda self, wanted, armed: WheelCommand(0.3, 0.3))  # even while disarmed
    code, printed = run(1, out=tmp_path)
    files = sorted(tmp_path.glob("random-*.toml"))
    assert code == 1
    assert files
    assert f"again: wayfarer faults --scenario {files[0]}" in printed
    (scenario,) = read_scenarios(files[0])
    assert run_scenario(scenario).broken
    assert len(scenario.faults) == 1
    assert scenario.commands == ()
    code, without_a_folder = run(1)
    assert code == 1
    assert "again: wayfarer faults --trials 1 --seed 0 " in without_a_folder


def test_trial_that_fails_by_itself_is_a_broken_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> None:
        raise ZeroDivisionError("in the simulator")

    monkeypatch.setattr("wayfarer.fault_scenarios.runner.generate_forest", fails)
    monkeypatch.setattr("wayfarer.fault_scenarios.random_scenarios.FOREST", 1.1)
    trial = run_seed("sim", Depth.DEVICE, 0)
    assert trial.broken == ("the trial failed: ZeroDivisionError: in the simulator",)


def test_unknown_rover_and_a_folder_that_cannot_be_are_refused_before_the_first_trial(tmp_path: Path) -> None:
    with pytest.raises(UnknownName):
        run(1, rover="no-such-rover")
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match="cannot be used for what comes of the trials"):
        run(1, out=tmp_path / "file" / "folder")


# -- the smallest ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.stem)
def test_scenario_that_broke_a_rule_once_breaks_none_any_more(path: Path) -> None:
    (scenario,) = read_scenarios(path)
    assert broken_rules(run_scenario(scenario)) == ()


GUILTY = Fault(5.0, inf, "world", "snag")


def test_smallest_scenario_keeps_only_what_is_needed() -> None:
    innocent = [Fault(at_s, 1.0, "world", kind) for at_s, kind in ((1.0, "slip"), (2.0, "slope"), (30.0, "battery"))]
    scenario = Scenario(
        "test", "", Expectation(ResponseLevel.NONE, 0.0), (*innocent[:2], GUILTY, innocent[2]), for_s=60.0,
        commands=(Command(0.0, "arm"), Command(7.0, "hold"), Command(40.0, "disarm")),
    )  # fmt: skip

    def is_broken(tried: Scenario) -> bool:
        return GUILTY in tried.faults and Command(7.0, "hold") in tried.commands

    least = shrink(scenario, is_broken)
    assert least.faults == (GUILTY,)
    assert least.commands == (Command(7.0, "hold"),)
    assert least.for_s < 15.0


def test_noise_that_comes_out_as_a_strange_command_is_passed_over() -> None:
    """Found by a soak: three bits of a packet for the motors, of which the checksum was right again."""
    heard: list[int] = []

    class Picky:
        def receive(self, data: bytes) -> None:
            heard.extend(data)
            if data == b"\x21":
                raise ChipMisuse("no such command")

    wire = FaultyWire("here", Picky())
    wire.writes.append(lambda data: b"\x80\x21\x01")
    wire.receive(b"\x80\x00\x00")
    assert heard == [0x80, 0x21, 0x01]
    wire.writes.clear()
    with pytest.raises(ChipMisuse):
        wire.receive(b"\x21")


def test_rover_without_parts_is_tried_at_device_depth_only(tmp_path: Path) -> None:
    file = tmp_path / "bare.toml"
    file.write_text('name = "bare"\n[vehicle]\nlength_m = 0.4\nwidth_m = 0.4\ntrack_m = 0.5\nmax_speed_m_s = 1.0\n')
    assert {draw_scenario(seed, str(file)).depth for seed in range(20)} == {Depth.DEVICE}
    assert run_scenario(draw_scenario(0, str(file))).broken == ()
    with pytest.raises(BadInput, match="lacks the parts that bus depth needs; use --depth device"):
        draw_scenario(0, str(file), Depth.BUS)


def test_signal_ends_the_trials_and_what_was_done_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(rover: str, depth: Depth, seed: int) -> RandomTrial:
        if seed == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return run_seed(rover, depth, seed)

    monkeypatch.setattr(random_runs, "run_seed", interrupted)
    code, printed = run(50)
    assert code == 130
    assert "broken rules: in 0 trials" in printed
    assert "50 trials, " not in printed
