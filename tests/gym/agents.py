"""Agents for the environment, and an episode driven by one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from wayfarer.escape.api import Observation
from wayfarer.gym.env import Array, Ending, ForestEnv
from wayfarer.hal import WheelCommand

Agent = Callable[[Observation], WheelCommand]
AHEAD = WheelCommand(0.7, 0.7)


class Episode(NamedTuple):
    """What an agent went through: all rewards, and how it ended."""

    rewards: list[float]
    terminated: bool
    truncated: bool
    ending: Ending


def duties(wheels: WheelCommand) -> Array:
    return np.array(wheels, np.float32)


def ahead(_: Observation) -> WheelCommand:
    return AHEAD


def play(env: ForestEnv, agent: Agent, steps_max: int = 100_000, **reset: Any) -> Episode:
    """Let an agent play one episode to its end."""
    _, info = env.reset(**reset)
    rewards = []
    for _ in range(steps_max):
        _, reward, terminated, truncated, info = env.step(duties(agent(info["observation"])))
        rewards.append(reward)
        if terminated or truncated:
            return Episode(rewards, terminated, truncated, info["ending"])
    raise AssertionError(f"still on its way after {steps_max} steps")
