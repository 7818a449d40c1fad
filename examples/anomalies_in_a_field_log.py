"""What went wrong on a run: every anomaly of a field log, with where the rover was looking.

Run it: python examples/anomalies_in_a_field_log.py [RUN]
"""

import sys
from pathlib import Path

from wayfarer.fieldlog.folders import find_run
from wayfarer.fieldlog.reader import RunReader

LOGS = Path(__file__).parents[1] / "field_logs"

reader = RunReader(find_run(sys.argv[1] if len(sys.argv) > 1 else "last", LOGS))
before: set[str] = set()
for record in reader:
    if record["record"] == "tick":
        now = set(record.get("anomalies", ()))
        for anomaly in sorted(now - before):
            print(f"{record['t_s']:8.2f} s  {anomaly:12} at {record['heading_deg']:5.1f} deg, {record['why']}")
        before = now
print(f"log: {reader.damage}")  # known once all was read: whole, or what is missing
