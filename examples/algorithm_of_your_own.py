"""An algorithm of your own: Forest-Pledge with the other hand on the wall, checked and tried in a forest.

Run it: python examples/algorithm_of_your_own.py
Or, in this folder: PYTHONPATH=. wayfarer sim --algorithm algorithm_of_your_own:left_hand --trials 10
"""

import wayfarer
from wayfarer.escape.api import COUNTER_CLOCKWISE
from wayfarer.escape.catalogue import Algorithm, fixed_angle
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler
from wayfarer.escape.phases import PLEDGE
from wayfarer.testing import check_algorithm

spec = AlgorithmSpec(PLEDGE, side=lambda *_: COUNTER_CLOCKWISE, angle=fixed_angle, resets=True, keeps_side=True)
left_hand = Algorithm(
    "left-hand", "pledge", "Forest-Pledge with the other hand", lambda *given: PhasedHandler(spec, *given)
)

if __name__ == "__main__":
    check_algorithm(left_hand)
    row = wayfarer.run_trial(7, "algorithm_of_your_own:left_hand").row
    print(f"{row.algorithm}: {row.outcome} after {row.path_m:.1f} m, {row.anomalies} anomalies")
