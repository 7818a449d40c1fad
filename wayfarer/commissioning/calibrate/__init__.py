"""Guided calibration, ``wayfarer calibrate``: compass, motion sensor, motor magnetic field.

What was found is kept in the calibration file (``wayfarer.config.calibration_file``) with its date and part; the
compass keeps its own profile besides.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from wayfarer.commissioning.calibrate.compass import calibrate_compass, calibrate_motors
from wayfarer.commissioning.calibrate.flow import calibrate_flow
from wayfarer.commissioning.checks.api import HostEnvironment, StandaloneInspection
from wayfarer.commissioning.manual_drive import Operator
from wayfarer.config.calibration_file import Calibration, load, save
from wayfarer.config.rover_file import RoverConfig
from wayfarer.hal import Rover

__all__ = ["STEPS", "Operator", "Step", "calibrate"]

Step = Literal["compass", "flow", "motors"]
STEPS: tuple[Step, ...] = ("compass", "flow", "motors")

# The parts that each step opens, and what measures it with them and returns its entry: None where the person declines.
_STEPS: Mapping[Step, tuple[tuple[str, ...], Callable[[StandaloneInspection, Operator], Awaitable[Any]]]] = {
    "compass": (("compass",), calibrate_compass),
    "flow": (("motion",), calibrate_flow),
    "motors": (("compass", "motors"), calibrate_motors),
}


async def calibrate(
    config: RoverConfig, rover: Rover, host: HostEnvironment, operator: Operator, steps: Sequence[Step] = STEPS
) -> Calibration:
    """Guide a person through some steps, and return what is known afterwards; each step is saved when it is done.

    Args:
        config: the rover file.
        rover: its parts, not open, without an earlier calibration applied; they are closed afterwards.
        host: where the calibration file is, and the time.
        operator: turns and pushes the rover; wheels turn only after a yes.
        steps: in this order.

    Raises:
        BadInput: the calibration file is there and cannot be read, or an answer is of no use.
        DriverError: a part does not open, or stopped answering.
        WayfarerError: what was measured cannot be used, or the file cannot be written.
    """
    calibration = load(host.calibration_file)
    async with StandaloneInspection(config, rover, host) as inspection:
        for step in steps:
            entry = await _measure(step, inspection, operator)
            if entry is None:
                await operator.say(f"{step}: left as it was.")
                continue
            calibration = replace(calibration, **{step: entry})
            save(host.calibration_file, calibration)
            await operator.say(f"{step}: saved in {host.calibration_file}.")
    return calibration


async def _measure(step: Step, inspection: StandaloneInspection, operator: Operator) -> Any:
    """Return the entry that a step found; None where the person declined, or the rover has no such part."""
    parts, measure = _STEPS[step]
    if any(part not in inspection.rover.parts for part in parts):
        return None
    for part in parts:
        await inspection.open(part)
    return await measure(inspection, operator)
