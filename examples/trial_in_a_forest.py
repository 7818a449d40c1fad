"""One trial in one generated forest: what `wayfarer sim` does a thousand times, from Python.

Run it: pip install '.[sim]' && python examples/trial_in_a_forest.py [TRIAL]
"""

import sys

import wayfarer

trial = wayfarer.run_trial(int(sys.argv[1]) if len(sys.argv) > 1 else 7, spl=True)
for column, value in trial.row._asdict().items():
    if value is not None:
        print(f"{column:16} {value}")
probes = [tick for tick in trial.track if tick["phase"] == "probe"]
print(
    f"it probed for {len(probes) / 20:.1f} s, the first time at x {probes[0]['x_m']:.1f} m, y {probes[0]['y_m']:.1f} m"
)
