"""Runs a rover as a service: field log, control socket, watchdogs and signals."""

from __future__ import annotations

import asyncio
import hashlib
import os
import signal
from collections.abc import Awaitable, Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractAsyncContextManager, AsyncExitStack, suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from random import Random
from time import CLOCK_BOOTTIME, clock_gettime
from typing import Any, Protocol, TypeVar, TypeVarTuple, Unpack

import msgspec

from wayfarer import __version__
from wayfarer.commissioning.checks import ARMING, Check, HostEnvironment, Inspection, system
from wayfarer.commissioning.checks.system import card_health
from wayfarer.config.calibration_file import Calibration
from wayfarer.config.factory import UNCALIBRATED
from wayfarer.config.own_file import own_mistake, used
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.modes import Mode
from wayfarer.control.run_log import RunLog, Tee
from wayfarer.control.shutdown import STOP_DEADLINE_S
from wayfarer.control.supervisor import Supervisor, check_parts, first_cause
from wayfarer.daemon.arming_check import running_inspection
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.driven import DrivenBoard, motors_device, motors_lock, remove_record, write_record
from wayfarer.daemon.last_mission import LastMission, MissionKeeper, read_last_mission
from wayfarer.daemon.signals import handle_signals
from wayfarer.daemon.socket.paths import single_daemon
from wayfarer.daemon.socket.protocol import Commands
from wayfarer.daemon.socket.server import ControlServer
from wayfarer.daemon.stderr_writer import StderrWriter
from wayfarer.daemon.storage import EVERY_S, OLD_RUNS_EVERY_S, POWER_EVERY_S, Storage, Watch, health, watching
from wayfarer.daemon.watchdog import StallGuard, SystemdNotifier, WatchdogFeed, feed_watchdog, watchdog_period_s
from wayfarer.errors import BadInput, DriverError, WayfarerError
from wayfarer.escape.catalogue import Algorithm
from wayfarer.fieldlog.folders import LOOK_S, new_run_folder
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.record import AnyRecord, Computer, World
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import STOP, DriveMotors, MotorHealth, Rover, WheelCommand, error_counts_of
from wayfarer.safety.mission import RunEnd
from wayfarer.waiting_thread import OneCall, answer_within

# -- dry run ---------------------------------------------------------------------------------------------------------
# Dry run: everything on the real rover except motion.


class DryMotors:
    """Motors that are opened, asked and stopped, but never commanded to turn; implements ``hal.DriveMotors``."""

    def __init__(self, motors: DriveMotors) -> None:
        self._motors = motors
        self.name = f"{motors.name} (dry run)"
        self.deadman_s = motors.deadman_s

    @property
    def error_counts(self) -> Mapping[str, int]:
        """The error counts of the motors."""
        return error_counts_of(self._motors)

    async def open(self) -> None:
        """Open the motors: their deadman is verified as in any run."""
        await self._motors.open()

    async def close(self) -> None:
        """Close the motors."""
        await self._motors.close()

    async def drive(self, command: WheelCommand) -> WheelCommand:  # noqa: ARG002
        """Command zero, independent of the wanted duties."""
        return await self._motors.drive(STOP)

    async def stop(self) -> None:
        """Stop the motors."""
        await self._motors.stop()

    def halt(self) -> None:
        """Stop the motors, from any thread."""
        self._motors.halt()

    async def read_back(self) -> WheelCommand | None:
        """Ask the motors."""
        return await self._motors.read_back()

    async def health(self) -> MotorHealth:
        """Ask the motors."""
        return await self._motors.health()


# The kernel's identifier of this boot: if two runs have the same, their times since boot are comparable.
BOOT_ID = "/proc/sys/kernel/random/boot_id"


@dataclass(frozen=True, slots=True)
class RoverSetup:
    """A rover to serve, with its checks and what its log needs.

    ``checks`` must not fail before it is armed; ``devices`` are the device files of its parts; ``close_buses`` is
    called last. The others are for the log: the calibration; for a simulated rover, ``world`` is the forest, for the
    first record, and ``ground_truth_log`` makes the log that writes the ground truth into the same file.
    """

    rover: Rover
    calibration: Calibration | None = None
    checks: Sequence[Check] = ARMING
    devices: tuple[str, ...] = ()
    close_buses: Callable[[], Awaitable[None]] | None = None
    world: Mapping[str, Any] | None = None
    ground_truth_log: Callable[[FieldLog], RunLog] | None = None


class Viewer(Protocol):
    """The live page or a ground station: gets every record of the log, and may serve clients on the daemon's loop."""

    def show(self, record: AnyRecord) -> None:
        """Take a record as it is written, the first one before anything is open. Must not wait, nor change it."""

    def serving(self, commands: Commands) -> AbstractAsyncContextManager[None]:
        """Serve clients while entered; ``commands`` are those of the control socket."""


@dataclass(frozen=True, slots=True)
class Service:
    """Everything that one daemon needs to run.

    ``make_rover`` is called on the running loop with a function that ends the run (a simulated rover calls it when it
    has escaped). ``seed`` is for algorithms that use random numbers, and for the ladder. ``console`` takes a function
    that writes a line to stderr, and returns one that shows a record there; None shows nothing. ``viewers`` show the
    run. ``addresses`` are theirs, for ``status`` only: that of the live page has a token, and every user may read the
    log.
    """

    config: RoverConfig
    algorithm: Algorithm
    seed: int
    make_rover: Callable[[Callable[[str, str], None]], RoverSetup]
    logs: Path
    socket: Path
    simulated: bool
    dry_run: bool
    console: Callable[[Callable[[str], None]], Callable[[AnyRecord], None]] | None = None
    viewers: Sequence[Viewer] = ()
    addresses: Mapping[str, str] = field(default_factory=dict)


def serve(service: Service) -> RunEnd:
    """Run the daemon until a signal or a request ends it, not with a mission; return why.

    Raises:
        AlreadyRunning: another daemon serves this socket, or drives these motors.
        BadInput: the log's folder may not be written, or the socket or the record of what is driven cannot be made.
        WayfarerError: a part did not open, or a file of one's own has a bug; the wheels were stopped. Any other error
            is a bug of wayfarer and is raised unchanged.
    """
    config = service.config
    motors = None if service.simulated else config.parts.get("motors")
    device = None if motors is None else motors_device(config)

    async def run() -> RunEnd:
        daemon = Daemon(service)
        end = await daemon.run()
        if motors is not None and daemon.wheels_stopped:
            remove_record(service.socket)
        return end

    with single_daemon(service.socket), motors_lock(device), asyncio.Runner(loop_factory=DaemonLoop) as runner:
        if motors is not None:
            write_record(service.socket, DrivenBoard(motors, config.buses))
        try:
            return runner.run(run())
        except Exception as error:
            cause = first_cause(error)
            if not isinstance(cause, WayfarerError) and (mistake := own_mistake(cause)):
                raise WayfarerError(f"a mistake in a file of your own ended the run: {mistake}") from error
            raise (cause if isinstance(cause, WayfarerError) else error) from None


T = TypeVar("T")
Ts = TypeVarTuple("Ts")


THREADS = 8  # of a loop, for calls that may hang for ever; chosen by us


class DaemonLoop(asyncio.SelectorEventLoop):
    """The loop of a daemon. Its clock goes on while the computer sleeps: what was asked before that has aged, too."""

    def __init__(self) -> None:
        super().__init__()
        self._calls: list[tuple[asyncio.Future[Any], Callable[[], Any]]] = []  # that wait for a thread
        self._busy = 0

    def time(self) -> float:
        """Return the seconds since the computer was started; every process of it can read this clock."""
        return clock_gettime(CLOCK_BOOTTIME)

    def run_in_executor(
        self, _executor: Executor | None, func: Callable[[Unpack[Ts]], T], *args: Unpack[Ts]
    ) -> asyncio.Future[T]:
        """Run in a thread for which the process does not wait at its end: the disk may hang for ever.

        It waits for a thread if all hang, and is not begun if nobody waits for it any more.
        """
        future: asyncio.Future[T] = self.create_future()
        self._calls = [each for each in self._calls if not each[0].done()] + [(future, partial(func, *args))]
        self._begin_calls()
        return future

    def _begin_calls(self) -> None:
        while self._calls and self._busy < THREADS:
            future, call = self._calls.pop(0)
            if not future.done():
                OneCall(partial(self._work, future, call)).start()
                self._busy += 1

    def _work(self, future: asyncio.Future[Any], call: Callable[[], Any]) -> None:
        """Call, and pass the result to the loop; runs in a thread."""
        try:
            tell = partial(future.set_result, call())
        except BaseException as error:
            tell = partial(future.set_exception, error)
        with suppress(RuntimeError):  # the loop is closed, and nobody waits any more
            self.call_soon_threadsafe(self._end_call, future, tell)

    def _end_call(self, future: asyncio.Future[Any], tell: Callable[[], None]) -> None:
        self._busy -= 1
        if not future.done():
            tell()
        self._begin_calls()


class Daemon:
    """One rover and everything around it; made on the running loop."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._loop = asyncio.get_running_loop()
        config = service.config
        self._setup = rover_setup = service.make_rover(self._finish)
        rover = rover_setup.rover
        check_parts(rover, service.algorithm, config)  # before a log is made for a run that cannot begin
        self._rover = replace(rover, motors=DryMotors(rover.motors)) if service.dry_run else rover
        self._notifier = SystemdNotifier(os.environ.get("NOTIFY_SOCKET"))
        self._lines = StderrWriter()
        self._guard = StallGuard(self._rover.motors.halt, self._lines.write, self._tell_of_stall)
        self._suspension: asyncio.TimerHandle | None = None
        try:
            before = answer_within(LOOK_S, partial(read_last_mission, service.logs), None)
        except BadInput as error:
            before = None
            self._lines.write(str(error))
        self._folder = folder = new_run_folder(service.logs, needed=False)
        about = {
            "version": __version__,
            "rover": config.name,
            "algorithm": service.algorithm.name,
            "simulated": service.simulated,
            "dry_run": service.dry_run,
            # The whole path: the client may be in another folder; JSON has no bytes that are not text.
            "log": os.fsencode(folder.absolute()).decode(errors="replace"),
            "start_delay_s": config.safety.start_delay_s,
        }
        self._ladder_seed = f"{service.seed}/ladder"  # it must not draw what the algorithm draws
        self._sink = Sink(folder, config.log, self._lines.write, self._loop.time)
        shown_to: list[Callable[[AnyRecord], None]] = [viewer.show for viewer in service.viewers]
        if service.console is not None:
            shown_to.append(service.console(self._lines.write))
        self._field_log = FieldLog(self._sink, self._header(about), t_s=self._loop.time(), viewers=shown_to)
        ground_truth_logs = [rover_setup.ground_truth_log(self._field_log)] if rover_setup.ground_truth_log else []
        keeper = MissionKeeper(folder, self._field_log, self._lines.write)
        self._log = Tee(keeper, self._field_log, *ground_truth_logs, WatchdogFeed(self._notifier, self._guard))
        self._log.bind(run=folder.name)
        if before is not None:
            self._tell_of_last(before)
        handler = service.algorithm.make(config.escape, config.vehicle, Random(service.seed))
        self._supervisor = Supervisor(
            self._rover, config, service.algorithm, handler, self._log,
            ladder_seed=self._ladder_seed, goes_on=True, last_end=None if before is None else before.end,
        )  # fmt: skip
        self._storage = Storage(folder, config.log, self._sink, self._log, self._is_disarmed)
        checks: list[Check] = [*rover_setup.checks, partial(system.log, lambda: self._sink.trouble)]
        self._commands = RoverCommands(
            self._supervisor, self._rover.motors, self._inspect, self._log,
            {**about, **service.addresses, "last_mission": before and asdict(before) | {"text": before.text}}, checks,
            lambda: {"log_dropped": self._field_log.dropped, **self._storage.status()}, self._storage.keep,
        )  # fmt: skip

    @property
    def wheels_stopped(self) -> bool:
        """Whether the wheels were stopped at the end, as far as the board reports it."""
        return self._supervisor.wheels_stopped

    async def run(self) -> RunEnd:
        """Run until something ends it."""
        handle_signals(self._end_by, self._suspend_by)
        server = ControlServer(
            self._service.socket,
            self._commands,
            declination_deg=self._service.config.declination_deg,
            on_error=self._tell_of_error,
        )
        try:
            async with server, AsyncExitStack() as stack:
                for viewer in self._service.viewers:
                    await stack.enter_async_context(viewer.serving(self._commands))
                watches = [
                    Watch("computer watch", EVERY_S, self._note_computer),
                    Watch("power watch", POWER_EVERY_S, self._note_power),
                ]
                if self._service.config.log.keep_mb is not None:
                    watches.append(Watch("old runs", OLD_RUNS_EVERY_S, self._delete_old_runs))
                stack.enter_context(watching(*watches))
                return await self._run_watched()
        finally:
            self._guard.stop()
            try:
                if self._setup.close_buses is not None:
                    await self._setup.close_buses()
            finally:
                self._lines.close()

    async def _run_watched(self) -> RunEnd:
        """Run beside the task that feeds systemd's watchdog; an error in one ends both."""
        period_s = watchdog_period_s(os.environ)
        async with asyncio.TaskGroup() as group:
            feeding = None
            if period_s is not None:
                feed = feed_watchdog(self._notifier, self._supervisor.is_fresh, period_s)
                feeding = group.create_task(feed, name="watchdog")
            try:
                return await self._supervisor.run()
            finally:
                if feeding is not None:
                    feeding.cancel()

    def _header(self, about: dict[str, Any]) -> dict[str, Any]:
        config, algorithm = self._service.config.model_dump(mode="json"), self._service.algorithm
        drivers = [table["driver"] for table in config["parts"].values()]
        files = used({algorithm.name: algorithm.origin, **dict(zip(drivers, drivers, strict=True))})
        return {
            **about,
            "files": {name: file._asdict() for name, file in files.items()},
            "world": msgspec.convert(self._setup.world, World | None),
            "seed": self._service.seed,
            "algorithm_seed": self._service.seed,
            "ladder_seed": self._ladder_seed,
            "parts": {name: part.name for name, part in self._rover.parts.items()},
            "calibration": self._setup.calibration,
            "config": config,
            "config_hash": _hash(config),
            "boot_id": system.system_text(BOOT_ID),
        }

    def _note_computer(self) -> None:
        """Log the computer's health; called in another thread."""
        found, card = health(self._service.logs), card_health(self._service.logs)

        def note() -> None:
            sync_ms = self._storage.take_health(self._loop.time(), card)
            log = {"log_dropped": self._field_log.dropped, "log_sync_ms": sync_ms}
            self._field_log.note(Computer, self._loop.time(), {**found, **card._asdict(), **log})

        self._loop.call_soon_threadsafe(note)

    def _delete_old_runs(self) -> None:
        """Delete old runs and log which; called in another thread."""
        if (pruned := self._storage.delete_old_runs()) is not None:
            self._loop.call_soon_threadsafe(lambda: self._storage.take_pruned(self._loop.time(), pruned))

    def _is_disarmed(self) -> bool:
        return self._supervisor.controller.mode is Mode.DISARMED

    def _note_power(self) -> None:
        """Pass the computer's power flags to the controller; called in another thread."""
        flags = system.power_flags()
        self._loop.call_soon_threadsafe(lambda: self._supervisor.inbox.put_power(self._loop.time(), flags))

    def _tell_of_last(self, before: LastMission) -> None:
        """Log how the last mission ended, also if it was cut off (fault catalogue, fault 33)."""
        text = before.text
        about = {("last_run" if key == "run" else key): value for key, value in asdict(before).items()}
        if before.mission_ended is None:
            self._field_log.logger.warning("unclean_shutdown", t_s=self._loop.time(), text=text, **about)
        else:
            self._field_log.logger.info("last_mission", t_s=self._loop.time(), text=text, **about)

    def _inspect(self, motors_failed: DriverError | None) -> Inspection:
        service, known = self._service, self._setup.calibration or UNCALIBRATED
        host = HostEnvironment.here(service.logs, self._setup.devices, self._loop.time())
        return running_inspection(service.config, self._rover, host, self._supervisor, motors_failed, known)

    def _finish(self, reason: str, text: str) -> None:
        self._supervisor.finish(reason, text)

    def _end_by(self, name: str) -> None:
        """End the run; the wheels do not wait for the next tick."""
        self._rover.motors.halt()
        self._finish("signal", f"ended by {name}")

    def _suspend_by(self, name: str) -> None:
        """Disarm, and suspend the process after the wheels have had time to stop. When it continues, it is disarmed."""
        self._rover.motors.halt()
        self._supervisor.disarm(f"suspended by {name}")
        if self._suspension is not None:
            self._suspension.cancel()  # the keys were pressed twice
        self._suspension = self._loop.call_later(STOP_DEADLINE_S, os.kill, os.getpid(), signal.SIGSTOP)

    def _tell_of_stall(self, stall_s: float, where: str) -> None:
        text = f"The control loop stood still for {stall_s:.1f} s in {where}"
        self._log.logger.error("loop_stalled", t_s=self._loop.time(), text=text, stall_s=round(stall_s, 3), where=where)

    def _tell_of_error(self, error: Exception) -> None:
        text = f"An error inside wayfarer, in a command: {error!r}"
        self._log.logger.error("control_error", t_s=self._loop.time(), text=text, error=repr(error))


def _hash(config: dict[str, Any]) -> str:
    """Return a short hash of a rover's settings: BLAKE2b of their JSON with sorted keys."""
    return hashlib.blake2b(msgspec.json.encode(config, order="deterministic"), digest_size=8).hexdigest()
