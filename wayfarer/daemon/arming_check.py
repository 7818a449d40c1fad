"""What must be right before a wheel may turn: checks, and conditions that would stop it again."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from wayfarer.commissioning.checks import BY_HAND, Check, CheckVerdict, Finding, Inspection, run_checks
from wayfarer.commissioning.checks.api import HostEnvironment, fail
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.run_log import RunLog
from wayfarer.control.supervisor import Supervisor
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.errors import NotResponding
from wayfarer.fieldlog.vocabulary import WORDS, in_words
from wayfarer.hal import MotorHealth, Rover
from wayfarer.safety.conditions import NOT_ARMED, NOT_DRIVEN, Condition

# -- the rover's parts -----------------------------------------------------------------------------------------------
# The checks before arming, on parts that the daemon has open: they read the sensor tasks' latest values.

FRESH_S = 1.0


class RunningInspection(Inspection):
    """An ``Inspection`` of a running rover; it opens nothing and reads nothing by itself."""

    def __init__(self, config: RoverConfig, rover: Rover, host: HostEnvironment, supervisor: Supervisor) -> None:
        used = {row.name for row in supervisor.tasks}
        read = rover if "contact" in used else replace(rover, contact=None)  # an unused bumper is not read
        super().__init__(config, read, host)
        self._supervisor = supervisor

    async def open(self, name: str) -> None:
        """Do nothing for a part that the run has opened; the motors are opened again, which verifies their deadman."""
        if name == "motors":
            await self.rover.motors.open()

    async def motor_health(self) -> MotorHealth:
        """Ask the motor board."""
        return await self.rover.motors.health()

    async def _read(self, sense: str) -> Any:
        """Return the latest reading of a sensor's task."""
        last = self._supervisor.controller.last
        if last is None:
            raise NotResponding("the rover's parts are still being opened: try again in some seconds")
        reading = self._supervisor.inbox.motion if sense == "motion" else getattr(last, sense)
        if reading is None or asyncio.get_running_loop().time() - reading.t_s > FRESH_S:
            raise NotResponding(f"the {in_words(sense)} has said nothing for {FRESH_S:g} s; see the log for why")
        return reading


LOGGING = ("disk", "log")  # the checks that ``arm --without-log`` only warns of
OPENING_S = 3.0  # just after the start, arming waits this long for the parts to open; the client waits for 5 s


class ArmingCheck:
    """Checks a rover whose daemon runs.

    ``warnings`` are those of the latest check.

    Args:
        supervisor: the run.
        inspect: returns the present state for the checks.
        log: the run's log.
        checks: those that must not fail before the rover is armed.
    """

    def __init__(
        self, supervisor: Supervisor, inspect: Callable[[], Inspection], log: RunLog, checks: Sequence[Check]
    ) -> None:
        self._supervisor = supervisor
        self._inspect = inspect
        self._log = log
        self._checks = checks
        self.warnings: list[str] = []

    async def before_arming(self, *, without_log: bool) -> None:
        """Refuse a rover that must not be armed.

        Args:
            without_log: the log need not work.

        Raises:
            RequestRefused: a check fails, or one of the conditions would stop the rover again.
        """
        await self._check(self._checks, NOT_ARMED, without_log=without_log)

    async def before_driving_by_hand(self) -> None:
        """Refuse a rover that a person must not drive; raises as ``before_arming``."""
        await self._check([check for check in self._checks if check in BY_HAND], NOT_DRIVEN, without_log=False)

    async def _check(self, checks: Sequence[Check], refused: Collection[Condition], *, without_log: bool) -> None:
        with suppress(TimeoutError):  # then the checks say which part is missing
            async with asyncio.timeout(OPENING_S):
                await self._supervisor.loop.ticked.wait()
        findings = await run_checks(self._inspect(), checks)
        failed = [finding for finding in findings if finding.verdict is CheckVerdict.FAIL]
        not_logging = [finding for finding in failed if finding.name in LOGGING]
        if without_log:
            failed = [finding for finding in failed if finding not in not_logging]
        failed += self._standing(refused)
        if failed:
            self._log.event(
                "arming_refused", asyncio.get_running_loop().time(), failed=[finding.name for finding in failed]
            )
            hint = "; without a log: wayfarer arm --without-log" if failed == not_logging else ""
            raise RequestRefused(f"not armed: {'; '.join(map(_finding_text, failed))}{hint}")
        warned = [finding for finding in findings if finding.verdict is CheckVerdict.WARN] + not_logging
        self.warnings = list(map(_finding_text, warned))

    def _standing(self, refused: Collection[Condition]) -> list[Finding]:
        """Return the conditions that would let the arming fail later (fault catalogue, fault 51)."""
        return [
            fail(each.value.replace("_", " "), "at this moment", WORDS[each].cause, WORDS[each].remedy)
            for each in self._supervisor.controller.conditions
            if each in refused
        ]


def _finding_text(finding: Finding) -> str:
    return f"{finding.name}: {finding.found}" + (f" ({finding.remedy})" if finding.remedy else "")
