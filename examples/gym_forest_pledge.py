"""An algorithm of the catalogue as the agent in the Gymnasium environment: what a trained agent has to beat.

Run it: pip install '.[gym]' && python examples/gym_forest_pledge.py [TRIAL [ALGORITHM]]
"""

import sys

import gymnasium
import numpy as np

import wayfarer

given = dict(enumerate(sys.argv))
trial, name = int(given.get(1, "7")), given.get(2, "forest-pledge")
rover = wayfarer.load_rover("sim")
handler = wayfarer.make_handler(name, vehicle=rover.vehicle, settings=rover.escape, seed=0)
env = gymnasium.make("wayfarer.gym:Wayfarer-Forest-v0")

_, info = env.reset(options={"trial": trial})
earned = 0.0
while "ending" not in info:
    decision = handler.decide(info["observation"])
    _, reward, _, _, info = env.step(np.array(decision.wheels, np.float32))
    earned += float(reward)
env.close()
end = info["ending"]
print(f"trial {trial}, {name}: {end.outcome} after {end.path_m:.1f} m, {end.time_s:.2f} s; earned {earned:.1f}")
