"""An algorithm of the catalogue as the agent in the Gymnasium environment: what a trained agent has to beat.

Run it: pip install '.[gym]' && python examples/gym_forest_pledge.py [TRIAL] [ALGORITHM]
"""

import sys
from random import Random

import gymnasium
import numpy as np

from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import load_rover

trial = int(sys.argv[1]) if len(sys.argv) > 1 else 7
name = sys.argv[2] if len(sys.argv) > 2 else "forest-pledge"

rover = load_rover("sim")
handler = find_algorithm(name).make(rover.escape, rover.vehicle, Random(0))
env = gymnasium.make("wayfarer.experiments.gym:Wayfarer-Forest-v0")

_, info = env.reset(options={"trial": trial})
earned, over = 0.0, False
while not over:
    decision = handler.decide(info["observation"])
    _, reward, terminated, truncated, info = env.step(np.array(decision.wheels, np.float32))
    earned += float(reward)
    over = terminated or truncated
env.close()

ending = info["ending"]
print(
    f"trial {trial}, {name}: {ending.outcome} after {ending.path_m:.1f} m, {ending.time_s:.2f} s; earned {earned:.1f}"
)
