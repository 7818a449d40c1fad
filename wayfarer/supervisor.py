"""The supervisor: opens a rover's parts, runs its sensor tasks and the helm on one asyncio loop, and stops the wheels.

What runs is a table (``Supervisor.tasks``): a row for each sensor that the run needs, at the sensor's own rate, and
beside them the control tick. A sensor that fails is closed and opened again, with growing pauses, while the others run
on; the safety gate sees its age and holds the wheels. Any other error ends the run. Whichever way a run ends (a limit,
a request, an error, a cancellation), the wheels are stopped on a path that cancellation cannot cut short.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import Any

from wayfarer.config import RoverConfig
from wayfarer.detector import Detector
from wayfarer.errors import DriverError, MissingPart
from wayfarer.escape.api import EscapeHandler
from wayfarer.escape.catalogue import Algorithm
from wayfarer.hal import Driver, MotionReading, Rover
from wayfarer.helm import Helm, Mode, RunEnd
from wayfarer.latest import Cells
from wayfarer.pace import Pace
from wayfarer.records import RunLog

RETRY_PAUSE_S = 0.05  # a single missed answer is asked again within one control period (field.md, fault 1)
RETRY_PAUSE_MAX_S = 2.0


@dataclass(frozen=True, slots=True)
class SensorTask:
    """A row of the task table: read the part at its rate and hand each reading on."""

    name: str
    part: Driver
    rate_hz: float
    read: Callable[[], Awaitable[Any]]
    write: Callable[[Any], None]


class Supervisor:
    """Runs one rover with one algorithm, once. It starts disarmed.

    Raises:
        MissingPart: the algorithm or the configuration needs a part that the rover does not have.
    """

    def __init__(
        self, rover: Rover, config: RoverConfig, algorithm: Algorithm, handler: EscapeHandler, log: RunLog
    ) -> None:
        self._rover = rover
        self._control_hz = config.control_hz
        self._log = log
        self._cells = Cells()
        needs = _check_parts(rover, algorithm, config)
        self.tasks = self._sensor_tasks(config, needs)
        detector = Detector(
            config.detector,
            config.vehicle.max_speed_m_s,
            watches_motion=rover.motion is not None,
            watches_contact=config.anomaly_source == "contact",
            needs_contact="contact" in needs,
        )
        self._helm = Helm(rover.motors, self._cells, config, detector, handler, log)

    @property
    def mode(self) -> Mode:
        """Whether the wheels may turn."""
        return self._helm.mode

    def arm(self, goal_heading_deg: float | None = None) -> None:
        """Begin to arm, towards a heading or, if None, the rover's own at the end of the start delay."""
        self._helm.arm(asyncio.get_running_loop().time(), goal_heading_deg)

    def disarm(self, reason: str) -> None:
        """Stop the wheels until armed anew; the run goes on."""
        self._helm.disarm(asyncio.get_running_loop().time(), reason)

    def finish(self, reason: str, text: str) -> None:
        """End the run at the next tick."""
        self._helm.finish(reason, text)

    async def run(self) -> RunEnd:
        """Open the parts and run until a limit or ``finish``; the wheels are stopped whatever happens.

        Raises:
            DriverError: a part did not open.
        """
        end = RunEnd("failed", "the run was cancelled")
        try:
            for part in self._parts:
                await part.open()
            end = await self._run_tasks()
        except Exception as error:
            cause = _first_cause(error)
            end = RunEnd("failed", f"{type(cause).__name__}: {cause}")
            raise
        finally:
            await unhindered(self._stop_and_close(end))
        return end

    @property
    def _parts(self) -> tuple[Driver, ...]:
        return (self._rover.motors, *(row.part for row in self.tasks))

    async def _run_tasks(self) -> RunEnd:
        async with asyncio.TaskGroup() as group:
            sensors = [group.create_task(self._keep_sampling(row), name=f"sensor:{row.name}") for row in self.tasks]
            await asyncio.sleep(0)  # the sensors speak first, at this and so at every common time of their grids
            try:
                end = await self._control()
            finally:  # the wheels first: a sensor may take its time to let go
                await unhindered(self._rover.motors.stop())
                for task in sensors:
                    task.cancel()
        return end

    async def _stop_and_close(self, end: RunEnd) -> None:
        """Do the last things, each even if another fails: the wheels first, the log last."""
        t_s = asyncio.get_running_loop().time()
        async with AsyncExitStack() as last_things:  # from the last line to the first
            last_things.callback(self._log.close, end.reason, end.text)
            for part in self._parts:
                last_things.push_async_callback(part.close)
            last_things.callback(self._log.event, "wheels_stopped", t_s, reason=end.reason)
            last_things.push_async_callback(self._rover.motors.stop)

    async def _control(self) -> RunEnd:
        """Tick at the control rate until something ends the run; return what did."""
        helm, pace, time = self._helm, Pace(self._control_hz), asyncio.get_running_loop().time
        while helm.end is None:
            await helm.tick(time())
            await pace.wait()
        return helm.end

    def _sensor_tasks(self, config: RoverConfig, needs: frozenset[str]) -> tuple[SensorTask, ...]:
        rover, cells, rates = self._rover, self._cells, config.rates
        rows = [SensorTask("compass", rover.compass, rates.compass_hz, rover.compass.read, cells.compass.write)]
        if rover.motion is not None:
            rows.append(SensorTask("motion", rover.motion, rates.motion_hz, rover.motion.read, cells.motion.write))
        if rover.contact is not None and "contact" in needs:
            rows.append(SensorTask("contact", rover.contact, rates.contact_hz, rover.contact.read, cells.contact.write))
        if rover.position is not None:
            rows.append(
                SensorTask("position", rover.position, rates.position_hz, rover.position.read, self._log.position)
            )
        return tuple(rows)

    async def _keep_sampling(self, row: SensorTask) -> None:
        """Sample for ever; after an error ask again soon, and reopen the part if that did not help."""
        failures = 0

        def write(reading: Any) -> None:
            nonlocal failures
            failures = 0
            row.write(reading)

        while True:
            try:
                if failures > 1:
                    await row.part.close()
                    await row.part.open()
                await self._sample(row, row.write if failures == 0 else write)
            except DriverError as error:
                failures += 1
                pause_s = min(RETRY_PAUSE_S * 2.0 ** (failures - 1), RETRY_PAUSE_MAX_S)
                t_s = asyncio.get_running_loop().time()
                if row.part is self._rover.motion:  # what was missed is unknown, not still
                    self._cells.motion.write(MotionReading(t_s, 0.0, 0.0, 0.0))
                self._log.event("sensor_failed", t_s, sensor=row.name, error=str(error), retry_in_s=pause_s)
                await asyncio.sleep(pause_s)

    async def _sample(self, row: SensorTask, write: Callable[[Any], None]) -> None:
        read, pace = row.read, Pace(row.rate_hz)
        while True:
            write(await read())
            await pace.wait()


def _check_parts(rover: Rover, algorithm: Algorithm, config: RoverConfig) -> frozenset[str]:
    """Return the optional parts that this run uses."""
    needs = set(algorithm.requires)
    needs.add(config.anomaly_source)
    for name in sorted(needs):
        if getattr(rover, name, None) is None:
            who = f"algorithm '{algorithm.name}'" if name in algorithm.requires else f"anomaly_source = '{name}'"
            raise MissingPart(
                f"{who} needs a {name} sensor, and rover '{config.name}' has none; choose another algorithm or rover"
            )
    return frozenset(needs)


def _first_cause(error: BaseException) -> BaseException:
    """Return what went wrong first, out of the groups that tasks wrap it in."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error


async def unhindered(work: Coroutine[Any, Any, None]) -> None:
    """Do the work to its end even while being cancelled; the cancellation is raised afterwards."""
    task = asyncio.ensure_future(work)
    cancelled: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError as error:
            if task.cancelled():
                raise
            cancelled = error
    task.result()
    if cancelled is not None:
        raise cancelled
