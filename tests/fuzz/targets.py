"""All targets, in the order in which they are fuzzed."""

from __future__ import annotations

from tests.fuzz import on_command, on_control, on_files, on_gpsd, on_live, on_logs, on_parts

TARGETS = (
    on_control.PROTOCOL,
    on_control.SERVER,
    on_control.CLIENT,
    on_files.ROVER,
    on_files.STOPPING,
    on_files.CALIBRATIONS,
    on_files.SCENARIO,
    on_files.FOREST,
    on_files.RESULTS,
    on_logs.STORY,
    on_logs.EXPORT,
    on_logs.REPLAY,
    on_logs.RUN_READING,
    on_logs.REPORT,
    on_parts.COMPASS,
    on_parts.FLOW,
    on_parts.BOARD,
    on_parts.LIGHT,
    on_parts.CAMERA,
    on_gpsd.GPSD,
    on_live.LIVE,
    on_live.ACCESS,
    on_command.COMMAND,
    on_command.ANSWER,
    on_command.ENVIRONMENT,
)
