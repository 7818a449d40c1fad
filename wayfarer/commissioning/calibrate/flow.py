"""Calibration of the motion sensor: push the rover a known distance, and compare.

Published scales of the PMW3901 differ by half (hardware.md 2.6), and the lens height on a rover is a guess; one push of
two metres corrects both. Signs and axes are not corrected but refused, with the setting to change: a sensor that is
mounted otherwise than the rover file says is wrong sideways as well. A camera that only sees that something changes
is calibrated in another way (``camera``).
"""

from __future__ import annotations

from wayfarer.commissioning.calibrate.camera import ChangeSensor, calibrate_picture
from wayfarer.commissioning.calibrate.response import UNSEEN_MAX
from wayfarer.commissioning.checks.api import CheckVerdict
from wayfarer.commissioning.checks.motion import judge_push
from wayfarer.commissioning.manual_drive import measure_push
from wayfarer.commissioning.operator import Operator
from wayfarer.config.calibration_file import SCALE_MAX, SCALE_MIN, FlowEntry, stamp
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.hal import MotionSensor

DISTANCE_M = 2.0
DISTANCE_MIN_M, DISTANCE_MAX_M = 0.5, 50.0


async def calibrate_flow(motion: MotionSensor, operator: Operator, quality_min: float, t_wall: float) -> FlowEntry:
    """Guide a person through a push; the open sensor must be read as it is, without an earlier scale.

    Raises:
        BadInput: a distance that is none.
        DriverError: the sensor stopped answering.
        WayfarerError: what it saw cannot be used; the text says why and what to do.
    """
    distance_m = await operator.number("How many metres are you going to push it, along a measured line?", DISTANCE_M)
    if not DISTANCE_MIN_M <= distance_m <= DISTANCE_MAX_M:
        raise BadInput(f"a push of {distance_m:g} m: {DISTANCE_MIN_M:g} to {DISTANCE_MAX_M:g} m are allowed")
    await operator.wait("Set the rover at the line's start, wheels free, and step behind it.")
    if isinstance(motion, ChangeSensor) and not (await motion.read()).signed:
        return await calibrate_picture(motion, operator, distance_m, t_wall)
    told = operator.wait(f"Push it straight ahead by {distance_m:g} m, at a slow walk, and stop there.")
    seen = await measure_push(motion.read, told, quality_min)
    finding = judge_push(seen)
    if finding.verdict is CheckVerdict.FAIL:
        raise WayfarerError(f"{motion.name}: {finding.found}; {finding.cause}: {finding.remedy}")
    if seen.unknown > UNSEEN_MAX:
        raise WayfarerError(
            f"{motion.name}: {seen.unknown:.0%} of the readings did not see the ground; push on grass in daylight"
        )
    scale = distance_m / seen.forward_m
    if not SCALE_MIN <= scale <= SCALE_MAX:
        raise WayfarerError(
            f"{motion.name}: a push of {distance_m:g} m was measured as {seen.forward_m:.2f} m; correct the "
            "lens height or the scale under [parts.motion] and push again"
        )
    await operator.say(f"A push of {distance_m:g} m was measured as {seen.forward_m:.2f} m: scale {scale:.3f}.")
    return FlowEntry(**stamp(motion.name, t_wall), scale=scale)
