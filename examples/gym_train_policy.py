"""Trains a small policy in the Gymnasium environment with numpy alone, and scores it beside Forest-Pledge.

The policy steers for the goal, and does something else in the first seconds after an anomaly: what, are 19 numbers.
The cross-entropy method finds them: draw some policies, play each in the same trials, continue around the best ones.
Held-out trials (0 to 49, which training never draws) then say how good it is.

Run it: pip install '.[gym]' && python examples/gym_train_policy.py [GENERATIONS POPULATION TRIALS HELD_OUT]
"""

import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

import wayfarer

Floats = NDArray[np.float64]
Agent = Callable[[Floats, wayfarer.Observation], tuple[float, float]]

KNOTS_S = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 5.0])  # times since the last anomaly at which the policy has numbers
SIZE = 3 * KNOTS_S.size + 1
TICK_S = 0.05
ELITE = 0.25
BUDGET_M = 100.0  # of path: what is not out by then is not good


class Policy:
    """Speed, turn and pull towards the goal as functions of the time since the last anomaly, and the side of turns."""

    def __init__(self, numbers: Floats) -> None:
        self._speed, self._turn, self._pull = numbers[:-1].reshape(3, KNOTS_S.size)
        self._long_s = 10.0 * abs(numbers[-1])  # after a longer free time, the next turn is to the other side
        self._side, self._free_s = 1.0, KNOTS_S[-1]

    def __call__(self, seen: Floats, _: wayfarer.Observation) -> tuple[float, float]:
        """Return the duties for what was observed (the environment's 11 numbers)."""
        self._free_s += TICK_S
        if seen[4:10].any():
            if self._free_s > self._long_s:
                self._side = -self._side
            self._free_s = 0.0
        speed, turn, pull = (np.interp(self._free_s, KNOTS_S, knots) for knots in (self._speed, self._turn, self._pull))
        clockwise = turn * self._side - pull * np.arctan2(seen[0], seen[1]) / np.pi
        left, right = np.clip((speed + clockwise, speed - clockwise), -1.0, 1.0)
        return float(left), float(right)


def forest_pledge() -> Agent:
    """Return the catalogue's default algorithm as an agent."""
    rover = wayfarer.load_rover("sim")
    handler = wayfarer.make_handler("forest-pledge", vehicle=rover.vehicle, settings=rover.escape, seed=0)

    def act(_: Floats, observation: wayfarer.Observation) -> tuple[float, float]:
        left, right = handler.decide(observation).wheels
        return left, right

    return act


class Score(NamedTuple):
    """What an agent earned in a trial, and whether it got out."""

    reward: float
    out: bool


def play(env: Any, agent: Agent, trial: int) -> Score:
    """Let an agent play one trial."""
    seen, info = env.reset(options={"trial": trial})
    reward = 0.0
    while "ending" not in info:
        seen, gained, _, _, info = env.step(np.array(agent(seen, info["observation"]), np.float32))
        reward += float(gained)
    return Score(reward, info["ending"].outcome in {"escaped", "left_bounds"})


def scores(numbers: Floats | None, trials: list[int]) -> list[Score]:
    """Return the scores of a policy, or of Forest-Pledge for None."""
    env = gymnasium.make("wayfarer.gym:Wayfarer-Forest-v0", budget_m=BUDGET_M)
    agents = (forest_pledge() if numbers is None else Policy(numbers) for _ in trials)
    found = [play(env, agent, trial) for agent, trial in zip(agents, trials, strict=True)]
    env.close()
    return found


def first_guess() -> Floats:
    """Return a rule of thumb, from which training begins: back off, turn away, drive on, then steer for the goal."""
    speed, turn, pull = (-0.6, -0.6, 0.0, 0.5, 0.6, 0.7), (0.0, 0.0, 0.5, 0.2, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.3, 1.0)
    return np.array([*speed, *turn, *pull, 0.1])


def train(pool: ProcessPoolExecutor, generations: int, population: int, trials: int) -> Floats:
    """Return the numbers of the trained policy; ``trials`` is in how many each policy of a generation plays."""
    rng = np.random.default_rng(0)
    mean, spread = first_guess(), np.full(SIZE, 0.25)
    for generation in range(generations):
        drawn = [mean, *rng.normal(mean, spread, (population - 1, SIZE))]
        same = [rng.integers(1000, 1_000_000, trials).tolist()] * population
        earned = [np.mean([each.reward for each in found]) for found in pool.map(scores, drawn, same)]
        best = np.array(drawn)[np.argsort(earned)[-max(2, round(ELITE * population)) :]]
        mean, spread = best.mean(axis=0), 0.7 * best.std(axis=0) + 0.3 * spread
        print(f"generation {generation + 1}: best {max(earned):.1f}, mean {np.mean(earned):.1f}", flush=True)
    return mean


def report(pool: ProcessPoolExecutor, name: str, numbers: Floats | None, trials: int) -> None:
    """Print how an agent does in the held-out trials."""
    found = [score for (score,) in pool.map(scores, [numbers] * trials, [[trial] for trial in range(trials)])]
    out = sum(each.out for each in found)
    print(f"{name}: out of the forest in {out} of {trials}, mean reward {np.mean([each.reward for each in found]):.1f}")


if __name__ == "__main__":
    generations, population, trials, held_out = map(int, sys.argv[1:] or (6, 10, 6, 50))
    with ProcessPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
        trained = train(pool, generations, population, trials)
        print("policy:", np.round(trained, 2).tolist())
        report(pool, "rule of thumb", first_guess(), held_out)
        report(pool, "trained policy", trained, held_out)
        report(pool, "forest-pledge", None, held_out)
