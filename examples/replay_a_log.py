"""A field log through today's code, and again with a detector that waits longer: where do the decisions differ.

Run it: python examples/replay_a_log.py [RUN]
"""

import sys
from dataclasses import replace
from pathlib import Path

import wayfarer

LOGS = Path(__file__).parents[1] / "field_logs"

run = wayfarer.open_run(sys.argv[1] if len(sys.argv) > 1 else "last", log_dir=LOGS)
today = wayfarer.replay(run)
print(f"as logged: {today.ticks} decisions, then {today.difference or 'the end'}")

rover = wayfarer.load_rover("sim")
patient = rover.model_copy(update={"detector": replace(rover.detector, immobilised_s=1.0)})
other = wayfarer.replay(run, rover=patient)
print(f"patient:   {other.ticks} decisions, then {other.difference or 'the end'}")
