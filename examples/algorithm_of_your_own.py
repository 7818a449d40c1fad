"""An algorithm of your own: Forest-Pledge with the other hand on the wall, checked and tried in a forest.

Run it: python examples/algorithm_of_your_own.py
Or, in this folder: PYTHONPATH=. wayfarer sim --algorithm algorithm_of_your_own:left_hand --trials 10
"""

from wayfarer.config.rover_file import load_rover
from wayfarer.escape.catalogue import Algorithm
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler
from wayfarer.escape.phases import PLEDGE
from wayfarer.escape.policies import COUNTER_CLOCKWISE, fixed_angle
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.testing import check_algorithm

spec = AlgorithmSpec(PLEDGE, side=lambda *_: COUNTER_CLOCKWISE, angle=fixed_angle, resets=True, keeps_side=True)
left_hand = Algorithm(
    "left-hand", "pledge", "Forest-Pledge with the other hand", lambda *given: PhasedHandler(spec, *given)
)

if __name__ == "__main__":
    check_algorithm(left_hand)
    forest, rover = generate_forest(7, noise=0, seed=0), load_rover("sim")
    result = run_trial(TrialSpec(0, "algorithm_of_your_own:left_hand", forest, seed=1, rover=rover))
    print(f"{result.algorithm}: {result.outcome} after {result.path_m:.1f} m, {result.anomalies} anomalies")
