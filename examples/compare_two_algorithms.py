"""Two algorithms in the same reference forests with the same noise: which is better, and how sure is that.

Run it: pip install '.[sim]' && python examples/compare_two_algorithms.py
"""

import wayfarer

both = ["forest-pledge", "retry-pledge"]
results = wayfarer.run_campaign(both, trials=4, forests="reference", slip_mean_m=2.0)
for row in wayfarer.compare(results, against="forest-pledge"):
    print(f"{row['algorithm']}: SPL {row['spl']:.3f} over {row['trials']} trials")
    if row["spl_change_low"] is not None:
        change, low, high = row["spl_change"], row["spl_change_low"], row["spl_change_high"]
        print(f"change of SPL in pairs: {change:+.3f} [{low:+.3f}, {high:+.3f}], 95 %; four trials prove little")
