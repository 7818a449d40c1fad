"""The supervisor: opens the parts, runs sensor tasks and controller on one asyncio loop, and stops the wheels.

The sensor tasks are a table (``Supervisor.tasks``): a row for each sensor that the run needs, with the sensor's own
rate. The control tick runs beside them. A sensor that fails is closed and opened again, with growing pauses, while the
others continue; what the rover does without it is in ``safety.conditions``. So is a motor board that fails during a
mission (``board_watch``). Any other error ends the run.
When a run ends, for any reason (a limit, a request, an error, a cancellation), the wheels are stopped by code that
cancellation cannot interrupt.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Container
from contextlib import suppress
from dataclasses import replace
from math import inf, nextafter

from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.board_watch import BoardWatch
from wayfarer.control.controller import Controller
from wayfarer.control.loop import ControlLoop, loop_time
from wayfarer.control.modes import Mode, Outcome, Refused
from wayfarer.control.rate import Rate
from wayfarer.control.run_log import NOTE_HZ, DriverCounters, RunLog
from wayfarer.control.sensors import keep_sampling, sensor_tasks
from wayfarer.control.shutdown import Shutdown, run_uncancellable
from wayfarer.control.status_light import LAST_END_S, LIGHT_HZ, LastEnd, colour
from wayfarer.control.tick import Inbox
from wayfarer.detector import Detector
from wayfarer.detector.witnesses import WITNESSES
from wayfarer.errors import DriverError, MissingPart, NotArmed
from wayfarer.escape.api import EscapeHandler
from wayfarer.escape.catalogue import Algorithm
from wayfarer.hal import Driver, Rover, StatusLight
from wayfarer.safety.conditions import SILENCE, Level
from wayfarer.safety.mission import RunEnd
from wayfarer.safety.permission import PERMISSION_S, Asked

FRESH_S = 1.0  # if the last control tick is older, systemd's watchdog is not fed
OPENING_S = 3.0  # just after the start, arming waits this long for the parts to open; the client waits for 5 s

CheckMotors = Callable[[DriverError | None], Awaitable[None]]
"""Raises an error if the rover must not be armed; it is given why the motors did not open, None if they did."""


class Supervisor:
    """Runs one rover with one algorithm, once. It starts disarmed.

    A mission that reaches a limit ends the run, as a trial does. With ``goes_on`` it only disarms the rover, which can
    be armed again. ``last_end`` is what the light shows of the run before. ``being_checked`` is whether somebody has
    asked to start the wheels, and the checks before that are under way. ``ladder_seed`` is of the random turns of a
    rover that makes no progress (``escape.recovery``); it must be in the log, or a replay turns to other sides.

    Raises:
        MissingPart: the algorithm or the configuration needs a part that the rover does not have.
    """

    def __init__(
        self,
        rover: Rover,
        config: RoverConfig,
        algorithm: Algorithm,
        handler: EscapeHandler,
        log: RunLog,
        *,
        ladder_seed: int | str,
        goes_on: bool = False,
        last_end: LastEnd | None = None,
    ) -> None:
        self._rover = rover
        self._control_hz = config.control_hz
        self._log = log
        self._last_end = last_end
        self._by_hand = config.manual.allowed
        self.inbox = Inbox()
        needs = check_parts(rover, algorithm, config)
        detector = make_detector(config, needs, rover.parts)
        self.controller = Controller(config, detector, handler, log, ladder_seed=ladder_seed, goes_on=goes_on)
        self.loop = ControlLoop(rover.motors, self.inbox, self.controller, log, config.safety.tick_late_s)
        self._board = BoardWatch(rover.motors, self.inbox, self.controller, log, config.board.health_hz)
        self._patience_s = config.detector.compass_stale_s  # after this a silent compass is a condition
        self._over_s = -inf  # permissions that were given before are void
        self.being_checked = False
        used = rover if config.uses_motion or "motion" in needs else replace(rover, motion=None)
        self.tasks = sensor_tasks(used, self.inbox, config.rates, needs)
        lights = () if rover.light is None else (rover.light,)
        self._parts: tuple[Driver, ...] = (rover.motors, *lights, *(row.part for row in self.tasks))
        self._stopping = Shutdown(rover.motors, self._parts, log)
        self._opening: asyncio.Task[None] | None = None
        self._unopened: list[Driver] = []

    @property
    def mode(self) -> Mode:
        """The arming state; the wheels may turn only while it is ``ARMED`` or ``MANUAL``."""
        return self.controller.mode

    @property
    def wheels_stopped(self) -> bool:
        """Whether the run's latest stop was sent, and the board does not report otherwise."""
        return self._stopping.confirmed

    async def arm(self, asked: Asked, goal_heading_deg: float | None = None, check: CheckMotors | None = None) -> None:
        """Begin to arm, towards a heading or, if None, the rover's own at the end of the start delay.

        The motor board is opened again, because one that lost its power for a moment has forgotten its deadman. If an
        error is raised, nothing has changed.

        Args:
            asked: the permission; it is judged again at the end, after all that had to be waited for.
            goal_heading_deg: degrees clockwise from magnetic north.
            check: is awaited once the motor board was opened, and raises an error if the rover must not be armed.

        Raises:
            DriverError: the motor board does not answer, or its deadman does not arm.
            NotArmed: the permission is void, or somebody disarmed the rover or ended the run while this was under way.
        """
        await self._open_motors(asked, check)
        _started(self.controller.arm(self._use(asked), goal_heading_deg))

    async def begin_manual(self, asked: Asked, lease: int, driver: str, check: CheckMotors | None = None) -> None:
        """Let a person drive; see ``arm`` for ``asked``, ``check`` and errors, ``ManualControl.begin`` for the others.

        The motors of a mission are open already, and turn: they are left as they are.
        """
        if self.mode is not Mode.ARMED:
            await self._open_motors(asked, check)
        drives = self.mode is Mode.ARMED  # also if somebody has armed it meanwhile
        _started(self.controller.begin_manual(self._use(asked), lease, driver))
        if drives:  # nothing was awaited, and what the mission has commanded last must not go on
            self._rover.motors.halt()

    def resume(self, asked: Asked) -> None:
        """Let the wheels turn again after ``hold``; raises ``NotArmed`` as ``arm``."""
        _started(self.controller.resume(self._use(asked)))

    async def _open_motors(self, asked: Asked, check: CheckMotors | None) -> None:
        """Open the motors again, and check everything, for no longer than the permission lasts."""
        self._refuse_void(asked)
        self.being_checked = True
        try:
            async with asyncio.timeout_at(asked.at_s + PERMISSION_S):
                if check is not None:
                    with suppress(TimeoutError):  # then the checks say which part is missing
                        async with asyncio.timeout(OPENING_S):
                            await self.loop.ticked.wait()
                failures, failed = self.controller.failures, None
                try:
                    await self._rover.motors.open()
                except DriverError as error:
                    failed = error
                if check is not None:  # also if the motors failed: it says all that is wrong
                    await check(failed)
                if failed is not None:
                    raise failed
        except TimeoutError:
            raise NotArmed(
                f"not started: the checks took longer than {PERMISSION_S:g} s, and nobody may be there any more: see"
                " the log for what is slow, and ask again"
            ) from None
        finally:
            self.being_checked = False
        if self.controller.failures != failures:  # then what opening has proved may be out of date, see ``BoardWatch``
            raise NotArmed("not started: the motor board failed while it was being opened: check its wires, ask again")

    def _refuse_void(self, asked: Asked) -> None:
        """Raise ``NotArmed`` if a permission does not count any more."""
        over = "the run is ending" if self.controller.end is not None else ""
        if why := over or asked.why_void(loop_time(), self._over_s):
            raise NotArmed(f"not started: {why}: look at the rover, and ask again if that is still right")

    def _use(self, asked: Asked) -> float:
        """Use up a permission, or raise ``NotArmed``; return the time of now.

        Every start of a wheel that somebody asks for goes through here, and nothing is awaited between this and the
        change of mode.
        """
        self._refuse_void(asked)
        self._over_s = nextafter(asked.at_s, inf)
        return loop_time()

    def _stop(self) -> float:
        """Stop the wheels now, and let nothing start that was asked for before; return the time of now.

        Every stop that somebody asks for goes through here. It does not wait for the next tick.
        """
        self._rover.motors.halt()
        now_s = loop_time()
        self._over_s = max(self._over_s, now_s)
        return now_s

    def hold(self) -> Outcome:
        """Stop the wheels until ``resume``; the mission continues after that. Nobody drives by hand any more.

        Returns Refused if the rover is disarmed: it stands, and there is no mission to go on with.
        """
        return self.controller.hold(self._stop())

    def end_manual(self, reason: str) -> Outcome:
        """Stop the wheels, and go back to what was before a person drove; Refused if nobody does."""
        return self.controller.end_manual(self._stop(), reason)

    def disarm(self, reason: str) -> None:
        """Stop the wheels until re-armed, also while arming is under way; the run continues. Never refused."""
        self.controller.disarm(self._stop(), reason)

    def finish(self, reason: str, text: str) -> None:
        """End the run: at the next tick, or at once if its parts are still being opened."""
        self.controller.finish(reason, text)
        if self._opening is not None:
            self._opening.cancel()

    def is_fresh(self) -> bool:
        """Return whether the control tick runs and every sensor that the run needs has answered recently.

        If it is not, systemd starts the daemon again, disarmed. A mission must not end this way unless the lost sensor
        is what holds it: one that rests, or that a person holds, goes on afterwards. Nor must a run that a person may
        drive: they need no sensor, and a daemon that is there.
        """
        last = self.controller.last
        if last is None or loop_time() - last.t_s > FRESH_S:
            return False
        goes_on = self.mode in {Mode.ARMED, Mode.MANUAL} and (last.level < Level.HOLD or last.cause not in SILENCE)
        return goes_on or self._by_hand or SILENCE.isdisjoint(self.controller.conditions)

    async def run(self) -> RunEnd:
        """Open the parts and run until a limit or ``finish``; the wheels are stopped in any case.

        Raises:
            DriverError: a part did not open.
        """
        end = RunEnd("failed", "the run was cancelled")
        try:
            await self._open_parts()
            end = self.controller.end or await self._run_tasks()
        except Exception as error:
            cause = first_cause(error)
            end = RunEnd("failed", f"{type(cause).__name__}: {cause}")
            raise
        finally:
            await run_uncancellable(self._stopping.end(end))
        return end

    async def _open_parts(self) -> None:
        """Open all parts, unless the run is ended meanwhile: a camera may take seconds."""
        self._opening = asyncio.ensure_future(self._open_each())
        try:
            await self._opening
        except asyncio.CancelledError:
            if self.controller.end is None:
                raise
        finally:
            self._opening = None

    async def _open_each(self) -> None:
        for part in self._parts:
            await self._open(part)
        opened = [part.name for part in self._parts if part not in self._unopened]
        text = f"The parts are open: {', '.join(opened)}"
        self._log.logger.info("opened", t_s=loop_time(), text=text, parts=opened)

    async def _open(self, part: Driver) -> None:
        """Open a part; a run also begins if the light or the receiver does not open.

        If a person may drive, it begins without any part but the motors: they bring the rover back.
        """
        try:
            await part.open()
        except DriverError as error:
            helps = part is self._rover.light or part is self._rover.position
            if part is self._rover.motors or not (helps or self._by_hand):
                raise
            self._unopened.append(part)
            text = f"The {part.name} did not open: {error}"
            self._log.logger.warning("part_failed", t_s=loop_time(), text=text, part=part.name, error=str(error))

    async def _run_tasks(self) -> RunEnd:
        async with asyncio.TaskGroup() as group:
            beside = [
                group.create_task(
                    keep_sampling(row, self.inbox, self._log, opened=row.part not in self._unopened),
                    name=f"sensor:{row.name}",
                )
                for row in self.tasks
            ]
            beside.append(group.create_task(self._board.run(), name="board"))
            beside.append(group.create_task(self._log_driver_counters(), name="driver counters"))
            if self._rover.light is not None:
                beside.append(group.create_task(self._show_state(self._rover.light), name="light"))
            await self._wait_for_sensors()
            try:
                # In a separate task: a tick wakes only its coroutine, not those that wait for the end of the run.
                end = await asyncio.create_task(self.loop.run(self._control_hz), name="control")
            finally:  # the wheels first: a sensor may take long to end
                await run_uncancellable(self._stopping.stop_wheels())
                for task in beside:
                    task.cancel()
        return end

    async def _wait_for_sensors(self) -> None:
        """Wait for the first reading of each sensor, so that at common grid times the sensors come before the tick.

        A real bus takes some milliseconds. The wait ends after ``compass_stale_s``: the ticks then show which sensor is
        silent.
        """
        waits = [row.spoke.wait() for row in self.tasks if row.part is not self._rover.position]
        with suppress(TimeoutError):
            async with asyncio.timeout(self._patience_s):
                await asyncio.gather(*waits)

    async def _log_driver_counters(self) -> None:
        """Log errors that parts recovered from."""
        notes, rate = DriverCounters(self._parts, self._log), Rate(NOTE_HZ)
        while notes.counting:
            await rate.wait()
            notes.note(loop_time())

    async def _show_state(self, light: StatusLight) -> None:
        """Keep the status light showing the state of the rover; a light that fails does not stop the run."""
        controller, time, rate, failed = self.controller, loop_time, Rate(LIGHT_HZ), False
        until_s = time() + LAST_END_S
        while True:
            try:
                await light.show(colour(controller, now_s := time(), self._last_end if now_s < until_s else None))
                failed = False
            except DriverError as error:
                if not failed:
                    text = f"The status light did not answer: {error}"
                    self._log.logger.warning("light_failed", t_s=time(), text=text, error=str(error))
                failed = True
            await rate.wait()


def _started(outcome: Outcome) -> None:
    """Raise ``NotArmed`` if the table of modes has refused what was to start."""
    if isinstance(outcome, Refused):
        raise NotArmed(f"not started: {outcome.why}")


def check_parts(rover: Rover, algorithm: Algorithm, config: RoverConfig) -> frozenset[str]:
    """Return the optional parts that a run uses.

    Raises:
        MissingPart: the rover lacks one of them.
    """
    needs = needs_of(algorithm, config)
    for name in sorted(needs):
        if getattr(rover, name, None) is None:
            named = f"anomaly_source = '{config.anomaly_source}'"
            who = f"algorithm '{algorithm.name}'" if name in algorithm.requires else named
            raise MissingPart(
                f"{who} needs a {name} sensor, and rover '{config.name}' has none; choose another algorithm or rover"
            )
    return needs


def needs_of(algorithm: Algorithm, config: RoverConfig) -> frozenset[str]:
    """Return the optional parts that an algorithm needs on a rover of this configuration."""
    parts = (WITNESSES[source].part for source in config.sources)
    return frozenset({*algorithm.requires, *filter(None, parts)})


def make_detector(config: RoverConfig, needs: frozenset[str], parts: Container[str]) -> Detector:
    """Return the detector of a run that uses the parts ``needs``, of a rover that has ``parts``."""
    return Detector(
        config.detector,
        config.vehicle,
        calibration_min=config.safety.calibration_min,
        duty_max=config.safety.duty_max,
        watches_motion="motion" in parts and (config.uses_motion or "motion" in needs),
        watches_contact="contact" in config.sources,
        has_wheels="wheels" in parts,
        witnesses=config.sources - {"motion", "contact"},
        needs_contact="contact" in needs,
        may_reckon=config.safety.on_lost_sense == "continue",
    )


def first_cause(error: BaseException) -> BaseException:
    """Return the first error, taken out of the groups that tasks wrap it in."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
