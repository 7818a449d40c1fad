"""Guided calibration, ``wayfarer calibrate``: compass, motion sensor, motor magnetic field.

What was found is kept in the calibration file (``wayfarer.config.calibration_file``) with its date and part; the
compass keeps its own profile besides.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from statistics import median
from typing import Any, Literal

from wayfarer.angles import circular_mean, wrap180
from wayfarer.commissioning.checks.api import CheckVerdict, HostEnvironment, Inspection
from wayfarer.commissioning.checks.motion import judge_push
from wayfarer.commissioning.manual_drive import (
    RATE_HZ,
    Operator,
    measure_push,
    sample_during,
    sample_headings,
    wheels_stopped_after,
)
from wayfarer.config.calibration_file import (
    SCALE_MAX,
    SCALE_MIN,
    Calibration,
    CompassEntry,
    FlowEntry,
    MotorsEntry,
    save,
    stamp,
)
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.rate import Rate
from wayfarer.drivers.bno055 import BNO055
from wayfarer.drivers.camera_motion import CameraMotion
from wayfarer.drivers.cmps14 import CMPS14, LEARN, OFF
from wayfarer.errors import BadInput, BadReading, WayfarerError
from wayfarer.hal import Compass, DriveMotors, Rover, WheelCommand

# -- compass ---------------------------------------------------------------------------------------------------------
# Calibration of the compass, and the effect of the motors on it.
#
# The rover is rotated until the chip is calibrated; the chip stores that, and quarter turns verify it.
#
# The part calibrates itself only while this runs. In the field that is off: near a trunk with wire in it, or under the
# motors' current, a part that goes on calibrating learns the wrong field and moves the heading.
#
# The motors' current makes a magnetic field that no calibration can remove. For that measurement the rover stands on
# blocks, so its true heading stays; what the compass says while the wheels turn is the motors' doing. More than
# 10 degrees are refused: the cure is a mast and twisted wires, not software.

FULL = 3
LOOK_S = 0.5
PATIENCE_S = 300.0
STEADY_S = 1.0
AGREES_WITHIN_DEG = 20.0  # two compasses held by hand; a wrong axis is 90 degrees off
# Quarter turns by hand against an edge are right within a few degrees; this far off, something else went wrong.
FOLLOWS_WITHIN_DEG = 45.0

PREPARE = (
    "Take the rover outdoors, 5 m from cars and fences, 0.5 m from computers; leave keys and phone 0.15 m away. Ready?"
)
TURN_ABOUT = (
    "Lift the rover and turn it slowly about all three axes: nose up and down, onto each side, and right round; "
    "hold it still for a second in between."
)
QUARTERS = (
    "Set the rover down with one side along a straight edge (a plank) and step back.",
    "Turn it to the right by exactly a quarter turn, its rear along the edge, and step back.",
    "Turn it to the right by another quarter turn.",
    "Turn it to the right by the last quarter turn.",
)


async def calibrate_compass(inspection: Inspection, operator: Operator) -> CompassEntry:
    """Guide a person through calibrating the rover's compass, which is open.

    Raises:
        DriverError: it stopped answering.
        WayfarerError: it cannot be calibrated here; the text says why. It is left as it was, or as far as it got, with
            calibration off.
    """
    compass = inspection.rover.compass
    await operator.wait(PREPARE)
    if isinstance(compass, CMPS14):
        await _teach(compass, operator)
    elif isinstance(compass, BNO055):
        await _until_full(compass, operator)
        await operator.say(f'Write under [parts.compass]: offsets = "{await compass.offsets()}"')
    else:
        await operator.say(f"{compass.name} accepts no calibration: only its error is measured.")
    error_deg = residual_deg([await _heading(compass, operator, text) for text in QUARTERS])
    if error_deg > FOLLOWS_WITHIN_DEG:
        raise WayfarerError(
            f"{compass.name}: the heading was {error_deg:.0f}° off after quarter turns; it was turned to the left, or "
            "there is a magnet or iron beside the compass: move it onto a mast and calibrate again"
        )
    if isinstance(compass, BNO055):
        await _find_its_north(compass, inspection.config.parts["compass"], operator)
    level = (await compass.read()).calibration
    await operator.say(f"Quarter turns were off by {error_deg:.1f}° on average.")
    return CompassEntry(**stamp(compass.name, inspection.host.t_wall), level=level or 0, residual_deg=error_deg)


async def _teach(compass: CMPS14, operator: Operator) -> None:
    """Ask for turns until the levels are full, and store the calibration; calibrating ends in any case."""
    if await operator.ask("Forget the stored calibration first (right after the compass was moved to another place)?"):
        await compass.erase_profile()
    try:
        await compass.configure(LEARN)
        await _until_full(compass, operator)
        await compass.store_profile()
    finally:
        await compass.configure(OFF)


async def _find_its_north(compass: BNO055, table: Mapping[str, Any], operator: Operator) -> None:
    """Say which ``heading_offset_deg`` agrees with another compass: no document says which of its axes is heading 0."""
    heading_deg = await _heading(compass, operator, "Leave the rover where it is, and step back.")
    question = "Which way does its nose point, by another compass held well above it, in degrees from magnetic north?"
    off_deg = wrap180(await operator.number(question, round(heading_deg)) - heading_deg)
    if abs(off_deg) > AGREES_WITHIN_DEG:
        offset_deg = wrap180(table.get("heading_offset_deg", 0.0) + off_deg)
        await operator.say(f"Write under [parts.compass]: heading_offset_deg = {round(offset_deg)}")


async def _until_full(compass: CMPS14 | BNO055, operator: Operator) -> None:
    """Ask for turns, and show the levels as they change, until both are full.

    Raises:
        WayfarerError: they are not within five minutes.
    """
    await operator.say(TURN_ABOUT)
    shown, ends_s = "", asyncio.get_running_loop().time() + PATIENCE_S
    while asyncio.get_running_loop().time() < ends_s:
        with suppress(BadReading):  # a cable that is moved about
            levels = await compass.calibration()
            text = f"field {levels.mag} of {FULL}, tilt {levels.accel} of {FULL}"
            if text != shown:
                await operator.say(text)
                shown = text
            if levels.mag == levels.accel == FULL:
                return
        await asyncio.sleep(LOOK_S)
    raise WayfarerError(
        f"{compass.name}: not calibrated within {PATIENCE_S:.0f} s of turning; there may be iron or current near "
        "it: go elsewhere, switch the motors' power off, and calibrate again"
    )


async def _heading(compass: Compass, operator: Operator, text: str) -> float:
    """Return the mean heading of a second, once the rover is placed as asked."""
    await operator.wait(text)
    mean_deg, _ = circular_mean(await sample_headings(compass.read, STEADY_S))
    return mean_deg


def residual_deg(headings_deg: Sequence[float]) -> float:
    """Return by how much the turns between headings that are a quarter apart, all round, differ from 90° on average."""
    turned_deg = [
        wrap180(after - before)
        for before, after in zip(headings_deg, [*headings_deg[1:], headings_deg[0]], strict=True)
    ]
    return sum(abs(wrap180(turn_deg - 90.0)) for turn_deg in turned_deg) / len(turned_deg)


# -- the motors ------------------------------------------------------------------------------------------------------

SHIFT_MAX_DEG = 10.0
TICKS = round(2.0 * RATE_HZ)  # of each duty; the heading is taken in the second half
RAMP_TICKS = round(0.5 * RATE_HZ)  # a start at full duty may pull the computer's supply down
ON_BLOCKS = (
    "The wheels are going to turn, up to the highest speed that the rover file allows, for five seconds. "
    "Does the rover stand firmly on blocks, all wheels free, with nobody's hands near them?"
)


async def calibrate_motors(inspection: Inspection, operator: Operator) -> MotorsEntry | None:
    """Measure the shift of the heading at half and at full duty; None if the person declines.

    Compass and motors are open. Full is ``safety.duty_max`` of the rover file: a mission never uses more.

    Raises:
        DriverError: one of them stopped answering; the wheels were stopped.
    """
    motors, compass, duty_max = inspection.rover.motors, inspection.rover.compass, inspection.config.safety.duty_max
    if not await operator.ask(ON_BLOCKS):
        return None
    async with wheels_stopped_after(motors):
        still_deg, half_deg, full_deg = [
            await _heading_at(share * duty_max, motors, compass) for share in (0.0, 0.5, 1.0)
        ]
    shift_half_deg, shift_full_deg = abs(wrap180(half_deg - still_deg)), abs(wrap180(full_deg - still_deg))
    passed = max(shift_half_deg, shift_full_deg) <= SHIFT_MAX_DEG
    await operator.say(
        f"Motor current shifts the heading by {shift_half_deg:.1f}° at half, {shift_full_deg:.1f}° at full duty."
    )
    if not passed:
        await operator.say(
            f"That is too much: {SHIFT_MAX_DEG:g}° are allowed. Raise the compass on a mast and twist the motor wires."
        )
    return MotorsEntry(
        **stamp(motors.name, inspection.host.t_wall),
        shift_half_deg=shift_half_deg,
        shift_full_deg=shift_full_deg,
        passed=passed,
    )


async def _heading_at(duty: float, motors: DriveMotors, compass: Compass) -> float:
    """Return the mean heading while both sides turn ahead."""
    rate, headings_deg = Rate(RATE_HZ), []
    for tick in range(1, TICKS + 1):
        ramped = duty * min(1.0, tick / RAMP_TICKS)
        await motors.drive(WheelCommand(ramped, ramped))
        await rate.wait()
        if 2 * tick > TICKS:
            headings_deg.append((await compass.read()).heading_deg)
    mean_deg, _ = circular_mean(headings_deg)
    return mean_deg


# -- flow ------------------------------------------------------------------------------------------------------------
# Calibration of the motion sensor: push the rover a known distance, and compare.
#
# Published scales of the PMW3901 differ by half (docs/reference/hardware.md), and the lens height on a rover is a
# guess; one push of two metres corrects both. Signs and axes are not corrected but refused, with the setting to change:
# a sensor that is mounted otherwise than the rover file says is wrong sideways as well.
#
# Of a camera without direction it is measured how much the image changes at rest and in motion. The numbers belong to
# the ground and the light of that day, so they go into the rover file, where a person sees them.

DISTANCE_M = 2.0
DISTANCE_MIN_M, DISTANCE_MAX_M = 0.5, 50.0
UNSEEN_MAX = 0.05  # share of readings without quality: the way made during them is missing
STILL_S = 2.0  # of a camera at rest; at 10 pictures per second: 20 of them
TIMES_STILL_MIN = 2.0  # a smaller change cannot be distinguished from noise


async def calibrate_flow(inspection: Inspection, operator: Operator) -> FlowEntry:
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
        raise WayfarerError(f"{motion.name}: {finding.text}: {finding.remedy}")
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


__all__ = ["STEPS", "Operator", "Step", "calibrate"]

Step = Literal["compass", "flow", "motors"]
STEPS: tuple[Step, ...] = ("compass", "flow", "motors")

# The parts that each step opens, and what measures it with them and returns its entry: None if the person declines.
_STEPS: Mapping[Step, tuple[tuple[str, ...], Callable[[Inspection, Operator], Awaitable[Any]]]] = {
    "compass": (("compass",), calibrate_compass),
    "flow": (("motion",), calibrate_flow),
    "motors": (("compass", "motors"), calibrate_motors),
}


async def calibrate(
    config: RoverConfig,
    rover: Rover,
    host: HostEnvironment,
    calibration: Calibration,
    operator: Operator,
    steps: Sequence[Step] = STEPS,
) -> Calibration:
    """Guide a person through some steps, and return what is known afterwards; each step is saved when it is done.

    Args:
        config: the rover file.
        rover: its parts, not open, without an earlier calibration applied; they are closed afterwards.
        host: where the calibration file is, and the time.
        calibration: what is in that file.
        operator: turns and pushes the rover; wheels turn only after a yes.
        steps: in this order.

    Raises:
        BadInput: an answer is of no use.
        DriverError: a part does not open, or stopped answering.
        WayfarerError: what was measured cannot be used, or the file cannot be written.
    """
    async with Inspection(config, rover, host, calibration) as inspection:
        for step in steps:
            entry = await _measure(step, inspection, operator)
            if entry is None:
                await operator.say(f"{step}: left as it was.")
                continue
            calibration = replace(calibration, **{step: entry})
            save(host.calibration_file, calibration)
            await operator.say(f"{step}: saved in {host.calibration_file}.")
    return calibration


async def _measure(step: Step, inspection: Inspection, operator: Operator) -> Any:
    """Return the entry that a step found; None if the person declined, or the rover has no such part."""
    parts, measure = _STEPS[step]
    if any(part not in inspection.rover.parts for part in parts):
        return None
    for part in parts:
        await inspection.open(part)
    return await measure(inspection, operator)
