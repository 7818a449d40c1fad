"""An algorithm of the catalogue as the agent in the Gymnasium environment: what a trained agent has to beat.

Run it: pip install '.[gym]' && python examples/gym_forest_pledge.py [TRIAL [ALGORITHM]]
"""

import sys
from random import Random

import gymnasium
import numpy as np

from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import load_rover

given = dict(enumerate(sys.argv))
trial, name = int(given.get(1, 7)), given.get(2, "forest-pledge")
rover = load_rover("sim")
handler = find_algorithm(name).make(rover.escape, rover.vehicle, Random(0))
env = gymnasium.make("wayfarer.experiments.gym:Wayfarer-Forest-v0")

_, info = env.reset(options={"trial": trial})
earned = 0.0
while "ending" not in info:
    decision = handler.decide(info["observation"])
    _, reward, _, _, info = env.step(np.array(decision.wheels, np.float32))
    earned += float(reward)
env.close()
end = info["ending"]
print(f"trial {trial}, {name}: {end.outcome} after {end.path_m:.1f} m, {end.time_s:.2f} s; earned {earned:.1f}")
