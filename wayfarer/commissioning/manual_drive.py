"""Manual operation for checks and calibration: ask the operator, drive briefly, sum a push, take a heading."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any, NamedTuple, Protocol, TypeVar

from wayfarer.control.rate import Rate
from wayfarer.hal import CompassReading, DriveMotors, MotionReading, WheelCommand

T = TypeVar("T")

RATE_HZ = 20.0  # of commands: a ThunderBorg stops after 0.25 s without one; and of readings


class Operator(Protocol):
    """The person beside the rover, who reads, answers and moves it. The event loop runs on during each wait."""

    async def say(self, text: str) -> None:
        """Show a line."""

    async def ask(self, question: str) -> bool:
        """Return the answer to a question of yes or no."""

    async def number(self, question: str, default: float) -> float:
        """Return the answer to a question for a number."""

    async def wait(self, text: str) -> None:
        """Show what is to be done, and return when the person says that it is."""


@asynccontextmanager
async def wheels_stopped_after(motors: DriveMotors) -> AsyncGenerator[None]:
    """Stop the wheels at the end, in any case; ``halt`` first, because a cancellation cannot interrupt it."""
    try:
        yield
    finally:
        motors.halt()
        await motors.stop()


async def keep_driving(motors: DriveMotors, command: WheelCommand, for_s: float) -> None:
    """Give a command again and again for a time; what then stops the wheels is the caller's business.

    Raises:
        NotResponding: the board did not acknowledge.
    """
    rate = Rate(RATE_HZ)
    for _ in range(round(for_s * RATE_HZ)):
        await motors.drive(command)
        await rate.wait()


async def sample_headings(read: Callable[[], Awaitable[CompassReading]], for_s: float) -> list[float]:
    """Return the headings of a time, in degrees.

    Raises:
        DriverError: the compass did not answer.
    """
    rate, headings_deg = Rate(RATE_HZ), [(await read()).heading_deg]
    for _ in range(round(for_s * RATE_HZ)):
        await rate.wait()
        headings_deg.append((await read()).heading_deg)
    return headings_deg


async def sample_during(
    doing: Coroutine[Any, Any, object], read: Callable[[], Awaitable[T]], period_s: float
) -> list[T]:
    """Return what a sensor reads until something is done, which is cancelled if the sensor fails.

    Raises:
        DriverError: the sensor did not answer.
    """
    try:
        await read()  # what came before is not ours
    except BaseException:
        doing.close()
        raise
    done, samples = asyncio.ensure_future(doing), []
    try:
        while not done.done():
            await asyncio.wait({done}, timeout=period_s)
            samples.append(await read())
    finally:
        done.cancel()
    await done
    return samples


class Push(NamedTuple):
    """What a motion sensor saw while the rover was pushed; ``unknown`` is the share of readings that said nothing."""

    forward_m: float
    right_m: float
    unknown: float


async def measure_push(
    read: Callable[[], Awaitable[MotionReading]], pushing: Coroutine[Any, Any, object], quality_min: float
) -> Push:
    """Add up what the motion sensor sees until ``pushing`` (a person's answer) is there.

    Raises:
        DriverError: the sensor did not answer.
    """
    readings = await sample_during(pushing, read, 1.0 / RATE_HZ)
    return Push(
        sum(reading.forward_m for reading in readings),
        sum(reading.right_m for reading in readings),
        sum(reading.quality < quality_min for reading in readings) / len(readings),
    )
