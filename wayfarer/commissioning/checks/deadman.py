"""Checks of the deadman: it stops the wheels by itself, and a person has seen that.

A board that can be asked says at each opening whether its deadman is armed. Of one that cannot, such as a Sabertooth,
only a person who watches the wheels can say: ``wayfarer check`` asks one, and the answer is kept in the calibration
file. It counts for the very board and settings that it was given with.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import replace
from typing import Any

from pydantic_core import to_jsonable_python

from wayfarer.commissioning.checks.api import Ask, Finding, Inspection, fail, ok, skipped, warn
from wayfarer.commissioning.manual_drive import keep_driving, wheels_stopped_after
from wayfarer.config.calibration_file import STALE_S, DeadmanEntry, save, stamp
from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.errors import DriverError, WayfarerError
from wayfarer.hal import STOP, DriveMotors, WheelCommand, has_readback

NAME = "deadman proved"
PROVE = "stop the service, put the rover on blocks, wayfarer check at a terminal"
# How the wheels are wired, and how fast they may turn, says nothing of the deadman; ``wayfarer check`` itself may have
# somebody correct it right after the proof.
OF_THE_WHEELS = {"left", "reverse_left", "reverse_right", "duty_limit"}

COUNT = (
    "This board cannot be asked: please count the seconds that the wheels turn now, "
    "about {well_s:.1f} s if all is well, {longest_s:.1f} s at most. Ready?"
)
DEADMAN_DUTY = 0.2
DRIVE_S = 0.5
DEADMAN_MARGIN_S = 0.15  # how late a deadman may be
WATCH_S = 2.5  # how much longer wheels turn if the deadman does not trip: enough for an eye to see
SILENCE_MAX_S = 5.0  # wheels without commands do not turn for longer, for any deadman in the rover file
NO_DEADMAN = "the board did not get the timeout, or its timeout does not work"
NOT_YET = "switch the board off and on and check again; do not let it drive before this is right"


async def deadman_silence_s(motors: DriveMotors) -> float:
    """Return how long the deadman is given, 0 if there is none; longer for an eye that has to see it."""
    if motors.deadman_s is None:
        return 0.0
    watch_s = 0.0 if await has_readback(motors) else WATCH_S
    return motors.deadman_s + DEADMAN_MARGIN_S + watch_s


async def deadman_trips(ask: Ask, inspection: Inspection) -> Finding:
    """Drive, stop sending commands, and see whether the board stops the wheels by itself.

    A board that can be asked is asked. Otherwise a person counts, and the answer is kept: wheels that turn for longer
    than the deadman allows were stopped by us.

    Raises:
        DriverError: the board did not answer.
    """
    name, motors = "deadman trips", inspection.rover.motors
    if motors.deadman_s is None:
        return skipped(name, "this board has none")
    silence_s, duty = await deadman_silence_s(motors), min(DEADMAN_DUTY, inspection.config.safety.duty_max)
    if silence_s > SILENCE_MAX_S:
        long = f"with a deadman of {motors.deadman_s:g} s, wheels without commands would turn for {silence_s:.1f} s"
        return skipped(name, f"{long}; set a shorter timeout under [parts.motors]")
    if not await has_readback(motors):
        return await _deadman_seen(name, ask, inspection, motors.deadman_s, silence_s, duty)
    before, after = await _stop_commanding(motors, silence_s, duty)
    if before == STOP:
        return fail(name, "the wheels did not start; likely no motor power", "check battery, fuse and motor switch")
    if after != STOP:
        return fail(name, f"the wheels still turned after {silence_s:g} s of silence; {NO_DEADMAN}", NOT_YET)
    return ok(name, f"the wheels stopped within {silence_s:g} s of silence")


async def _deadman_seen(
    name: str, ask: Ask, inspection: Inspection, deadman_s: float, silence_s: float, duty: float
) -> Finding:
    well_s, longest_s = DRIVE_S + deadman_s, DRIVE_S + silence_s
    if not await ask(COUNT.format(well_s=well_s, longest_s=longest_s)):
        return skipped(name, "nobody watched")
    await _stop_commanding(inspection.rover.motors, silence_s, duty)
    tripped = await ask(f"Did they turn for about {well_s:.1f} s, and not for {longest_s:.1f} s?")
    text = "the wheels were seen to stop by themselves" if tripped else "the wheels did not stop by themselves"
    try:
        keep_proof(inspection, tripped=tripped)
    except WayfarerError as error:
        return fail(name, f"{text}; not kept: {error}", "fix that and check again")
    if not tripped:
        return fail(name, f"{text}; {NO_DEADMAN}", NOT_YET)
    return ok(name, f"{text}; kept in {inspection.host.calibration_file}")


async def _stop_commanding(
    motors: DriveMotors, for_s: float, duty: float
) -> tuple[WheelCommand | None, WheelCommand | None]:
    """Return what the board applied before and after a silence."""
    async with wheels_stopped_after(motors):
        await keep_driving(motors, WheelCommand(duty, duty), DRIVE_S)
        before = await motors.read_back()
        await asyncio.sleep(for_s)
        return before, await motors.read_back()


def board_settings(config: RoverConfig) -> dict[str, Any]:
    """Return what a proof counts for: the buses, the driver and the settings of the motors, defaults included."""
    table = config.parts.get("motors", {"driver": None})
    settings = to_jsonable_python(part_settings("motors", table)[1], fallback=str) if table["driver"] else {}
    kept = {key: value for key, value in settings.items() if key not in OF_THE_WHEELS}
    return {"buses": config.buses, "driver": table["driver"], **kept}


def keep_proof(inspection: Inspection, *, tripped: bool) -> None:
    """Write down that a person has seen the wheels stop by themselves, or forget that one ever has.

    Raises:
        WayfarerError: the calibration file cannot be written.
    """
    entry = stamp(inspection.rover.motors.name, inspection.host.t_wall)
    proof = DeadmanEntry(**entry, settings=board_settings(inspection.config)) if tripped else None
    calibration = replace(inspection.calibration, deadman=proof)
    save(inspection.host.calibration_file, calibration)
    inspection.calibration = calibration


async def proved(inspection: Inspection) -> Finding:
    """Check that the deadman of a board that cannot be asked was seen to stop the wheels, with today's settings."""
    motors, proof = inspection.rover.motors, inspection.calibration.deadman
    if not await _only_seen(motors):
        return skipped(NAME, "only for a board that has one and cannot report it")
    if proof is None:
        return _unproved(inspection, f"nobody has seen {motors.name} stop the wheels by itself")
    if changed := _changes(proof.settings, board_settings(inspection.config)):
        return _unproved(inspection, f"seen on {proof.date}, but with {changed}")
    if inspection.host.t_wall - proof.t_wall > STALE_S:
        return warn(NAME, f"seen on {proof.date}, more than half a year ago; rovers change", PROVE)
    return ok(NAME, f"the wheels were seen to stop by themselves on {proof.date}")


async def _only_seen(motors: DriveMotors) -> bool:
    """Return whether only a person can see that these motors have a deadman; one that answers badly can be asked."""
    with suppress(DriverError):
        return motors.deadman_s is not None and not await has_readback(motors)
    return False


def _unproved(inspection: Inspection, text: str) -> Finding:
    text += "; this board cannot report its deadman, which may not work"
    if reason := inspection.config.safety.deadman_unproved_because:
        return warn(NAME, f"{text}; the rover file allows it: {reason}", "stay within reach of its power switch")
    return fail(NAME, text, f"{PROVE}; or give a reason in [safety] deadman_unproved_because")


def _changes(before: dict[str, Any], now: dict[str, Any]) -> str:
    """Return what differs between two boards' settings, nothing if nothing does.

    A setting that is younger than the proof differs only if it is in use.
    """
    keys = sorted(key for key in before.keys() | now.keys() if (before.get(key) or None) != (now.get(key) or None))
    return ", ".join(f"{key} = {before.get(key)} (now {now.get(key)})" for key in keys)
