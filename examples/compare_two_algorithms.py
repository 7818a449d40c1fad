"""Two algorithms in the same reference forests with the same noise: which is better, and how sure is that.

Run it: pip install '.[sim]' && python examples/compare_two_algorithms.py
"""

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.campaign import Campaign, read_forest_file
from wayfarer.experiments.paired_statistics import compare
from wayfarer.experiments.rows import row_of
from wayfarer.experiments.trial import run_trial

BOTH = ("forest-pledge", "tight-pledge")

campaign = Campaign(BOTH, trials=4, rover=load_rover("sim"), slip_mean_m=2.0, forests=read_forest_file("reference"))
rows = [row_of(run_trial(campaign.spec(task, campaign.make_forest(task.trial)))) for task in campaign.tasks_by_forest()]
for one in compare(rows, against="forest-pledge"):
    print(f"{one.algorithm}: SPL {one.spl:.3f} over {one.trials} trials, the longest {one.worst.path_m:.0f} m")
    if one.spl_gain is not None:
        mean, low, high = one.spl_gain.estimate
        print(f"gain of SPL in pairs: {mean:+.3f} [{low:+.3f}, {high:+.3f}], 95 %; four trials prove little")
