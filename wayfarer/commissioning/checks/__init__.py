"""Checks of the rover and its computer before driving: ``wayfarer check``, and before each arming.

::

    findings = await run_checks(inspection, ARMING)          # in the daemon: no motion, less than a second
    findings = await check(config, rover, host, calibration, ask=None)  # the command: all; motion if a person agrees
    may_arm = passed(findings)
"""

from __future__ import annotations

from functools import partial

from wayfarer.commissioning.checks import calibrated, deadman, parts, system
from wayfarer.commissioning.checks.api import (
    Ask,
    Check,
    CheckVerdict,
    Finding,
    HostEnvironment,
    Inspection,
    passed,
    run_checks,
    warn,
)
from wayfarer.config.calibration_file import Calibration
from wayfarer.config.rover_file import RoverConfig
from wayfarer.hal import HasNote, Rover

__all__ = [
    "ARMING",
    "BY_HAND",
    "CALIBRATED",
    "Ask",
    "Check",
    "CheckVerdict",
    "Finding",
    "HostEnvironment",
    "Inspection",
    "check",
    "passed",
    "run_checks",
]

CALIBRATED: tuple[Check, ...] = (
    partial(calibrated.calibrated, "compass"),
    partial(calibrated.calibrated, "motors"),
    partial(calibrated.calibrated, "flow"),
    deadman.proved,
)
"""What a simulated rover need not be."""

ARMING: tuple[Check, ...] = (
    system.power,
    system.disk,
    system.card,
    system.clock,
    parts.motor_board,
    parts.battery,
    parts.motor_faults,
    parts.compass,
    calibrated.compass_level,
    parts.motion,
    parts.contact,
    parts.wheels,
    *CALIBRATED,
)
"""What gates arming."""

BY_HAND: tuple[Check, ...] = (system.power, parts.motor_board, parts.battery, parts.motor_faults, deadman.proved)
"""Which of them gate driving by a person, who sees what the sensors do not."""

AT_REST: tuple[Check, ...] = (calibrated.heading_at_rest, parts.light, parts.position)
"""What a person wants to know besides; arming itself waits for the heading to rest."""


async def check(
    config: RoverConfig, rover: Rover, host: HostEnvironment, calibration: Calibration, ask: Ask | None
) -> list[Finding]:
    """Return everything that can be found out about a rover that nothing else uses, in the order of looking.

    Args:
        config: the rover file.
        rover: its parts, not open; they are closed afterwards.
        host: files, clock and device files.
        calibration: what is in the calibration file.
        ask: asks a person, who must agree before a wheel turns; None if there is nobody.
    """
    from wayfarer.commissioning.checks.motion import check_motion  # no daemon needs it

    devices = [partial(system.device, name) for name in host.devices]
    at_rest = [check for check in (*ARMING, *AT_REST) if check is not deadman.proved]
    async with Inspection(config, rover, host, calibration) as inspection:
        findings = await run_checks(inspection, [*devices, *at_rest])
        if isinstance(motors := rover.motors, HasNote) and motors.note:
            findings.append(
                warn("motor pins", motors.note, "use GPIO 9 to 27 for these inputs, with pull-downs of 10 kΩ")
            )
        findings += await check_motion(inspection, ask)
        return findings + await run_checks(inspection, [deadman.proved])  # a person may have seen it just now
