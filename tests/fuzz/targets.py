"""All targets, in the order in which they are fuzzed."""

from __future__ import annotations

from tests.fuzz import on_command, on_control, on_files, on_gpsd, on_live, on_logs, on_parts
from tests.fuzz.target import Target

MODULES = (on_control, on_files, on_logs, on_parts, on_gpsd, on_live, on_command)
TARGETS = tuple(each for module in MODULES for each in vars(module).values() if isinstance(each, Target))
