"""Calibration of the motion sensor: push the rover a known distance, and compare.

Published scales of the PMW3901 differ by half (docs/reference/hardware.md), and the lens height on a rover is a guess;
one push of two metres corrects both. Signs and axes are not corrected but refused, with the setting to change: a
sensor that is mounted otherwise than the rover file says is wrong sideways as well.

Of a camera without direction it is measured how much the image changes at rest and in motion. The numbers belong to the
ground and the light of that day, so they go into the rover file, where a person sees them.
"""

from __future__ import annotations

import asyncio
from statistics import median

from wayfarer.commissioning.checks.api import CheckVerdict, StandaloneInspection
from wayfarer.commissioning.checks.motion import judge_push
from wayfarer.commissioning.manual_drive import Operator, measure_push, sample_during
from wayfarer.config.calibration_file import SCALE_MAX, SCALE_MIN, FlowEntry, stamp
from wayfarer.drivers.camera_motion import CameraMotion
from wayfarer.errors import BadInput, WayfarerError

DISTANCE_M = 2.0
DISTANCE_MIN_M, DISTANCE_MAX_M = 0.5, 50.0
UNSEEN_MAX = 0.05  # share of readings without quality: the way made during them is missing
STILL_S = 2.0  # of a camera at rest; at 10 pictures a second: 20 of them
TIMES_STILL_MIN = 2.0  # less change than that is not told from noise


async def calibrate_flow(inspection: StandaloneInspection, operator: Operator) -> FlowEntry:
    """Guide a person through a push; the motion sensor is open, and is read as it is, without an earlier scale.

    Raises:
        BadInput: a distance that is none.
        DriverError: the sensor stopped answering.
        WayfarerError: what it saw cannot be used; the text says why and what to do.
    """
    motion, t_wall = inspection.rover.motion, inspection.host.t_wall
    assert motion is not None  # this step is for rovers that have one
    distance_m = await operator.number("How many metres are you going to push it, along a measured line?", DISTANCE_M)
    if not DISTANCE_MIN_M <= distance_m <= DISTANCE_MAX_M:
        raise BadInput(f"a push of {distance_m:g} m: {DISTANCE_MIN_M:g} to {DISTANCE_MAX_M:g} m are allowed")
    await operator.wait("Set the rover at the line's start, wheels free, and step behind it.")
    if isinstance(motion, CameraMotion) and not (await motion.read()).signed:
        return await _calibrate_picture(motion, operator, distance_m, t_wall)
    told = operator.wait(f"Push it straight ahead by {distance_m:g} m, at a slow walk, and stop there.")
    seen = await measure_push(motion.read, told, inspection.config.detector.quality_min)
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


async def _calibrate_picture(motion: CameraMotion, operator: Operator, distance_m: float, t_wall: float) -> FlowEntry:
    """Guide a person through standing still and a push, and say what to write into the rover file.

    Raises:
        DriverError: the camera stopped answering.
        WayfarerError: the picture hardly changes when the rover moves.
    """
    await operator.say("Hands off: looking at the ground while nothing moves.")
    still = median(await sample_during(asyncio.sleep(STILL_S), motion.change, 0.0))  # the camera sets the pace
    time = asyncio.get_running_loop().time
    starts_s = time()
    told = operator.wait(f"Push it straight ahead by {distance_m:g} m, at cruising speed, and stop there.")
    moving = median(await sample_during(told, motion.change, 0.0))
    if moving < TIMES_STILL_MIN * still:
        raise WayfarerError(
            f"{motion.name}: its picture changes by {moving:.1f} grey levels when pushed and by {still:.1f} when still;"
            " push it faster, fix exposure_us under [parts.motion], or let the camera look at rougher ground"
        )
    speed_m_s = distance_m / (time() - starts_s)
    await operator.say(
        f"Write under [parts.motion]: difference_still = {still:.1f}, difference_moving = {moving:.1f}, "
        f"difference_speed_m_s = {speed_m_s:.2f}"
    )
    return FlowEntry(**stamp(motion.name, t_wall), scale=1.0)
