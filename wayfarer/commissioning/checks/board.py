"""Checks of the motor board: it answers, its deadman is armed, battery and outputs are in order. No wheel turns.

Of a board that cannot be asked none of it is claimed.
"""

from __future__ import annotations

from wayfarer.commissioning.checks.api import Finding, Inspection, fail, ok, skipped, warn
from wayfarer.commissioning.checks.parts import part_failed, require_reading
from wayfarer.errors import DriverError
from wayfarer.hal import has_readback


async def motor_board(inspection: Inspection) -> Finding:
    """Check that the motor board answers, and that opening it armed a deadman that stops the wheels by itself."""
    name, motors = "motor board", inspection.rover.motors
    try:
        await inspection.open("motors")
        answers = await has_readback(motors)
    except DriverError as error:
        return part_failed(inspection, name, "motors", error)
    if motors.deadman_s is not None and not answers:
        return ok(
            name,
            f"its port opens; it cannot answer, and its deadman of {motors.deadman_s:g} s is not tested by this",
        )
    if motors.deadman_s is not None:
        return ok(name, f"answers; its deadman stops the wheels {motors.deadman_s:g} s after the last command")
    found, cause = "it cannot stop the wheels by itself", "plain H-bridges have no deadman"
    if inspection.config.safety.allow_no_deadman:
        return warn(name, f"{found}; the rover file allows it", cause, "stay within reach of its power switch")
    return fail(name, found, cause, "use a board that has one, or set [safety] allow_no_deadman = true")


async def battery(inspection: Inspection) -> Finding:
    """Check the battery against the rover's own limit."""
    try:
        volts, _ = await require_reading(inspection.motor_health())
    except DriverError:
        return skipped("battery", "the motor board does not answer")
    if volts is None:
        return skipped("battery", "the motor board does not measure it")
    low_v = inspection.config.board.battery_low_v
    if low_v is None:
        return ok("battery", f"{volts:.1f} V; not judged, the rover file gives no [board] battery_low_v")
    found = f"{volts:.1f} V, the limit is {low_v:g} V"
    if volts < low_v:
        return fail("battery", found, "it is empty, cold or old", "charge it, warm it or replace it")
    return ok("battery", found)


async def motor_faults(inspection: Inspection) -> Finding:
    """Check that the motor board reports no fault."""
    try:
        if not await has_readback(inspection.rover.motors):
            return skipped("motor faults", "the motor board cannot be asked")
        _, faults = await require_reading(inspection.motor_health())
    except DriverError:
        return skipped("motor faults", "the motor board does not answer")
    if faults:
        cause = "a low battery, a short circuit, a blocked wheel or a hot board"
        remedy = "look for bare wires and blocked wheels, let the board cool, switch it off and on"
        return fail("motor faults", "; ".join(faults), cause, remedy)
    return ok("motor faults", "none")
