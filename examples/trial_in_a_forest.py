"""One trial in one generated forest: what `wayfarer sim` does a thousand times, from Python.

Run it: pip install '.[sim]' && python examples/trial_in_a_forest.py [LAYOUT]
"""

import sys
from dataclasses import replace

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.shortest_path import shortest_path_m

layout = int(sys.argv[1]) if len(sys.argv) > 1 else 7
forest = generate_forest(layout, noise=0, seed=0)
forest = replace(forest, shortest_path_m=shortest_path_m(forest))  # with it a trial has an SPL
print(f"layout {layout}: {len(forest.trunks)} trunks, {len(forest.trees_m)} trees")

rover = load_rover("sim")  # a shipped rover; load_rover("./my-rover.toml") is yours
spec = TrialSpec(trial=0, algorithm="forest-pledge", forest=forest, seed=1, rover=rover)
for column, value in run_trial(spec)._asdict().items():
    if value is not None:
        print(f"{column:16} {value}")
