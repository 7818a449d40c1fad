"""A trajectory looks on, changes nothing, and leaves out nothing that one would see."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import hypot

import pytest

from wayfarer.config.rover_file import load_rover
from wayfarer.errors import UnknownName
from wayfarer.escape.api import Phase
from wayfarer.experiments.trial import TrialResult, run_trial
from wayfarer.experiments.trial_log import KEPT_EVERY_M, TrackLog, Trajectory
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.simhal.world.forest import CLEARING, Trunk
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics

SPEC = TrialSpec(0, "forest-pledge", generate_forest(1, 0, 0), 5, load_rover("sim"))
TICK_M = 1.4 / 20  # the rover's full speed for one control period


def run_with_trajectory(spec: TrialSpec) -> tuple[TrialResult, Trajectory]:
    track = TrackLog()
    return run_trial(spec, track=track), track.trajectory()


@pytest.fixture(scope="module")
def traced() -> tuple[TrialResult, Trajectory]:
    return run_with_trajectory(SPEC)


def steps_m(trajectory: Trajectory) -> list[float]:
    return [hypot(after.x_m - point.x_m, after.y_m - point.y_m) for point, after in pairwise(trajectory.points)]


def test_looking_on_changes_nothing(traced: tuple[TrialResult, Trajectory]) -> None:
    assert traced[0] == run_trial(SPEC)


def test_trace_leads_from_the_start_over_the_goal_line(traced: tuple[TrialResult, Trajectory]) -> None:
    result, trajectory = traced
    assert result.outcome == "escaped"
    assert trajectory.points[0][:2] == SPEC.forest.start_m
    assert trajectory.points[-1].y_m >= SPEC.forest.goal_y_m
    assert trajectory.points[-1].phase is Phase.HALT


def test_points_are_thinned_and_leave_no_gap(traced: tuple[TrialResult, Trajectory]) -> None:
    result, trajectory = traced
    assert len(trajectory.points) < result.ticks / 3
    assert max(steps_m(trajectory)) < KEPT_EVERY_M + TICK_M
    assert 0.9 * result.path_m < sum(steps_m(trajectory)) <= result.path_m + 1e-6


def test_every_anomaly_is_a_change_to_backing_off(traced: tuple[TrialResult, Trajectory]) -> None:
    result, trajectory = traced
    phases = [point.phase for point in trajectory.points]
    begun = sum(now is Phase.BACK_OFF and before is not now for before, now in pairwise(phases))
    assert begun == result.anomalies


def test_slips_are_kept_once_each_where_they_were() -> None:
    result, trajectory = run_with_trajectory(replace(SPEC, forest=CLEARING))
    assert len(trajectory.slips_m) == result.anomalies > 0  # nothing else can be wrong in a clearing
    for slip_x_m, slip_y_m in trajectory.slips_m:
        assert min(hypot(point.x_m - slip_x_m, point.y_m - slip_y_m) for point in trajectory.points) < KEPT_EVERY_M


def test_without_slips_there_are_none() -> None:
    wall = replace(CLEARING, trunks=(Trunk(20.0, 25.0, 30.0, 25.0, "across"),))
    result, trajectory = run_with_trajectory(replace(SPEC, forest=wall, physics=Physics(slip_mean_m=1e9)))
    assert result.anomalies > 0
    assert trajectory.slips_m == []


def test_algorithm_that_is_gone_raises_as_in_a_trial() -> None:
    with pytest.raises(UnknownName):
        run_with_trajectory(replace(SPEC, algorithm="gone"))
