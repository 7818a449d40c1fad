"""What went wrong on a run: every anomaly of a field log, with where the rover was looking.

Run it: python examples/anomalies_in_a_field_log.py [RUN]
"""

import sys
from pathlib import Path

import wayfarer

LOGS = Path(__file__).parents[1] / "field_logs"

run = wayfarer.open_run(sys.argv[1] if len(sys.argv) > 1 else "last", log_dir=LOGS)
before: set[str] = set()
for tick in run.ticks:
    now = set(tick["anomalies"] or ())
    for anomaly in sorted(now - before):
        print(f"{tick['elapsed_s']:8.2f} s  {anomaly:12} at {tick['heading_deg']:5.1f} deg, {tick['why']}")
    before = now
print(f"log: {run.damage}")  # complete, or what is missing
