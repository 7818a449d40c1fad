"""What must be right before a wheel may turn: checks, and conditions that would stop it again."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

from wayfarer.commissioning.checks import BY_HAND, Check, CheckVerdict, Finding, Inspection, run_checks
from wayfarer.commissioning.checks.api import HostEnvironment, fail
from wayfarer.config.calibration_file import Calibration
from wayfarer.config.factory import UNCALIBRATED
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.run_log import RunLog
from wayfarer.control.supervisor import Supervisor
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.errors import DriverError, NotResponding
from wayfarer.hal import Rover
from wayfarer.safety.conditions import NOT_ARMED, NOT_DRIVEN, Condition
from wayfarer.vocabulary import WORDS, in_words

# -- the rover's parts -----------------------------------------------------------------------------------------------
# The checks before arming, on parts that the daemon has open: they read the sensor tasks' latest values.

FRESH_S = 1.0


def running_inspection(
    config: RoverConfig,
    rover: Rover,
    host: HostEnvironment,
    supervisor: Supervisor,
    motors_failed: DriverError | None = None,
    calibration: Calibration = UNCALIBRATED,
) -> Inspection:
    """Return an inspection of a rover that runs, all of whose parts the run has opened.

    Args:
        config: the rover file.
        rover: its parts.
        host: files, clock and device files.
        supervisor: the run.
        motors_failed: why the motors did not open again for this arming; None if they did.
        calibration: what the daemon found in the calibration file.
    """

    async def latest(sense: str) -> Any:
        last = supervisor.controller.last
        if last is None:
            raise NotResponding("the rover's parts are still being opened: try again in some seconds")
        reading = getattr(supervisor.inbox if sense in {"motion", "wheels"} else last, sense)
        if reading is None or asyncio.get_running_loop().time() - reading.t_s > FRESH_S:
            raise NotResponding(f"the {in_words(sense)} has said nothing for {FRESH_S:g} s; see the log for why")
        return reading

    used = {row.name for row in supervisor.tasks}  # what is not used is not read
    rover = replace(
        rover,
        contact=rover.contact if "contact" in used else None,
        motion=rover.motion if "motion" in used else None,
    )
    opened = {**dict.fromkeys(rover.parts), "motors": motors_failed}
    return Inspection(config, rover, host, calibration, latest, opened)


Inspect = Callable[[DriverError | None], Inspection]
"""Returns the current state for the checks; the argument is why the motors did not open, None if they did."""

LOGGING = ("disk", "log")  # the checks that ``arm --without-log`` only warns of


class ArmingCheck:
    """Checks a rover whose daemon runs, and whose motors were just opened again.

    ``warnings`` are those of the latest check.

    Args:
        supervisor: the run.
        inspect: returns the current state for the checks.
        log: the run's log.
        checks: those that must not fail before the rover is armed.
    """

    def __init__(self, supervisor: Supervisor, inspect: Inspect, log: RunLog, checks: Sequence[Check]) -> None:
        self._supervisor = supervisor
        self._inspect = inspect
        self._log = log
        self._checks = checks
        self.warnings: list[str] = []

    async def before_arming(self, motors_failed: DriverError | None, *, without_log: bool) -> None:
        """Refuse a rover that must not be armed.

        Args:
            motors_failed: why the motors did not open; None if they did.
            without_log: the log need not work.

        Raises:
            RequestRefused: a check fails, or one of the conditions would stop the rover again.
        """
        await self._check(self._checks, NOT_ARMED, motors_failed, without_log=without_log)

    async def before_driving_by_hand(self, motors_failed: DriverError | None) -> None:
        """Refuse a rover that a person must not drive; see ``before_arming``."""
        checks = [check for check in self._checks if check in BY_HAND]
        await self._check(checks, NOT_DRIVEN, motors_failed, without_log=False)

    async def _check(
        self,
        checks: Sequence[Check],
        refused: Collection[Condition],
        motors_failed: DriverError | None,
        *,
        without_log: bool,
    ) -> None:
        findings = await run_checks(self._inspect(motors_failed), checks)
        failed = [finding for finding in findings if finding.verdict is CheckVerdict.FAIL]
        not_logging = [finding for finding in failed if finding.name in LOGGING]
        if without_log:
            failed = [finding for finding in failed if finding not in not_logging]
        failed += self._standing(refused)
        if failed:
            t_s, names = asyncio.get_running_loop().time(), [finding.name for finding in failed]
            text = f"Not armed, because these checks failed: {', '.join(names)}"
            self._log.logger.warning("arming_refused", t_s=t_s, text=text, failed=names)
            hint = "; without a log: wayfarer arm --without-log" if failed == not_logging else ""
            raise RequestRefused(f"not armed: {'; '.join(map(_finding_text, failed))}{hint}")
        warned = [finding for finding in findings if finding.verdict is CheckVerdict.WARN] + not_logging
        self.warnings = list(map(_finding_text, warned))

    def _standing(self, refused: Collection[Condition]) -> list[Finding]:
        """Return the conditions that would let the arming fail later (fault catalogue, fault 51)."""
        return [
            fail(each.value.replace("_", " "), f"at this moment; likely {WORDS[each].cause}", WORDS[each].remedy)
            for each in self._supervisor.controller.conditions
            if each in refused
        ]


def _finding_text(finding: Finding) -> str:
    return f"{finding.name}: {finding.text}" + (f" ({finding.remedy})" if finding.remedy else "")
