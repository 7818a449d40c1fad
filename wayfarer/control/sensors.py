"""Sensor tasks: each samples one sensor at its own rate, and retries after failures.

A sensor that fails is read again within one control period, then closed and opened again with growing pauses, while
the others continue. What its silence does to the wheels is in ``safety.conditions``: without a compass they are held
until the heading is reckoned, without motion sensor or bumper the rover drives on with limits. Any error that is not a
``DriverError`` is a bug, and ends the run.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, Final

from wayfarer.config.rover_file import Rates
from wayfarer.control.rate import AtOnce, Clock, Rate, without_waiting
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import Inbox
from wayfarer.errors import DriverError
from wayfarer.hal import Driver, MotionReading, Rover
from wayfarer.vocabulary import in_words

RETRY_PAUSE_S: Final = 0.05  # after one missed answer, read again within a control period (fault catalogue, fault 1)
RETRY_PAUSE_MAX_S: Final = 2.0
REOPEN_FROM: Final = 2  # failures in a row


class SensorTask(AtOnce):
    """A row of the task table: the part is read at its rate, ``write`` gets each reading, the first sets ``spoke``."""

    def __init__(
        self,
        name: str,
        part: Driver,
        rate_hz: float,
        read: Callable[[], Awaitable[Any]],
        write: Callable[[Any], None],
    ) -> None:
        self.name = name
        self.part = part
        self.rate_hz = rate_hz
        self.read = read
        self.write = write
        self._read_without_waiting = without_waiting(part, "read")
        self.spoke = asyncio.Event()

    def at_once(self, clock: Clock) -> bool:
        """Read a part that never waits."""
        read = self._read_without_waiting
        if read is None:
            return False
        self.write(read(clock.time()))
        return True


def sensor_tasks(rover: Rover, inbox: Inbox, rates: Rates, needs: frozenset[str]) -> tuple[SensorTask, ...]:
    """Return a row for each sensor of a run that uses the optional parts ``needs``."""
    rows = [SensorTask("compass", rover.compass, rates.compass_hz, rover.compass.read, inbox.put_compass)]
    if rover.motion is not None:
        rows.append(SensorTask("motion", rover.motion, rates.motion_hz, rover.motion.read, inbox.put_motion))
    if rover.contact is not None and "contact" in needs:
        rows.append(SensorTask("contact", rover.contact, rates.contact_hz, rover.contact.read, inbox.put_contact))
    if rover.wheels is not None:
        rows.append(SensorTask("wheels", rover.wheels, rates.wheels_hz, rover.wheels.read, inbox.put_wheels))
    if rover.position is not None:
        rows.append(SensorTask("position", rover.position, rates.position_hz, rover.position.read, inbox.put_fix))
    return tuple(rows)


async def keep_sampling(row: SensorTask, inbox: Inbox, log: RunLog, *, opened: bool = True) -> None:
    """Sample for ever; after an error read again soon, and reopen the part if that did not help.

    ``opened``: whether the part is open; else it is opened before it is read, because it may be a wrong one.
    """
    failures, pause_s = (0 if opened else REOPEN_FROM), RETRY_PAUSE_S
    while True:
        try:
            if failures >= REOPEN_FROM:
                await row.part.close()
                await row.part.open()
            read, write, rate = row.read, row.write, Rate(row.rate_hz)
            write(await read())
            failures, pause_s = 0, RETRY_PAUSE_S
            row.spoke.set()
            while True:
                await rate.wait(row)
                write(await read())
        except DriverError as error:
            failures += 1
            t_s = asyncio.get_running_loop().time()
            if row.name == "motion" and failures == 1:  # the motion that was missed is unknown, not zero
                inbox.put_motion(MotionReading(t_s, 0.0, 0.0, 0.0))
            text = f"The {in_words(row.name)} failed: {error} (tried again in {pause_s:.1f} s)"
            log.logger.warning(
                "sensor_failed", t_s=t_s, text=text, sensor=row.name, error=str(error), retry_in_s=pause_s
            )
        await asyncio.sleep(pause_s)
        pause_s = min(2.0 * pause_s, RETRY_PAUSE_MAX_S)
