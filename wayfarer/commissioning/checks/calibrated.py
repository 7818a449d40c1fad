"""Checks of the calibration: the compass's own status, a steady heading, the calibration file."""

from __future__ import annotations

from functools import partial

from wayfarer.angles import circular_mean, wrap180
from wayfarer.commissioning.checks.api import Finding, Inspection, fail, ok, skipped, warn
from wayfarer.commissioning.manual_drive import sample_headings
from wayfarer.config.calibration_file import STALE_S, CompassEntry, Entry, MotorsEntry
from wayfarer.errors import DriverError
from wayfarer.hal import CompassReading

# A rotation-vector chip is typically right within 5 degrees (BNO080 data sheet, page 49); twice that is badly
# calibrated.
RESIDUAL_MAX_DEG = 10.0
AWAY = "keep keys and phones 0.15 m, computers 0.5 m, wire fences 2 m and cars 5 m away"  # ArduPilot's wiki
# What each entry of the file was made with.
PARTS = {"compass": "compass", "flow": "motion", "motors": "motors"}


async def compass_level(inspection: Inspection) -> Finding:
    """Check how well the compass says that it is calibrated now."""
    name, least = "compass calibration", inspection.config.safety.calibration_min
    try:
        reading: CompassReading = await inspection.read("compass")
    except DriverError:
        return skipped(name, "the compass does not answer")
    level = reading.calibration
    if level is None:
        return skipped(name, "the compass does not report it")
    if level < least:
        text = f"level {level} of 3, at least {least} is needed"
        text += "; its profile is not stored, or there is iron or current near it"
        return fail(name, text, f"{AWAY}; wayfarer calibrate")
    return ok(name, f"level {level} of 3")


async def heading_at_rest(inspection: Inspection) -> Finding:
    """Check that the heading of the standing rover stays where it is."""
    name, settings = "heading at rest", inspection.config.safety
    try:
        headings_deg = await sample_headings(partial(inspection.read, "compass"), settings.settle_s)
    except DriverError:
        return skipped(name, "the compass does not answer")
    mean_deg, _ = circular_mean(headings_deg)
    spread_deg = max(abs(wrap180(heading_deg - mean_deg)) for heading_deg in headings_deg)
    text = f"{spread_deg:.1f}° off its mean in {settings.settle_s:g} s, {settings.settle_spread_deg:g}° are allowed"
    if spread_deg > settings.settle_spread_deg:
        text += "; the rover is being moved, or there is iron or current near its compass"
        return fail(name, text, f"let it stand; {AWAY}")
    return ok(name, text)


async def calibrated(kind: str, inspection: Inspection) -> Finding:
    """Check an entry of the calibration file (a key of ``PARTS``), and that it is of this very part."""
    name, path, part_name = f"calibrated {kind}", inspection.host.calibration_file, PARTS[kind]
    part = inspection.rover.parts.get(part_name)
    if part is None:
        return skipped(name, f"this rover has no {part_name} sensor")
    entry: Entry | None = getattr(inspection.calibration, kind)
    if entry is None:
        return warn(name, f"not in {path}; it was never calibrated, or by another user", "wayfarer calibrate")
    try:
        await inspection.open(part_name)  # some parts know their full name only then
    except DriverError:
        return skipped(name, f"the {part_name} part does not answer")
    if entry.part != part.name:
        text = f"made with {entry.part}, but this is {part.name}; the part was changed, or the file is another rover's"
        return fail(name, text, "wayfarer calibrate")
    return _judge(name, entry, inspection.host.t_wall)


def _judge(name: str, entry: Entry, t_wall: float) -> Finding:
    if isinstance(entry, MotorsEntry) and not entry.passed:
        text = f"motor current shifts the heading by {max(entry.shift_half_deg, entry.shift_full_deg):.0f}°"
        return fail(name, text, "raise the compass on a mast, twist the motor wires; wayfarer calibrate")
    if isinstance(entry, CompassEntry) and entry.residual_deg > RESIDUAL_MAX_DEG:
        text = f"quarter turns were wrong by {entry.residual_deg:.0f}° on {entry.date}; there was iron near it, or "
        return warn(name, f"{text}there is iron on the rover", f"{AWAY}; wayfarer calibrate")
    if t_wall - entry.t_wall > STALE_S:
        return warn(name, f"on {entry.date}, more than half a year ago; rovers change", "wayfarer calibrate")
    return ok(name, f"on {entry.date}")
