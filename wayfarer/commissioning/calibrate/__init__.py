"""Guided calibration, ``wayfarer calibrate``: compass, motion sensor, motor magnetic field, turning.

What was found is kept in the calibration file (``wayfarer.config.calibration_file``) with its date and part; the
compass keeps its own profile besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from wayfarer.commissioning.calibrate.compass import calibrate_compass, calibrate_motors
from wayfarer.commissioning.calibrate.flow import calibrate_flow
from wayfarer.commissioning.calibrate.turning import calibrate_turning
from wayfarer.commissioning.checks.api import HostEnvironment, StandaloneInspection
from wayfarer.commissioning.manual_drive import Operator
from wayfarer.config.calibration_file import Calibration, load, save
from wayfarer.config.rover_file import RoverConfig
from wayfarer.hal import Rover

__all__ = ["STEPS", "Operator", "Step", "calibrate"]

Step = Literal["compass", "flow", "motors", "turning"]
STEPS: tuple[Step, ...] = ("compass", "flow", "motors", "turning")


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
            before, calibration = calibration, await _take(step, calibration, inspection, operator)
            if calibration is before:
                await operator.say(f"{step}: left as it was.")
                continue
            save(host.calibration_file, calibration)
            await operator.say(f"{step}: saved in {host.calibration_file}.")
    return calibration


async def _take(step: Step, known: Calibration, inspection: StandaloneInspection, operator: Operator) -> Calibration:
    """Return what is known after a step; the same where the person declined, or the rover has no such part."""
    rover, t_wall = inspection.rover, inspection.host.t_wall
    if step == "flow":
        if rover.motion is None:
            return known
        await inspection.open("motion")
        flow = await calibrate_flow(rover.motion, operator, inspection.config.detector.quality_min, t_wall)
        return replace(known, flow=flow)
    await inspection.open("compass")
    if step == "compass":
        return replace(known, compass=await calibrate_compass(rover.compass, operator, t_wall))
    await inspection.open("motors")
    if step == "turning":
        turning = await calibrate_turning(known, inspection, operator)
        return known if turning is None else replace(known, turning=turning)
    shift = await calibrate_motors(rover.motors, rover.compass, operator, t_wall, inspection.config.safety.duty_max)
    return known if shift is None else replace(known, motors=shift)
