"""Calibration of the compass, and the effect of the motors on it.

The rover is rotated until the chip is calibrated; the chip stores that, and quarter turns verify it.

The part calibrates itself only while this runs. In the field that is off: near a trunk with wire in it, or under the
motors' current, a part that goes on calibrating learns the wrong field and moves the heading.

The motors' current makes a magnetic field that no calibration can remove. For that measurement the rover stands on
blocks, so its true heading stays; what the compass says while the wheels turn is the motors' doing. More than
10 degrees are refused: the cure is a mast and twisted wires, not software.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress

from wayfarer.angles import circular_mean, wrap180
from wayfarer.commissioning.checks.api import StandaloneInspection
from wayfarer.commissioning.manual_drive import RATE_HZ, Operator, sample_headings, wheels_stopped_after
from wayfarer.config.calibration_file import CompassEntry, MotorsEntry, stamp
from wayfarer.control.rate import Rate
from wayfarer.drivers.cmps14 import CMPS14, LEARN, OFF
from wayfarer.errors import BadReading, WayfarerError
from wayfarer.hal import Compass, DriveMotors, WheelCommand

FULL = 3
LOOK_S = 0.5
PATIENCE_S = 300.0
STEADY_S = 1.0
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


async def calibrate_compass(inspection: StandaloneInspection, operator: Operator) -> CompassEntry:
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
    else:
        await operator.say(f"{compass.name} accepts no calibration: only its error is measured.")
    error_deg = residual_deg([await _heading(compass, operator, text) for text in QUARTERS])
    if error_deg > FOLLOWS_WITHIN_DEG:
        raise WayfarerError(
            f"{compass.name}: the heading was {error_deg:.0f}° off after quarter turns; it was turned to the left, or "
            "there is a magnet or iron beside the compass: move it onto a mast and calibrate again"
        )
    level = (await compass.read()).calibration
    await operator.say(f"Quarter turns were off by {error_deg:.1f}° on average.")
    return CompassEntry(**stamp(compass.name, inspection.host.t_wall), level=level or 0, residual_deg=error_deg)


async def _teach(compass: CMPS14, operator: Operator) -> None:
    """Ask for turns until the levels are full, and store the calibration; calibrating ends in any case."""
    if await operator.ask("Forget the stored calibration first (right after the compass was moved to another place)?"):
        await compass.erase_profile()
    try:
        await compass.configure(LEARN)
        await operator.say(TURN_ABOUT)
        async with asyncio.timeout(PATIENCE_S):
            await _until_full(compass, operator)
        await compass.store_profile()
    except TimeoutError:
        raise WayfarerError(
            f"{compass.name}: not calibrated within {PATIENCE_S:.0f} s of turning; there may be iron or current near "
            "it: go elsewhere, switch the motors' power off, and calibrate again"
        ) from None
    finally:
        await compass.configure(OFF)


async def _until_full(compass: CMPS14, operator: Operator) -> None:
    """Show the levels as they change until both are full."""
    shown = ""
    while True:
        with suppress(BadReading):  # a cable that is moved about
            levels = await compass.calibration()
            text = f"field {levels.mag} of {FULL}, tilt {levels.accel} of {FULL}"
            if text != shown:
                await operator.say(text)
                shown = text
            if levels.mag == levels.accel == FULL:
                return
        await asyncio.sleep(LOOK_S)


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


async def calibrate_motors(inspection: StandaloneInspection, operator: Operator) -> MotorsEntry | None:
    """Measure the shift of the heading at half and at full duty; None where the person declines.

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
