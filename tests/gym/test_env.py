"""The Gymnasium environment: its contract, and that it is the simulator's own trial."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env

from tests.gym.agents import AHEAD, ahead, duties, play
from wayfarer.config import registry
from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadConfig, BadInput
from wayfarer.escape.api import Anomaly, EscapeHandler
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.checks import make_campaign
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.gym import ENV_ID
from wayfarer.gym.env import HELD_BACK, AgentBridge, ForestEnv
from wayfarer.hal import STOP, WheelCommand
from wayfarer.simhal.random_streams import RandomStreams

pytest.importorskip("mujoco", reason="mujoco is not installed")  # now: its first import starts a process
SIM = load_rover("sim")


@pytest.fixture
def env() -> Iterator[ForestEnv]:
    env = ForestEnv()
    yield env
    env.close()


def spec_of(algorithm: str, trial: int) -> TrialSpec:
    """The trial as ``wayfarer sim`` runs it."""
    campaign = Campaign((algorithm,), trial + 1, SIM)
    return campaign.spec(Task(algorithm, trial), campaign.make_forest(trial))


def handler_of(spec: TrialSpec) -> EscapeHandler:
    rng = RandomStreams(spec.seed).random("algorithm")
    return find_algorithm(spec.algorithm).make(SIM.escape, SIM.vehicle, rng)


# -- Gymnasium's contract --------------------------------------------------------------------------------------------


def test_gymnasiums_own_checker_has_nothing_to_say() -> None:
    """Warnings are errors in these tests, so it must not even warn."""
    env = gymnasium.make(ENV_ID, render_mode="rgb_array")
    check_env(env.unwrapped)
    env.close()


def test_picture_shows_the_rover_on_its_way_and_stays_after_the_end() -> None:
    env = ForestEnv(budget_m=3.0, render_mode="rgb_array")
    with pytest.raises(ResetNeeded):
        env.render()
    env.reset(options={"trial": 6})
    first = env.render()
    play(env, ahead, options={"trial": 6})
    last = env.render()
    assert first is not None
    assert last is not None
    assert first.shape == last.shape == (480, 480, 3)
    assert first.dtype == last.dtype == np.uint8
    orange = (last == (255, 138, 36)).all(axis=2)
    assert 2.0 < 50.0 / 480.0 * np.ptp(np.nonzero(orange)[0]) < 4.0, "3 m, less the dot at its end"
    assert not (first == (255, 138, 36)).all(axis=2).any()
    assert ForestEnv().render() is None
    with pytest.raises(BadInput, match="render_mode 'human' is not known"):
        ForestEnv(render_mode="human")


@pytest.mark.process
def test_environment_is_found_by_the_name_of_its_module() -> None:
    name = "wayfarer.gym:Wayfarer-Forest-v0"
    code = f"import gymnasium as g; e = g.make({name!r}); print(len(e.reset(seed=1)[0]))"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("11\n", "")


def test_vector_of_environments_plays_the_same_episodes_as_each_alone(env: ForestEnv) -> None:
    together = gymnasium.make_vec(ENV_ID, num_envs=2, vectorization_mode="sync")
    together.reset(seed=5)  # and 6
    seen, *_ = together.step(np.array([AHEAD, AHEAD], np.float32))
    for index, seed in enumerate((5, 6)):
        env.reset(seed=seed)
        alone, *_ = env.step(duties(AHEAD))
        assert np.array_equal(alone, seen[index])
    together.close()


def test_step_before_reset_and_after_the_end_asks_for_a_reset(env: ForestEnv) -> None:
    with pytest.raises(ResetNeeded):
        env.step(duties(STOP))
    env.reset(seed=1)
    env.close()
    with pytest.raises(ResetNeeded):
        env.step(duties(STOP))


@pytest.mark.parametrize("action", [[0.5], [0.5, 0.5, 0.5], [[0.5, 0.5]], 0.5])
def test_action_of_another_shape_is_refused_and_the_episode_goes_on(env: ForestEnv, action: Any) -> None:
    env.reset(seed=1)
    with pytest.raises(InvalidAction, match="two duties"):
        env.step(np.array(action, np.float32))
    env.step(duties(AHEAD))


@pytest.mark.parametrize("action", [("a", "b"), (0.5, 1j)])
def test_action_that_is_no_numbers_is_refused(env: ForestEnv, action: Any) -> None:
    env.reset(seed=1)
    with pytest.raises(InvalidAction, match="two duties"):
        env.step(action)


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, np.bool_, np.array])
def test_numbers_of_numpy_are_numbers(env: ForestEnv, kind: Callable[[int], Any]) -> None:
    env.reset(seed=int(kind(1)), options={"trial": np.int64(6)})
    seen, *_ = env.step([kind(1), kind(0)])  # type: ignore[arg-type]
    env.reset(options={"trial": 6})
    other, *_ = env.step(duties(WheelCommand(1.0, 0.0)))
    assert np.array_equal(seen, other)


FORKED = """
import os, sys
from wayfarer.gym.env import ForestEnv
env = ForestEnv()
env.reset(options={"trial": 6})
child = os.fork()
if child == 0:
    try:
        env.step([0.5, 0.5])
    except Exception as error:
        print(type(error).__name__, error, flush=True)
    env.reset(options={"trial": 7})
    env.step([0.5, 0.5])
    print("its own", flush=True)
    sys.exit()
assert os.waitpid(child, 0)[1] == 0
env.step([0.5, 0.5])
print("ours", flush=True)
"""


@pytest.mark.process
def test_episode_is_not_shared_with_a_forked_process_which_may_begin_its_own() -> None:
    done = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, timeout=30, check=True)
    refused, *others = done.stdout.splitlines()
    assert refused.startswith("ResetNeeded the episode is process ")
    assert refused.endswith(": call reset() here, or make the environment here")
    assert others == ["its own", "ours"]


@pytest.mark.parametrize("trial", [-1, 1_000_000, "seven", 1.5])
def test_trial_that_there_is_not_is_refused(env: ForestEnv, trial: Any) -> None:
    with pytest.raises(BadInput, match="whole number from 0"):
        env.reset(options={"trial": trial})


# -- it is the simulator's trial -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("algorithm", "trial"), [("forest-pledge", 6), ("forest-pledge", 8), ("levy-walk", 7)])
def test_algorithm_of_the_catalogue_drives_here_as_it_does_in_a_trial(
    env: ForestEnv, algorithm: str, trial: int
) -> None:
    """The same way to the last digit: one step is one tick of the same supervisor, detector and gate."""
    spec = spec_of(algorithm, trial)
    handler = handler_of(spec)
    ending = play(env, lambda seen: handler.decide(seen).wheels, options={"trial": trial}).ending
    result = run_trial(spec)
    assert (ending.outcome, ending.path_m, ending.time_s, ending.ticks) == (
        result.outcome, result.path_m, result.time_s, result.ticks,
    )  # fmt: skip


@pytest.mark.parametrize("duty_max", [0.1, 1.0])
def test_safety_gate_limits_duties(tmp_path: Path, duty_max: float) -> None:
    shipped = (Path(registry.__file__).parents[1] / "rovers/sim.toml").read_text(encoding="utf-8")
    rover = tmp_path / "limited.toml"
    rover.write_text(shipped.replace("[safety]", f"[safety]\nduty_max = {duty_max}"), encoding="utf-8")
    env = ForestEnv(rover=str(rover))
    _, info = env.reset(options={"trial": 6})
    before_m = info["observation"].travelled_m
    for _ in range(10):
        _, _, _, _, info = env.step(duties(WheelCommand(50.0, 50.0)))
    env.close()
    assert 0.0 < info["observation"].travelled_m - before_m <= duty_max * 10 * 0.05 * SIM.vehicle.max_speed_m_s


@pytest.mark.parametrize("duty", [float("nan"), float("inf")])
def test_duty_that_is_no_number_is_a_fault_and_the_wheels_stand(env: ForestEnv, duty: float) -> None:
    env.reset(options={"trial": 6})
    _, reward, terminated, truncated, info = env.step(duties(WheelCommand(duty, 0.5)))
    assert (terminated, truncated, info["ending"].outcome) == (True, False, "fault")
    assert info["ending"].path_m == 0.0
    assert reward == pytest.approx(-10.0, abs=0.1)


# -- episodes --------------------------------------------------------------------------------------------------------


def test_same_seed_plays_the_same_episode_and_each_further_reset_another(env: ForestEnv) -> None:
    def steer_on(seed: int | None) -> tuple[int, ...]:
        _, info = env.reset(seed=seed)
        return info["trial"], *(env.step(duties(AHEAD))[1] for _ in range(20))

    first, again, *others = map(steer_on, (3, 3, None, None, 4))
    assert first == again
    assert len({first, *others}) == 4


def test_trials_that_algorithms_are_measured_on_are_never_drawn(
    env: ForestEnv, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wayfarer.gym.env.TRIALS", HELD_BACK + 2)
    env.reset(seed=1)
    assert {env.reset()[1]["trial"] for _ in range(12)} == {HELD_BACK, HELD_BACK + 1}
    assert env.reset(options={"trial": 0})[1]["trial"] == 0


def test_observation_is_what_the_rover_feels(env: ForestEnv) -> None:
    """Against a trunk: the heading as the compass has it, and the anomaly in its place, the distance starting again."""
    episode_vector, info = env.reset(options={"trial": 8})
    for _ in range(2000):
        seen = info["observation"]
        assert env.observation_space.contains(episode_vector)
        off_rad = radians(seen.heading_deg)
        assert episode_vector[:2] == pytest.approx((sin(off_rad), cos(off_rad)), abs=1e-6)
        assert list(episode_vector[4:10]) == [float(anomaly in seen.anomalies) for anomaly in Anomaly]
        if seen.anomalies:
            break
        assert episode_vector[10] == pytest.approx(min(seen.travelled_m / 10.0, 1.0), abs=1e-6)
        episode_vector, _, _, _, info = env.step(duties(AHEAD))
    assert seen.anomalies
    assert episode_vector[10] == 0.0


def test_reward_is_progress_less_time_and_a_bonus_for_the_way_out(env: ForestEnv) -> None:
    spec = spec_of("forest-pledge", 7)
    handler = handler_of(spec)
    episode = play(env, lambda seen: handler.decide(seen).wheels, options={"trial": 7})
    assert (episode.terminated, episode.truncated, episode.ending.outcome) == (True, False, "escaped")
    assert sum(episode.rewards) == pytest.approx(37.5 - 0.1 * episode.ending.time_s + 10.0, abs=0.2)


def test_out_of_budget_is_truncated_without_a_penalty() -> None:
    episode = play(ForestEnv(budget_m=3.0), ahead, options={"trial": 6})
    assert (episode.terminated, episode.truncated, episode.ending.outcome) == (False, True, "entrapped")
    assert sum(episode.rewards) == pytest.approx(3.0, abs=0.6)


def test_rover_that_gives_up_by_itself_is_terminated_at_once() -> None:
    """Its wheels spin on slippery ground and it never backs off: its own watch over progress disarms it."""
    episode = play(ForestEnv(slip_mean_m=0.1), ahead, options={"trial": 6})
    assert (episode.terminated, episode.truncated, episode.ending.outcome) == (True, False, "entrapped")
    assert episode.ending.time_s < 70.0
    assert episode.rewards[-1] < -9.0


def test_rover_that_climbs_a_trunk_tips_over(env: ForestEnv) -> None:
    episode = play(env, ahead, options={"trial": 0})
    assert (episode.terminated, episode.truncated, episode.ending.outcome) == (True, False, "tipped")
    assert episode.rewards[-1] < -9.0


# -- threads ---------------------------------------------------------------------------------------------------------


def trials_running() -> int:
    return sum(thread.name == "wayfarer trial" for thread in threading.enumerate())


def test_no_trial_outlives_its_episode() -> None:
    before = trials_running()
    env = ForestEnv(budget_m=1.0)
    env.reset(seed=1)
    env.reset(seed=2)
    assert trials_running() == before + 1
    play(env, ahead, seed=3)
    assert trials_running() == before
    env.reset(seed=4)
    env.close()
    env.close()
    assert trials_running() == before


def test_environment_that_is_forgotten_takes_its_trial_with_it() -> None:
    before = trials_running()
    env = ForestEnv()
    env.reset(seed=1)
    del env
    assert trials_running() == before


def test_what_goes_wrong_in_the_trial_is_told_to_the_agent(env: ForestEnv, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("the algorithm broke")

    env.reset(seed=1)
    monkeypatch.setattr(AgentBridge, "decide", fail)
    for _ in range(2):  # it does not wait for ever for a trial that is no more
        with pytest.raises(RuntimeError, match="the algorithm broke"):
            env.step(duties(AHEAD))
    monkeypatch.undo()
    env.reset(seed=1)
    env.step(duties(AHEAD))


# -- in MuJoCo -------------------------------------------------------------------------------------------------------


def test_with_its_settings_the_body_moves_in_mujoco_on_the_ground_of_that_trial() -> None:
    from wayfarer.simhal.mujoco.world import MujocoWorld

    settings: dict[str, Any] = {"physics": "mujoco", "set": {"sim.friction": (0.2, 0.8)}}
    env = gymnasium.make(ENV_ID, **settings).unwrapped
    assert isinstance(env, ForestEnv)
    gained_m = []
    for trial in (0, 2, 0):
        env.reset(options={"trial": trial})
        assert env._bridge is not None
        world = env._bridge.world
        assert isinstance(world, MujocoWorld)
        assert {"sim.friction": world.terrain.friction} == make_campaign(settings).drawn(trial)
        began_m = world.y_m
        for _ in range(10):
            env.step(duties(AHEAD))
        gained_m.append(world.y_m - began_m)
    env.close()
    assert min(gained_m) > 0.02
    assert gained_m[0] == gained_m[2] != gained_m[1]


def test_rover_without_a_body_is_refused_for_mujoco_before_the_first_episode(tmp_path: Path) -> None:
    file = tmp_path / "plain.toml"
    file.write_text(
        'name = "plain"\n[vehicle]\nlength_m = 0.4\nwidth_m = 0.4\ntrack_m = 0.5\nmax_speed_m_s = 1.4\n',
        encoding="utf-8",
    )
    ForestEnv(str(file)).close()
    with pytest.raises(BadConfig, match=r"rover 'plain' has no chassis\.weight_kg"):
        ForestEnv(str(file), physics="mujoco")
