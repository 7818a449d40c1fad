"""A field log through today's code, and again with a detector that waits longer: where do the decisions differ.

Run it: python examples/replay_a_log.py [RUN]
"""

import sys
from dataclasses import replace
from pathlib import Path

from wayfarer.config.rover_file import load_rover
from wayfarer.fieldlog.folders import find_run
from wayfarer.fieldlog.replay import replay

LOGS = Path(__file__).parents[1] / "field_logs"

run = find_run(sys.argv[1] if len(sys.argv) > 1 else "last", LOGS)
today = replay(run)
print(f"as logged: {today.ticks} decisions, then {today.difference or 'the end'}")

rover = load_rover("sim")
patient = rover.model_copy(update={"detector": replace(rover.detector, immobilised_s=1.0)})
other = replay(run, patient)
print(f"patient:   {other.ticks} decisions, then {other.difference or 'the end'}")
