"""Commands of the control socket: what each does to a running rover."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from secrets import randbelow
from typing import Any

from wayfarer.commissioning.checks import Check
from wayfarer.control.controller import Controller
from wayfarer.control.modes import Event, Mode, Outcome, Refused, refusal
from wayfarer.control.rate import ASKED_AT_ONCE, ASKED_HZ, RateLimiter
from wayfarer.control.run_log import RunLog
from wayfarer.control.supervisor import Supervisor
from wayfarer.control.tick import TickRecord
from wayfarer.daemon.arming_check import ArmingCheck, Inspect
from wayfarer.daemon.socket.protocol import WHOLE_MAX, Details, RequestRefused
from wayfarer.errors import DriverError
from wayfarer.escape.api import Phase
from wayfarer.hal import DriveMotors
from wayfarer.safety.conditions import Level
from wayfarer.safety.manual import ManualControl, ManualSample
from wayfarer.safety.permission import Asked
from wayfarer.vocabulary import WORDS, said_of

# -- status ----------------------------------------------------------------------------------------------------------
# What ``status`` says of a rover: its mode, what is wrong and what it does about that, its mission. Pure.


def rover_status(controller: Controller, now_s: float, *, being_checked: bool) -> dict[str, Any]:
    """Return the state of the rover at ``now_s``, on the loop's clock; for ``being_checked`` see ``Supervisor``."""
    health, last = controller.board.health, controller.last
    return {
        "mode": controller.mode.value,
        "why_disarmed": controller.why_disarmed if controller.mode is Mode.DISARMED else None,
        "being_checked": being_checked,
        "held": controller.held,
        "driver": controller.manual.driver if controller.mode is Mode.MANUAL else None,
        "conditions": [condition.value for condition in controller.conditions],
        "battery_v": health and health.battery_v,
        "motor_faults": list(health.faults) if health else [],
        **({} if last is None else _seen(last)),
        **({} if last is None else _response(controller, last, now_s)),
        **_mission(controller, now_s),
    }


def _seen(last: TickRecord) -> dict[str, Any]:
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


def _response(controller: Controller, last: TickRecord, now_s: float) -> dict[str, Any]:
    """Return for how long the worst condition has been there, what the rover does about it, and until when."""
    if last.cause is None:
        return {}
    for_s = round(now_s - controller.cause_since_s, 1)
    if controller.mode not in {Mode.ARMED, Mode.MANUAL}:
        return {"cause_for_s": for_s}
    by_hand = controller.mode is Mode.MANUAL
    return {"cause_for_s": for_s, **said_of(last.cause, last.level, by_hand=by_hand)._asdict()}


def _mission(controller: Controller, now_s: float) -> dict[str, Any]:
    mission = controller.mission
    if mission is None:
        return {}
    return {
        "goal_heading_deg": controller.goal_heading_deg,
        "mission_s": round(now_s - mission.starts_s, 1),
        "travelled_m": round(mission.travelled_m, 2),
        "north_m": round(mission.north_m, 2),
        "east_m": round(mission.east_m, 2),
    }


NO_STORAGE: Mapping[str, Any] = {"log_dropped": 0, "log_trouble": None, "storage_warnings": [], "runs_deleted": 0}


class RoverCommands:
    """Carries out the commands; implements ``socket.protocol.Commands``. Those that stop the wheels do that first.

    Args:
        supervisor: the run.
        motors: its motors, for stops that do not wait for the next tick.
        inspect: returns the current state for the checks before arming.
        log: the run's log.
        about: constant details for ``status``: version, rover, algorithm.
        checks: the checks that must not fail before the rover is armed.
        storage: returns what ``status`` says of the log and its disk; nothing is wrong if nobody watches it.
        keep: keeps this run, which somebody has marked, from being deleted; must not wait.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        motors: DriveMotors,
        inspect: Inspect,
        log: RunLog,
        about: Mapping[str, Any],
        checks: Sequence[Check],
        storage: Callable[[], Mapping[str, Any]] = lambda: NO_STORAGE,
        keep: Callable[[], None] = lambda: None,
    ) -> None:
        self._supervisor = supervisor
        self._controller = supervisor.controller
        self._motors = motors
        self._log = log
        self._about = about
        self._storage = storage
        self._keep = keep
        self._check = ArmingCheck(supervisor, inspect, log, checks)
        self._begun = RateLimiter()  # a log has a record of each
        self._marks = RateLimiter()  # for all clients together: one that connects again is another client

    async def status(self) -> Details:
        """Return the state of the rover."""
        state = rover_status(self._controller, _now_s(), being_checked=self.being_checked)
        return {**self._about, "board_deadman_s": self._motors.deadman_s, **self._storage(), **state}

    @property
    def being_checked(self) -> bool:
        """Whether somebody has asked to start the wheels, and the checks before that are under way."""
        return self._supervisor.being_checked

    async def arm(self, asked: Asked, heading_deg: float | None = None, *, without_log: bool = False) -> Details:
        """Check everything, then begin to arm."""
        if self.being_checked:
            raise RequestRefused("the rover is being checked already: wait, or disarm it first (wayfarer disarm)")
        if why := self._controller.why_not(Event.ARM):
            raise RequestRefused(why)
        check = partial(self._check.before_arming, without_log=without_log)
        await _started(self._supervisor.arm(asked, heading_deg, check))
        return {
            "mode": self._controller.mode.value,
            "start_delay_s": self._about["start_delay_s"],
            "warnings": self._check.warnings,
        }

    async def manual_begin(self, asked: Asked, driver: str) -> Details:
        """Check the motors, and let a client drive by hand."""
        settings = self._controller.manual.settings
        if not settings.allowed:
            raise RequestRefused(
                "driving by hand is not allowed: set allowed = true in [manual] of the rover file, or start the daemon"
                " with wayfarer run --manual"
            )
        if self.being_checked:
            raise RequestRefused("the rover is being checked already: wait, or disarm it first (wayfarer disarm)")
        if why := self._controller.why_not(Event.MANUAL):
            raise RequestRefused(why)
        if self._controller.waits_for_motors:
            raise RequestRefused("the motor board has failed and is being opened again: try again in some seconds")
        if not self._begun.take(_now_s()):
            raise RequestRefused(f"begun too often: at most {ASKED_HZ:g} times per second for long; wait a second")
        lease = randbelow(WHOLE_MAX)
        await _started(self._supervisor.begin_manual(asked, lease, driver, self._check.before_driving_by_hand))
        return {"mode": self._controller.mode.value, "lease": lease, "deadman_s": settings.deadman_s}

    async def manual_drive(self, lease: int, seq: int, forward: float, turn: float, sent_s: float) -> Details:
        """Take a sample of a person who drives; the next tick acts on it."""
        manual = self._driving(lease)
        if why := manual.take(_now_s(), ManualSample(seq, forward, turn, sent_s)):
            raise RequestRefused(why)
        last = self._controller.last
        if last is None or last.decision.phase is not Phase.MANUAL:
            return {"wheels": [0.0, 0.0], "why_not": "it begins"}
        held = WORDS[last.cause].what if last.cause is not None and last.level >= Level.HOLD else None
        return {"wheels": list(last.applied), "why_not": held or manual.why}

    async def manual_end(self, lease: int) -> Details:
        """Stop the wheels, and go back to what was before."""
        self._driving(lease)
        _done(self._supervisor.end_manual("requested by the person who drove"))
        return {"mode": self._controller.mode.value}

    def _driving(self, lease: int) -> ManualControl:
        """Return who drives.

        Raises:
            RequestRefused: nobody does, or another client.
        """
        controller = self._controller
        over = controller.mode is not Mode.MANUAL or controller.end is not None
        if over or not controller.manual.is_held_by(lease):
            raise RequestRefused(
                "this client does not drive any more: somebody ended it, or it was silent too long; begin again"
            )
        return controller.manual

    async def disarm(self) -> Details:
        """Stop the wheels until re-armed; never refused."""
        self._supervisor.disarm("requested by a person")
        return {"mode": self._controller.mode.value}

    async def hold(self) -> Details:
        """Stop the wheels until ``resume``."""
        _done(self._supervisor.hold())
        return {"held": self._controller.held}

    async def resume(self, asked: Asked) -> Details:
        """Let the wheels turn again."""
        if not self._controller.held:
            raise RequestRefused(refusal(Mode.DISARMED, Event.RESUME))
        self._supervisor.resume(asked)
        return {"held": False}

    async def goal(self, heading_deg: float) -> Details:
        """Set a new goal heading."""
        _done(self._controller.set_goal(_now_s(), heading_deg))
        return {"goal_heading_deg": heading_deg}

    async def mark(self, text: str, *, keep: bool = True) -> Details:
        """Write a person's note into the log, and keep its run; refuse it if there are too many for a person."""
        if not self._marks.take(_now_s()):
            raise RequestRefused(
                f"not noted: all clients together may send {ASKED_AT_ONCE} marks at once, and {ASKED_HZ:g} a second for"
                " long; wait a second and mark again"
            )
        self._log.logger.info("mark", t_s=_now_s(), text=f"Mark: {text}", note=text)
        if keep:
            self._keep()
        return {}

    async def link_lost(self, text: str) -> Details:
        """Write into the log that a viewer has lost its connection; a mark would keep the run for ever."""
        self._log.logger.warning("link_lost", t_s=_now_s(), text=f"The link is lost: {text}")
        return {}

    async def stop(self) -> Details:
        """End the run."""
        self._motors.halt()
        self._supervisor.finish("requested", "requested by a person")
        return {"log": self._about.get("log")}


def _done(outcome: Outcome) -> None:
    """Raise ``RequestRefused`` if the table of modes has refused a request."""
    if isinstance(outcome, Refused):
        raise RequestRefused(outcome.why)


async def _started(starting: Awaitable[None]) -> None:
    """Await what opens the motors and starts them, and refuse the request if it fails."""
    try:
        await starting
    except DriverError as error:
        raise RequestRefused(f"not armed: {error}") from None


def _now_s() -> float:
    return asyncio.get_running_loop().time()
