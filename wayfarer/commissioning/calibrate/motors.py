"""Effect of the motors on the compass: their current makes a magnetic field that no calibration can remove.

The rover stands on blocks, so its true heading stays; what the compass says while the wheels turn is the motors' doing.
More than 10 degrees are refused (field.md 2, item 19): the cure is a mast and twisted wires, not software.
"""

from __future__ import annotations

from wayfarer.angles import circular_mean, wrap180
from wayfarer.commissioning.manual_drive import RATE_HZ, Operator, wheels_stopped_after
from wayfarer.config.calibration_file import MotorsEntry, stamp
from wayfarer.control.rate import Rate
from wayfarer.hal import Compass, DriveMotors, WheelCommand

SHIFT_MAX_DEG = 10.0
TICKS = round(2.0 * RATE_HZ)  # of each duty; the heading is taken in the second half
RAMP_TICKS = round(0.5 * RATE_HZ)  # a start at full duty may pull the computer's supply down
ON_BLOCKS = (
    "The wheels are going to turn, up to the highest speed that the rover file allows, for five seconds. "
    "Does the rover stand firmly on blocks, all wheels free, with nobody's hands near them?"
)


async def calibrate_motors(
    motors: DriveMotors, compass: Compass, operator: Operator, t_wall: float, duty_max: float
) -> MotorsEntry | None:
    """Measure the shift of an open compass at half and full duty of open motors; None where the person declines.

    Full is ``duty_max``, ``safety.duty_max`` of the rover file: a mission never uses more.

    Raises:
        DriverError: one of them stopped answering; the wheels were stopped.
    """
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
        **stamp(motors.name, t_wall), shift_half_deg=shift_half_deg, shift_full_deg=shift_full_deg, passed=passed
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
