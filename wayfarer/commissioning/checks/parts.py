"""Checks of the parts: each opens, answers, and gives plausible readings. No wheel turns.

A part that does not answer is one failure, not five: what else would be asked of it is skipped. Of a motor board that
cannot be asked, its battery and its outputs are not called in order.
"""

from __future__ import annotations

import asyncio
import re

from wayfarer.commissioning.checks.api import CheckVerdict, Finding, Inspection, fail, ok, skipped, warn
from wayfarer.commissioning.checks.system import diagnose
from wayfarer.errors import BadReading, DriverError, NotInstalled, WrongPart
from wayfarer.hal import (
    CompassReading,
    ContactReading,
    ExplainsNoFix,
    HasNote,
    MotionReading,
    NoFix,
    WheelReading,
    has_readback,
)

# A rover that is set down for a start stands about level; beyond this the compass is mounted otherwise than believed.
LEVEL_DEG = 20.0
# Two reports of a receiver that speaks once per second: a first one may be old. Chosen by us.
FIX_WITHIN_S, FIX_LOOK_S = 3.0, 0.1
NO_FIX = NoFix("no fix", "no free view of the sky, or just switched on", "wait some minutes outdoors")


def part_failed(inspection: Inspection, name: str, part: str, error: DriverError) -> Finding:
    """Return that a part failed: a library or a device file is missing, or what the kind of error says.

    If the device file is a failure already, the part is skipped: one cause is reported once.
    """
    if isinstance(error, NotInstalled):  # whether there is a device file does not matter yet
        return fail(name, error.what, error.remedy)
    where = inspection.rover.parts[part].name
    for device in (device for device in inspection.host.devices if device in where):
        if device in inspection.unusable:
            return skipped(name, f"{device} cannot be used: see there")
        if trouble := diagnose(inspection.host, device):
            return fail(name, *trouble)
    if error.remedy:
        return fail(name, error.what, error.remedy)
    cause, remedy = _advice(where, part, error)
    return fail(name, f"{error}; likely {cause}", remedy)


def _advice(where: str, part: str, error: DriverError) -> tuple[str, str]:
    """Return why a part may fail, and what to do; of a silent one by where its name says that it is connected."""
    if isinstance(error, WrongPart):
        return "another part is at this address, or the wires are swapped", f"correct [parts.{part}] in the rover file"
    if isinstance(error, BadReading):
        return "long or loose wires corrupt its data", "shorten and fasten its wires; use 100 kHz or less"
    if bus := re.search(r"/dev/i2c-(\d+)", where):
        remedy = f"check its four wires and its power switch; `i2cdetect -y {bus[1]}` must show its address"
        return "no power, a loose wire, or another address", remedy
    if "/dev/spidev" in where:
        remedy = "check its wires; try the other one of /dev/spidev0.0 and /dev/spidev0.1 in the rover file"
        return "no power, a loose wire, or the other chip select", remedy
    return "no power, or a loose wire", "check its plug and its power, and its section of the rover file"


def _absent(inspection: Inspection, part: str, text: str, instead: str) -> Finding:
    """Return that a rover has not got a part: a failure if it is to notice obstacles by it; no run begins then."""
    source = inspection.config.anomaly_source
    if part not in inspection.config.sources:
        return skipped(part, text)
    text = f'the rover file has no [parts.{part}], and anomaly_source is "{source}"'
    return fail(part, text, f'add [parts.{part}] or set anomaly_source = "{instead}"')


async def compass(inspection: Inspection) -> Finding:
    """Check that the compass answers, with a tilt that a rover on its wheels can have."""
    try:
        reading: CompassReading = await inspection.read("compass")
    except DriverError as error:
        return part_failed(inspection, "compass", "compass", error)
    text = f"heading {reading.heading_deg:.0f}°, pitch {reading.pitch_deg:.0f}°, roll {reading.roll_deg:.0f}°"
    if isinstance(part := inspection.rover.compass, HasNote) and part.note:
        text += f"; {part.note}"
    if max(abs(reading.pitch_deg), abs(reading.roll_deg)) > LEVEL_DEG:
        text += "; the rover does not stand level, or its compass is not mounted as the rover file says"
        return warn("compass", text, "stand it on level ground; if it does, correct [parts.compass]")
    return ok("compass", text)


async def motion(inspection: Inspection) -> Finding:
    """Check that the motion sensor answers and sees the ground."""
    config = inspection.config
    if not config.uses_motion:
        text = (
            f'anomaly_source = "{config.anomaly_source}": nothing sees whether the rover moves, and wheels that spin '
        )
        text += f"on mud or leaves look like driving; it turns away after {config.detector.blind_stride_m:g} m instead"
        return warn("motion", text, "add a motion sensor, and name it in anomaly_source")
    if inspection.rover.motion is None:
        return _absent(inspection, "motion", "this rover has no motion sensor", instead="contact")
    try:
        await inspection.read("motion")  # the first after the opening says nothing
        reading: MotionReading = await inspection.read("motion")
    except DriverError as error:
        return part_failed(inspection, "motion", "motion", error)
    text, least = f"quality {reading.quality:.2f} of 1", inspection.config.detector.quality_min
    if reading.quality < least:
        text += f", at least {least:g} is needed; too dark, too plain a ground, a leaf on the lens, or it is too low"
        return warn("motion", text, "clean the lens; try on grass in daylight")
    return ok("motion", text)


async def contact(inspection: Inspection) -> Finding:
    """Check that the bumper answers and that nothing presses on it."""
    if inspection.rover.contact is None:
        return _absent(inspection, "contact", "no bumper is in use", instead="motion")
    try:
        reading: ContactReading = await inspection.read("contact")
    except DriverError as error:
        return part_failed(inspection, "contact", "contact", error)
    if reading.sides:
        text = f"pressed at {', '.join(side.value for side in reading.sides)}; something leans on it, a switch sticks, "
        text += "or its pull-up is set the wrong way"
        return warn("contact", text, "free it; if nothing touches it, correct [parts.contact]")
    return ok("contact", "answers, and nothing is pressed")


async def wheels(inspection: Inspection) -> Finding:
    """Check that the wheels' sensor answers, and say what it measures."""
    sources = inspection.config.sources
    if inspection.rover.wheels is None:
        if sources.isdisjoint({"wheels", "current"}):
            return skipped("wheels", "this rover does not measure its wheels")
        text = f'the rover file has no [parts.wheels], and anomaly_source is "{inspection.config.anomaly_source}"'
        return fail("wheels", text, 'add [parts.wheels] or set anomaly_source = "motion"')
    try:
        await inspection.read("wheels")  # the first after the opening knows no way
        reading: WheelReading = await inspection.read("wheels")
    except DriverError as error:
        return part_failed(inspection, "wheels", "wheels", error)
    values = {"wheels": ("the way of the rims", reading.left_m), "current": ("current", reading.left_a)}
    measured = " and ".join(what for what, value in values.values() if value is not None) or "nothing now"
    if missing := [f'"{name}"' for name, (_, value) in values.items() if value is None and name in sources]:
        text = f"answers, and measures {measured}, but anomaly_source names {' and '.join(missing)}"
        return fail("wheels", text, f"take {' and '.join(missing)} out of anomaly_source, or add what measures it")
    return ok("wheels", f"answers; it measures {measured}")


def _helper_failed(inspection: Inspection, name: str, error: DriverError) -> Finding:
    """Return that a part failed that a rover can drive without: only a warning."""
    failed = part_failed(inspection, name, name, error)
    return failed._replace(verdict=CheckVerdict.WARN) if failed.verdict is CheckVerdict.FAIL else failed


async def light(inspection: Inspection) -> Finding:
    """Check that the status light opens."""
    if (part := inspection.rover.light) is None:
        return skipped("light", "this rover has no light part")
    try:
        await inspection.open("light")
    except DriverError as error:
        return _helper_failed(inspection, "light", error)
    return ok("light", f"{part.name} answers")


async def position(inspection: Inspection) -> Finding:
    """Check that the position receiver gives a fix, which its first reports need not be."""
    if (receiver := inspection.rover.position) is None:
        return skipped("position", "this rover has no position part")
    time = asyncio.get_running_loop().time
    try:
        await inspection.open("position")
        ends_s, fix = time() + FIX_WITHIN_S, await receiver.read()
        while fix is None and time() < ends_s:
            await asyncio.sleep(FIX_LOOK_S)
            fix = await receiver.read()
    except DriverError as error:
        return _helper_failed(inspection, "position", error)
    if fix is not None:
        off = "" if fix.error_m is None else f", off by {fix.error_m:.0f} m at most"
        return ok("position", f"{receiver.name}: a fix{off}")
    found, cause, remedy = receiver.why_no_fix() if isinstance(receiver, ExplainsNoFix) else NO_FIX
    return warn("position", f"{receiver.name}: {found}; likely {cause}", remedy)


# -- the motor board ---------------------------------------------------------------------------------------------------


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
            f"it opens; it cannot answer, and its deadman of {motors.deadman_s:g} s is not tested by this",
        )
    if motors.deadman_s is not None:
        return ok(name, f"answers; its deadman stops the wheels {motors.deadman_s:g} s after the last command")
    text = "it cannot stop the wheels by itself: nothing does if the computer fails"
    if inspection.config.safety.allow_no_deadman:
        return warn(name, f"{text}; the rover file allows it", "stay within reach of its power switch")
    return fail(name, text, "use a board that does, or a monostable (pulse); or set [safety] allow_no_deadman = true")


async def battery(inspection: Inspection) -> Finding:
    """Check the battery against the rover's own limit."""
    try:
        await inspection.open("motors")
        volts = (await inspection.rover.motors.health()).battery_v
    except DriverError:
        return skipped("battery", "the motor board does not answer")
    if volts is None:
        return skipped("battery", "the motor board does not measure it")
    low_v = inspection.config.board.battery_low_v
    if low_v is None:
        return ok("battery", f"{volts:.1f} V; not judged, the rover file gives no [board] battery_low_v")
    text = f"{volts:.1f} V, the limit is {low_v:g} V"
    if volts < low_v:
        return fail("battery", f"{text}; it is empty, cold or old", "charge it, warm it or replace it")
    return ok("battery", text)


async def motor_faults(inspection: Inspection) -> Finding:
    """Check that the motor board reports no fault."""
    try:
        await inspection.open("motors")
        if not await has_readback(inspection.rover.motors):
            return skipped("motor faults", "the motor board cannot be asked")
        faults = (await inspection.rover.motors.health()).faults
    except DriverError:
        return skipped("motor faults", "the motor board does not answer")
    if faults:
        text = f"{'; '.join(faults)}; likely a low battery, a short circuit, a blocked wheel or a hot board"
        remedy = "look for bare wires and blocked wheels, let the board cool, switch it off and on"
        return fail("motor faults", text, remedy)
    return ok("motor faults", "none")
