"""Commands of the control socket: what each does to a running rover."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from secrets import randbelow
from typing import Any

from wayfarer.commissioning.checks import BY_HAND, Check, CheckVerdict, Finding, Inspection, run_checks
from wayfarer.commissioning.checks.api import fail
from wayfarer.control.controller import Mode
from wayfarer.control.rate import ASKED_AT_ONCE, ASKED_HZ, RateLimiter
from wayfarer.control.run_log import RunLog
from wayfarer.control.supervisor import Supervisor
from wayfarer.control.tick_record import TickRecord
from wayfarer.daemon.socket.protocol import WHOLE_MAX, Details, Refused
from wayfarer.errors import DriverError
from wayfarer.escape.api import Phase
from wayfarer.hal import DriveMotors
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.manual import ManualControl, ManualSample
from wayfarer.safety.responses import MANUAL_LEVELS, RESPONSES, said_of

# Faults that re-arming cannot clear while they last. It clears the others; those that still exist are detected again.
Remedies = Mapping[Condition, tuple[str, str]]
REMEDIES: Remedies = {
    Condition.OVERTURNED: ("it lies on its side or roof, or its compass is mounted askew", "stand it on its wheels"),
    Condition.COMPASS_LOST: ("a loose wire, or no power", "check the compass's wires and power; wayfarer check"),
    Condition.MOTION_GONE: ("a loose wire, or no power", "check the motion sensor's wires and power; wayfarer check"),
    Condition.BOARD_FAULT: ("a low battery, a short circuit or a hot board", "wayfarer check says which"),
    Condition.BOARD_DISAGREES: (
        "the motor board applies another duty than commanded",
        "disconnect the motors' battery, check the board's wires and that no other program commands it",
    ),
    Condition.BATTERY_CRITICAL: ("the battery is almost empty", "charge it or replace it"),
    Condition.POWER_UNSTABLE: ("the computer's supply dips again and again", "give it a separate 5 V supply"),
}

REMEDIES_BY_HAND = {each: REMEDIES[each] for each in REMEDIES if MANUAL_LEVELS[each] >= Level.HOLD}

NO_STORAGE: Mapping[str, Any] = {"log_dropped": 0, "log_trouble": None, "storage_warnings": [], "runs_deleted": 0}
LOGGING = ("disk", "log")  # the checks that ``arm --without-log`` only warns of
OPENING_S = 3.0  # just after the start, arming waits this long for the parts to open; the client waits for 5 s


class RoverCommands:
    """Carries out the commands; implements ``socket.protocol.Commands``. Those that stop the wheels do that first.

    Args:
        supervisor: the run.
        motors: its motors, for stops that do not wait for the next tick.
        inspect: returns the present state for the checks before arming.
        log: the run's log.
        about: constant details for ``status``: version, rover, algorithm.
        checks: the checks that must not fail before the rover is armed.
        storage: returns what ``status`` says of the log and its disk; nothing is wrong where nobody watches it.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        motors: DriveMotors,
        inspect: Callable[[], Inspection],
        log: RunLog,
        about: Mapping[str, Any],
        checks: Sequence[Check],
        storage: Callable[[], Mapping[str, Any]] = lambda: NO_STORAGE,
    ) -> None:
        self._supervisor = supervisor
        self._controller = supervisor.controller
        self._motors = motors
        self._inspect = inspect
        self._log = log
        self._about = about
        self._checks = checks
        self._storage = storage
        self._checking = False
        self._warnings: list[str] = []
        self._begun = RateLimiter()  # a log has a record of each
        self._marks = RateLimiter()  # for all clients together: one that connects again is another client

    async def status(self) -> Details:
        """Return the state of the rover."""
        controller = self._controller
        return {
            **self._about,
            **self._storage(),
            "mode": controller.mode.value,
            "why_disarmed": controller.why_disarmed if controller.mode is Mode.DISARMED else None,
            "held": controller.held,
            "driver": controller.manual.driver if controller.mode is Mode.MANUAL else None,
            "conditions": [condition.value for condition in controller.conditions],
            "battery_v": controller.board.health and controller.board.health.battery_v,
            "motor_faults": list(controller.board.health.faults) if controller.board.health else [],
            **self._seen(controller.last),
            **self._response(controller.last),
            **self._mission(),
        }

    async def arm(self, heading_deg: float | None = None, *, without_log: bool = False) -> Details:
        """Check everything, then begin to arm."""
        if self._controller.mode is not Mode.DISARMED or self._checking:
            raise Refused(f"the rover is {self._mode_text()} already: disarm it first (wayfarer disarm)")
        check = partial(self._check, self._checks, REMEDIES, without_log=without_log)
        await self._checked(self._supervisor.arm(heading_deg, check))
        return {
            "mode": self._controller.mode.value,
            "start_delay_s": self._about["start_delay_s"],
            "warnings": self._warnings,
        }

    def _mode_text(self) -> str:
        mode = self._controller.mode
        return "being checked" if self._checking else "driven by a person" if mode is Mode.MANUAL else mode.value

    async def _checked(self, doing: Awaitable[None]) -> None:
        """Await what checks the rover first; nothing else may begin meanwhile."""
        self._checking = True
        try:
            await doing
        except DriverError as error:
            raise Refused(f"not armed: {error}") from None
        finally:
            self._checking = False

    async def _check(self, checks: Sequence[Check], remedies: Remedies, *, without_log: bool = False) -> None:
        """Refuse to arm a rover on which a check fails, or that one of the conditions would stop again.

        ``without_log``: the log need not work.
        """
        with suppress(TimeoutError):  # then the checks say which part is missing
            async with asyncio.timeout(OPENING_S):
                await self._supervisor.ticked.wait()
        findings = await run_checks(self._inspect(), checks)
        failed = [finding for finding in findings if finding.verdict is CheckVerdict.FAIL]
        not_logging = [finding for finding in failed if finding.name in LOGGING]
        if without_log:
            failed = [finding for finding in failed if finding not in not_logging]
        failed += self._standing(remedies)
        if failed:
            self._log.event("arming_refused", _now_s(), failed=[finding.name for finding in failed])
            hint = "; without a log: wayfarer arm --without-log" if failed == not_logging else ""
            raise Refused(f"not armed: {'; '.join(map(_finding_text, failed))}{hint}")
        warned = [finding for finding in findings if finding.verdict is CheckVerdict.WARN] + not_logging
        self._warnings = list(map(_finding_text, warned))

    def _standing(self, remedies: Remedies) -> list[Finding]:
        """Return the conditions that would let the arming fail later (fault catalogue, fault 51)."""
        return [
            fail(condition.value.replace("_", " "), "at this moment", *remedies[condition])
            for condition in self._controller.conditions
            if condition in remedies
        ]

    async def manual_begin(self, driver: str) -> Details:
        """Check the motors, and let a client drive by hand."""
        settings = self._controller.manual.settings
        if not settings.allowed:
            raise Refused(
                "driving by hand is not allowed: set allowed = true in [manual] of the rover file, or start the daemon"
                " with wayfarer run --manual"
            )
        if self._checking or self._controller.mode not in {Mode.DISARMED, Mode.ARMED}:
            raise Refused(f"the rover is {self._mode_text()} already: wait, or disarm it first (wayfarer disarm)")
        if self._controller.waits_for_motors:
            raise Refused("the motor board has failed and is being opened again: try again in some seconds")
        if not self._begun.take(_now_s()):
            raise Refused(f"begun too often: at most {ASKED_HZ:g} times a second for long; wait a second")
        checks = [check for check in self._checks if check in BY_HAND]
        lease = randbelow(WHOLE_MAX)
        if self._controller.mode is Mode.ARMED:
            self._motors.halt()
        await self._checked(
            self._supervisor.begin_manual(lease, driver, partial(self._check, checks, REMEDIES_BY_HAND))
        )
        return {"mode": self._controller.mode.value, "lease": lease, "deadman_s": settings.deadman_s}

    async def manual_drive(self, lease: int, seq: int, forward: float, turn: float, sent_s: float) -> Details:
        """Take a sample of a person who drives; the next tick acts on it."""
        manual = self._driving(lease)
        if why := manual.take(_now_s(), ManualSample(seq, forward, turn, sent_s)):
            raise Refused(why)
        last = self._controller.last
        if last is None or last.decision.phase is not Phase.MANUAL:
            return {"wheels": [0.0, 0.0], "why_not": "it begins"}
        held = RESPONSES[last.cause].what if last.cause is not None and last.level >= Level.HOLD else None
        return {"wheels": list(last.applied), "why_not": held or manual.why}

    async def manual_end(self, lease: int) -> Details:
        """Stop the wheels, and go back to what was before."""
        self._driving(lease)
        self._motors.halt()
        self._controller.end_manual(_now_s(), "requested by the person who drove")
        return {"mode": self._controller.mode.value}

    def _driving(self, lease: int) -> ManualControl:
        """Return who drives.

        Raises:
            Refused: nobody does, or another client.
        """
        controller = self._controller
        over = controller.mode is not Mode.MANUAL or controller.end is not None
        if over or not controller.manual.is_held_by(lease):
            raise Refused(
                "this client does not drive any more: somebody ended it, or it was silent too long; begin again"
            )
        return controller.manual

    async def disarm(self) -> Details:
        """Stop the wheels until re-armed; never refused."""
        self._motors.halt()
        self._supervisor.disarm("requested by a person")
        return {"mode": self._controller.mode.value}

    async def hold(self) -> Details:
        """Stop the wheels until ``resume``."""
        self._motors.halt()
        if self._controller.mode is Mode.DISARMED:
            self._supervisor.disarm("asked to hold")  # arming may be under way
            raise Refused("the rover is disarmed: its wheels do not turn")
        if self._controller.mode is Mode.MANUAL:
            self._controller.end_manual(_now_s(), "asked to hold")
        else:
            self._controller.hold(_now_s(), held=True)
        return {"held": self._controller.held}

    async def resume(self) -> Details:
        """Let the wheels turn again."""
        if not self._controller.held:
            raise Refused("the rover is not held: there is nothing to resume")
        self._controller.hold(_now_s(), held=False)
        return {"held": False}

    async def goal(self, heading_deg: float) -> Details:
        """Set a new goal heading."""
        if self._controller.mode is not Mode.ARMED:
            raise Refused(
                f"the rover is {self._controller.mode.value}: give the heading when arming (wayfarer arm DEG)"
            )
        self._controller.set_goal(_now_s(), heading_deg)
        return {"goal_heading_deg": heading_deg}

    async def mark(self, text: str) -> Details:
        """Write a person's note into the log; refuse it if there are too many for a person."""
        if not self._marks.take(_now_s()):
            raise Refused(
                f"not noted: all clients together may send {ASKED_AT_ONCE} marks at once, and {ASKED_HZ:g} a second for"
                " long; wait a second and mark again"
            )
        self._log.event("mark", _now_s(), text=text)
        return {}

    async def link_lost(self, text: str) -> Details:
        """Write into the log that a viewer has lost its person; a mark would keep the run for ever (retention)."""
        self._log.event("link_lost", _now_s(), text=text)
        return {}

    async def stop(self) -> Details:
        """End the run."""
        self._motors.halt()
        self._supervisor.finish("requested", "requested by a person")
        return {"log": self._about.get("log")}

    def _seen(self, last: TickRecord | None) -> dict[str, Any]:
        if last is None:
            return {}
        seen, decision = last.observation, last.decision
        return {
            "level": last.level.name.lower(),
            "cause": last.cause and last.cause.value,
            "phase": decision.phase.value,
            "why": decision.why,
            "wheels": list(last.applied),
            "heading_deg": seen and seen.heading_deg,
            "pitch_deg": seen and seen.pitch_deg,
            "roll_deg": seen and seen.roll_deg,
            "anomalies": [anomaly.value for anomaly in seen.anomalies] if seen else [],
            **last.memory(),
        }

    def _response(self, last: TickRecord | None) -> dict[str, Any]:
        """Return for how long the worst condition has been there, what the rover does about it, and until when."""
        if last is None or last.cause is None:
            return {}
        for_s = round(_now_s() - self._controller.cause_since_s, 1)
        if self._controller.mode not in {Mode.ARMED, Mode.MANUAL}:
            return {"cause_for_s": for_s}
        return {"cause_for_s": for_s, **said_of(last.cause, last.level)._asdict()}

    def _mission(self) -> dict[str, Any]:
        mission = self._controller.mission
        if mission is None:
            return {}
        return {
            "goal_heading_deg": self._controller.goal_heading_deg,
            "mission_s": round(_now_s() - mission.starts_s, 1),
            "travelled_m": round(mission.travelled_m, 2),
            "north_m": round(mission.north_m, 2),
            "east_m": round(mission.east_m, 2),
        }


def _finding_text(finding: Finding) -> str:
    return f"{finding.name}: {finding.found}" + (f" ({finding.remedy})" if finding.remedy else "")


def _now_s() -> float:
    return asyncio.get_running_loop().time()
