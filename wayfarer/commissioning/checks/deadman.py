"""Check that a person has seen the motor board's own deadman stop the wheels.

A board that can be asked says at each opening whether its deadman is armed. Of one that cannot, such as a Sabertooth,
only a person who watches the wheels can tell: ``wayfarer check`` asks one, and the answer is kept in the calibration
file. It counts for the very board and settings that it was given with.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

from pydantic_core import to_jsonable_python

from wayfarer.commissioning.checks.api import Finding, Inspection, fail, ok, skipped, warn
from wayfarer.config.calibration_file import STALE_S, DeadmanEntry, load, save, stamp
from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.errors import BadInput, DriverError
from wayfarer.hal import DriveMotors, has_readback

NAME = "deadman proved"
PROVE = "stop the service, put the rover on blocks, wayfarer check at a terminal"
# How the wheels are wired, and how fast they may turn, says nothing of the deadman; ``wayfarer check`` itself may have
# somebody correct it right after the proof.
OF_THE_WHEELS = {"left", "reverse_left", "reverse_right", "duty_limit"}


def board_settings(config: RoverConfig) -> dict[str, Any]:
    """Return what a proof counts for: the buses, the driver and the settings of the motors, defaults included."""
    table = config.parts.get("motors", {"driver": None})
    settings = to_jsonable_python(part_settings("motors", table)[1], fallback=str) if table["driver"] else {}
    kept = {key: value for key, value in settings.items() if key not in OF_THE_WHEELS}
    return {"buses": config.buses, "driver": table["driver"], **kept}


def keep_proof(inspection: Inspection, *, tripped: bool) -> None:
    """Write down that a person has seen the wheels stop by themselves, or forget that one ever has.

    Raises:
        BadInput: the calibration file is there and cannot be read.
        WayfarerError: it cannot be written.
    """
    path, motors = inspection.host.calibration_file, inspection.rover.motors
    proof = DeadmanEntry(**stamp(motors.name, inspection.host.t_wall), settings=board_settings(inspection.config))
    save(path, replace(load(path), deadman=proof if tripped else None))


async def proved(inspection: Inspection) -> Finding:
    """Check that the deadman of a board that cannot be asked was seen to stop the wheels, with today's settings."""
    motors, path = inspection.rover.motors, inspection.host.calibration_file
    if not await _only_seen(motors):
        return skipped(NAME, "only for a board that has one and cannot report it")
    try:
        proof = load(path).deadman
    except BadInput as error:
        return fail(NAME, str(error), "it was edited, or the card is failing", f"rm '{path}'; {PROVE}")
    if proof is None:
        return _unproved(inspection, f"nobody has seen {motors.name} stop the wheels by itself")
    if changed := _changes(proof.settings, board_settings(inspection.config)):
        return _unproved(inspection, f"seen on {proof.date}, but with {changed}")
    if inspection.host.t_wall - proof.t_wall > STALE_S:
        return warn(NAME, f"seen on {proof.date}, more than half a year ago", "rovers change", PROVE)
    return ok(NAME, f"the wheels were seen to stop by themselves on {proof.date}")


async def _only_seen(motors: DriveMotors) -> bool:
    """Return whether only a person can see that these motors have a deadman; one that answers badly can be asked."""
    with suppress(DriverError):
        return motors.deadman_s is not None and not await has_readback(motors)
    return False


def _unproved(inspection: Inspection, found: str) -> Finding:
    cause = "this board cannot report its deadman, which is off until that setting has reached it"
    if reason := inspection.config.safety.deadman_unproved_because:
        return warn(
            NAME, f"{found}; the rover file allows it: {reason}", cause, "stay within reach of its power switch"
        )
    return fail(NAME, found, cause, f"{PROVE}; or give a reason in [safety] deadman_unproved_because")


def _changes(before: dict[str, Any], now: dict[str, Any]) -> str:
    """Return what differs between two boards' settings, nothing where nothing does."""
    keys = sorted(key for key in before.keys() | now.keys() if before.get(key) != now.get(key))
    return ", ".join(f"{key} = {before.get(key)} (now {now.get(key)})" for key in keys)
