"""Faults that strike missions: which do, when, and what is told of a mission."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from wayfarer.config.rover_file import laid_over, load_rover
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.fault_scenarios import missions
from wayfarer.fault_scenarios.catalogue import catalogue
from wayfarer.fault_scenarios.missions import LIMITS, Mission, MissionRunner, Strike, Striking, faults_of, run_mission
from wayfarer.fault_scenarios.scenario import Scenario
from wayfarer.simhal.faults.bus import BusFault


def fault(name: str) -> Striking:
    (found,) = faults_of([row for row in catalogue() if row.name == name])[0]
    return found


def strike(name: str, trial: int = 0) -> Strike:
    return MissionRunner([fault(name)], 0)((trial, 0))


def test_every_simulated_fault_strikes_once_or_is_left_out_with_its_reason() -> None:
    faults, left_out = faults_of(catalogue())
    striking = [name for each in faults for name in each.names]
    told = ", ".join(line.partition(": ")[0] for line in left_out).split(", ")
    assert len(set(striking)) == len(striking)
    assert sorted(striking + told) == sorted(row.name for row in catalogue())
    simulated = {row.name for row in catalogue() if isinstance(row, Scenario)}
    assert simulated - set(striking) == {"failsafe-refused", "runaway", "runaway-seen-by-camera"}


def test_faults_that_differ_in_how_long_they_last_are_one() -> None:
    (each,), _ = faults_of([row for row in catalogue() if row.row in {2, 51}])
    assert each.names == ("compass-nack", "compass-nack-for-long", "arm-while-faulted")
    assert each.rows == (2, 51)


def test_only_faults_on_wires_need_the_depth_of_wires() -> None:
    for each, _, _ in faults_of(catalogue())[0]:
        on_wires = any(isinstance(fault.params, BusFault) for fault in each.faults)
        assert (each.depth == "bus") is on_wires, each.name


def test_on_another_rover_what_it_cannot_have_is_left_out() -> None:
    faults, left_out = faults_of([row for row in catalogue() if row.name in {"camera-frozen", "camera-black"}], "sim")
    assert [(each.scenario.name, each.scenario.rover) for each in faults] == [("camera-black", "sim")]
    assert left_out == ["camera-frozen: rover 'sim': 'same_picture' does not apply to driver = \"pmw3901\""]


def test_mission_without_the_fault_is_the_trial_of_that_seed() -> None:
    campaign = Campaign(("forest-pledge",), 2, laid_over(load_rover("sim"), LIMITS))
    result = run_trial(campaign.spec(Task("forest-pledge", 1), campaign.make_forest(1)))
    well = strike("iron-nearby", trial=1).well
    assert (well.path_m, well.ended_s, well.ended) == (result.path_m, result.time_s, "")


@pytest.fixture
def specs(monkeypatch: pytest.MonkeyPatch) -> list[TrialSpec]:
    """What is run, in place of running it: missions that are armed after 10 s and take 100 s."""
    asked: list[TrialSpec] = []

    def note(spec: TrialSpec) -> Mission:
        asked.append(spec)
        return Mission(10.0, 100.0, 70.0, "", {})

    monkeypatch.setattr(missions, "run_mission", note)
    return asked


def test_fault_strikes_under_way_for_good_and_for_a_while_in_the_same_trial(specs: list[TrialSpec]) -> None:
    run = MissionRunner([fault("timeout-lost"), fault("board-fault")], 0)
    for trial in range(20):
        run((trial, 0))
    times = []
    for well, good, brief in zip(*[iter(specs)] * 3, strict=True):
        (first, second), (same, _) = good.faults, brief.faults
        assert 10.0 <= first.at_s == same.at_s <= 100.0
        assert second.at_s - first.at_s == pytest.approx(0.12), "a sequence is kept"
        assert [first.for_s, second.for_s, same.for_s] == [inf, inf, 10.0]
        assert replace(good, faults=()) == replace(brief, faults=()) == well
        times.append(first.at_s)
    assert max(times) - min(times) > 60.0


def test_missions_without_a_fault_are_run_once_for_all_faults_of_a_rover(specs: list[TrialSpec]) -> None:
    run = MissionRunner([fault("motors-nack"), fault("board-fault")], 0)
    strikes = [run((0, number)) for number in (0, 1)]
    assert [each.fault for each in strikes] == [0, 1]
    assert [len(spec.faults) for spec in specs] == [0, 1, 1, 1, 1]
    assert specs[1].faults[0].at_s == specs[3].faults[0].at_s


def test_lost_sense_does_not_end_a_mission_and_its_mode_is_told() -> None:
    well, (good, brief) = strike("motion-silent")[2:]
    assert (good.ended, brief.ended) == ("", "")
    assert brief.mode_s["motion_stale"] == pytest.approx(10.0, abs=0.5), "only while the fault lasted"
    assert well.mode_s == {}


def test_latched_fault_ends_a_mission_at_once_and_is_named() -> None:
    struck = strike("flipped").struck[0]
    assert struck.ended == "fault: overturned"
    assert struck.ended_s < 300.0, "nobody waits for the rover that is disarmed"


def test_bug_in_a_driver_ends_a_mission() -> None:
    assert strike("task-crash").struck[0].ended == "error: Bug"


def test_limits_of_time_and_path_are_told_apart() -> None:
    campaign = Campaign(("forest-pledge",), 1, load_rover("sim"))
    spec = campaign.spec(Task("forest-pledge", 0), campaign.make_forest(0))
    brief = laid_over(spec.rover, {"safety": {"mission_time_s": 5.0}})
    assert run_mission(replace(spec, rover=brief)).ended == "time"
    assert run_mission(replace(spec, budget_m=5.0)).ended == "path"
