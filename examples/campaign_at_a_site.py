"""A small campaign at a site of the paper's field trials.

Run it: pip install '.[sim]' && python examples/campaign_at_a_site.py
"""

import wayfarer

# jobs=8 is for eight processes; the results are the same.
results = wayfarer.run_campaign("forest-pledge", trials=4, site="dense-obstruction", rover="minirover", jobs=1)
for row in results.trials:
    print(f"trial {row['trial']}: {row['outcome']} after {row['time_s']:.0f} s, helped {row['interventions']} times")
for row in results.summary:
    low, high = row["success_percent_low"], row["success_percent_high"]
    print(f"{row['algorithm']}: {row['success_percent']:.0f} % [{low:.0f}, {high:.0f}] got out")
