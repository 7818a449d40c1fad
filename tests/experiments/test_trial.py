"""A trial runs the daemon's own code. That it follows from its spec alone is in ``test_trajectory.py``."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from math import inf
from typing import Any

import pytest

from wayfarer.config.rover_file import load_rover
from wayfarer.control import sensors, supervisor
from wayfarer.control.rate import AtOnce, Rate
from wayfarer.control.tick import TickRecord
from wayfarer.drivers.pmw3901 import OPEN_S
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.escape.recovery import REST_S
from wayfarer.experiments.outcome import OUTCOMES, SUCCESSES, TrialCounters
from wayfarer.experiments.trial import TrialResult, run_trial, run_watched
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.safety.conditions import Condition
from wayfarer.simhal.clock.schedule import Schedule, WakeUp
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.world import Slope
from wayfarer.simhal.world.forest import CLEARING, Trunk
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.sites import SITES

SHORT_M = 30.0
# A trunk that is met on the right: who feels that turns left, who does not turns right.
SLANTED = replace(CLEARING, trunks=(Trunk(15.0, 30.0, 35.0, 20.0, "across"),))
OPEN = replace(CLEARING, forest=3, noise=4, shortest_path_m=37.5)


def spec_of(algorithm: str = "forest-pledge", *, seed: int = 5, budget_m: float = 1000.0) -> TrialSpec:
    return TrialSpec(17, algorithm, generate_forest(1, 0, 0), seed, load_rover("sim"), budget_m=budget_m)


def test_result_says_which_trial_it_is_and_adds_up() -> None:
    spec = replace(spec_of(), forest=OPEN)
    result = run_trial(spec)
    assert result[:5] == (17, "forest-pledge", 3, 4, 5)
    assert result.outcome == "escaped"
    assert result.ticks == pytest.approx((result.time_s - OPEN_S) * spec.rover.control_hz, abs=2)
    assert 0.0 <= result.reverse_m < result.path_m
    assert result.path_m == pytest.approx(result.time_s * spec.rover.escape.cruise_m_s, rel=0.2)
    assert result.episodes <= result.anomalies
    assert result.spl == pytest.approx(37.5 / max(37.5, result.path_m))


@pytest.mark.parametrize("algorithm", CATALOGUE)
def test_every_algorithm_drives(algorithm: str) -> None:
    result = run_trial(spec_of(algorithm, budget_m=SHORT_M))
    assert result.outcome in OUTCOMES
    assert result.outcome != "fault"
    assert result.path_m > 5.0
    assert result.anomalies > 0


def test_rover_that_uses_up_its_own_mission_did_not_get_out_and_is_no_fault() -> None:
    spec = spec_of()
    limits = replace(spec.rover.safety, mission_distance_m=5.0)
    result = run_trial(replace(spec, rover=spec.rover.model_copy(update={"safety": limits})))
    assert result.outcome == "entrapped"
    assert result.path_m < 6.0


def test_budget_ends_a_trial() -> None:
    result = run_trial(spec_of(budget_m=5.0))
    assert result.outcome == "entrapped"
    assert result.path_m == pytest.approx(5.0, abs=0.1)
    assert result.spl in (0.0, None)


WEDGED = replace(
    CLEARING, trunks=(Trunk(22.0, 12.58, 27.97, 13.21, "across"), Trunk(22.02, 12.23, 28.01, 11.98, "across"))
)


def test_trial_in_a_forest_ends_when_the_rover_is_lost_unless_it_is_to_go_on() -> None:
    """With this seed it gets out of the wedge after its first rest."""
    spec = TrialSpec(0, "forest-pledge", WEDGED, 6, load_rover("sim"))
    lost, patient = run_trial(spec), run_trial(replace(spec, go_on=True))
    assert lost.outcome == "entrapped"
    assert lost.path_m < spec.budget_m
    assert patient.outcome in SUCCESSES
    assert lost.time_s < patient.time_s - REST_S, "the rest is not waited for"


def test_trial_at_a_site_never_ends_before_its_time_because_the_rover_is_lost() -> None:
    """Some wedged rovers get out there long after their first rest."""
    site = SITES["extended-maze"]
    spec = TrialSpec(0, "forest-pledge", WEDGED, 6, site.equip(load_rover("forestrover")))
    lost, helped = run_trial(spec), run_trial(replace(spec, site=site))
    assert lost.outcome == helped.outcome == "entrapped"
    assert lost.time_s < site.time_limit_s - REST_S
    assert helped.time_s == pytest.approx(site.time_limit_s, abs=1.0)


def test_rover_that_gets_out_is_not_lost_for_having_been_on_the_ladder() -> None:
    log, ended = TrialCounters(ends_lost=True), []
    log.finish = lambda reason, _text: ended.append(reason)
    record = TickRecord(1.0)
    for condition in (Condition.NO_PROGRESS, Condition.CANNOT_TURN):
        record.conditions = (condition,)
        log.tick(record)
    assert not ended
    record.conditions = (Condition.CANNOT_TURN, Condition.RESTING)
    log.tick(record)
    assert ended == ["entrapped"]


class Patient(Schedule):
    """Wakes every task for what it could do at once."""

    def wake(self, rate: Rate, work: AtOnce | None) -> WakeUp:
        return super().wake(rate, None)


def test_tasks_that_are_woken_for_everything_do_the_same() -> None:
    spec = replace(spec_of("cv-pledge", budget_m=100.0), forest=SLANTED)
    woken = run_watched(spec, None, loop_factory=partial(VirtualLoop, Patient))  # type: ignore[abstract]
    assert woken == run_trial(spec)


# -- the daemon's own code -------------------------------------------------------------------------------------------


def run_without(sensor: str, spec: TrialSpec, monkeypatch: pytest.MonkeyPatch) -> TrialResult:
    """Run a trial with one row taken away from the task table of the daemon's supervisor."""
    rows_of: Any = sensors.sensor_tasks

    def fewer(*args: Any) -> tuple[sensors.SensorTask, ...]:
        rows: tuple[sensors.SensorTask, ...] = rows_of(*args)
        left = tuple(row for row in rows if row.name != sensor)
        assert len(left) == len(rows) - 1
        return left

    with monkeypatch.context() as patch:
        patch.setattr(supervisor, "sensor_tasks", fewer)
        return run_trial(spec)


def test_rover_that_feels_no_contact_turns_the_other_way(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = replace(spec_of("cv-pledge", budget_m=100.0), forest=SLANTED)
    whole, maimed = run_trial(spec), run_without("contact", spec, monkeypatch)
    assert whole.outcome == "escaped"
    assert abs(maimed.path_m - whole.path_m) > 1.0


def test_rover_without_a_compass_never_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    result = run_without("compass", spec_of(budget_m=10.0), monkeypatch)
    assert (result.outcome, result.path_m) == ("fault", 0.0)  # it was never armed


def test_rover_that_cannot_sense_motion_escapes_unless_it_is_to_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = replace(spec_of(budget_m=100.0), forest=SLANTED)
    assert run_without("motion", spec, monkeypatch).outcome == "escaped"
    safety = replace(spec.rover.safety, on_lost_sense="hold")
    among_people = replace(spec, rover=spec.rover.model_copy(update={"safety": safety}))
    stands = run_without("motion", among_people, monkeypatch)
    assert stands.outcome == "entrapped", "until its time is over"
    assert stands.path_m < 0.5, "what it drives until the silence is one"


@cache
def path_of_a_whole_rover_m(seed: int) -> float:
    return run_trial(replace(spec_of(seed=seed), forest=generate_forest(seed, 0, seed))).path_m


@pytest.mark.parametrize("lost", [("motion",), ("compass",), ("motion", "compass")], ids="-".join)
def test_rover_that_loses_a_sense_on_its_way_gets_out_and_without_both_drives_on(lost: tuple[str, ...]) -> None:
    """Seeds are not chosen: ten of ten got out without one of them, one of ten within 1,000 m without both."""
    faults = tuple(Fault(20.0, inf, sense, "silent") for sense in lost)
    for seed in (1000, 1001):
        spec = replace(spec_of(seed=seed), forest=generate_forest(seed, 0, seed))
        spec = spec if len(lost) == 1 else replace(spec, budget_m=200.0)
        lame = run_trial(replace(spec, faults=faults))
        assert lame.outcome in SUCCESSES or (len(lost) == 2 and lame.path_m >= 200.0), "it does not drive on"
        assert lame.path_m != path_of_a_whole_rover_m(seed), "the fault never began"


def test_trial_is_over_once_the_rover_has_disarmed_itself() -> None:
    on_its_roof = Fault(20.0, inf, "world", "slope", Slope(roll_deg=180.0))
    result = run_trial(replace(spec_of(), faults=(on_its_roof,)))
    assert result.outcome == "fault"
    assert result.time_s == pytest.approx(20.0, abs=1.0), "nobody is there to arm it again"


def test_contact_as_the_source_of_anomalies_is_noticed_at_once() -> None:
    spec = spec_of()
    by_touch = run_trial(replace(spec, rover=spec.rover.with_anomaly_source("contact")))
    by_motion = run_trial(spec)
    assert by_touch.outcome == "escaped"
    assert seconds_lost(by_touch) < seconds_lost(by_motion)


def seconds_lost(result: TrialResult) -> float:
    """Return the time an anomaly costs, beyond driving at 1 m/s."""
    return (result.time_s - result.path_m) / result.anomalies


# -- paired comparisons ----------------------------------------------------------------------------------------------


def test_algorithms_with_one_seed_meet_the_same_noise() -> None:
    """In a forest without obstacles and slips the algorithms never differ, so neither do their paths."""
    spec = replace(spec_of(), forest=OPEN, physics=Physics(slip_mean_m=1e9))
    results = [run_trial(replace(spec, algorithm=name)) for name in ("forest-pledge", "levy-walk", "cv-react")]
    assert len({(result.path_m, result.time_s) for result in results}) == 1
    assert {result.anomalies for result in results} == {0}
