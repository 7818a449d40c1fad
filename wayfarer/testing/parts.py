"""Conformance checks of a part: life cycle, readings, and that it always stops."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from math import isfinite
from typing import Any, TypeVar

from wayfarer.errors import DriverError
from wayfarer.hal import (
    STOP,
    Colour,
    Compass,
    ContactSensor,
    DriveMotors,
    Driver,
    MotionSensor,
    PositionReceiver,
    Side,
    StatusLight,
    WheelCommand,
)

READINGS = 5  # taken from each sensor
READING_GAP_S = 0.05
FRESH_S = 1.0  # older than this when it is returned, a reading says nothing about now

P = TypeVar("P", bound=Driver)


async def check_compass(factory: Callable[[], Compass], unreachable: Callable[[], Compass] | None = None) -> None:
    """Check the life cycle and the readings of a ``hal.Compass``."""
    await _check_life_cycle(factory, unreachable)
    for reading in await _readings(factory()):
        _check_range("heading_deg", reading.heading_deg, 0.0, 360.0)
        assert reading.heading_deg < 360.0, "heading_deg is 360.0: that is 0 (wayfarer.angles.wrap360)"
        _check_range("pitch_deg", reading.pitch_deg, -180.0, 180.0)
        _check_range("roll_deg", reading.roll_deg, -180.0, 180.0)
        assert reading.calibration in (None, 0, 1, 2, 3), f"calibration {reading.calibration!r} is not 0..3 or None"


async def check_motion_sensor(
    factory: Callable[[], MotionSensor], unreachable: Callable[[], MotionSensor] | None = None
) -> None:
    """Check the life cycle and the readings of a ``hal.MotionSensor``."""
    await _check_life_cycle(factory, unreachable)
    for reading in await _readings(factory()):
        _check_range("forward_m", reading.forward_m, -1.0, 1.0)
        _check_range("right_m", reading.right_m, -1.0, 1.0)
        _check_range("quality", reading.quality, 0.0, 1.0)


async def check_contact_sensor(
    factory: Callable[[], ContactSensor], unreachable: Callable[[], ContactSensor] | None = None
) -> None:
    """Check the life cycle and the readings of a ``hal.ContactSensor``."""
    await _check_life_cycle(factory, unreachable)
    for reading in await _readings(factory()):
        assert isinstance(reading.sides, tuple), f"sides {reading.sides!r} is not a tuple: readings are immutable"
        assert all(isinstance(side, Side) for side in reading.sides), f"sides {reading.sides!r} are not all hal.Side"
        if reading.obstacle_bearing_deg is not None:
            _check_range("obstacle_bearing_deg", reading.obstacle_bearing_deg, 0.0, 180.0)


async def check_motors(
    factory: Callable[[], DriveMotors], unreachable: Callable[[], DriveMotors] | None = None
) -> None:
    """Check the life cycle of ``hal.DriveMotors``, that ``stop`` and ``halt`` always work, and what ``drive`` applied.

    The wheels turn, both ways: lift the rover from the ground before this is run on a real one.
    """
    await _check_life_cycle(factory, unreachable)
    for make in (factory, unreachable):
        if make is not None:
            motors = make()
            motors.halt()
            await _promised("stop() before open()", motors.stop())
            await _promised("a second stop()", motors.stop())
    async with _opened(factory()) as motors:
        try:
            await _check_driving(motors)
        finally:
            await _promised("stop()", motors.stop())


async def _check_driving(motors: DriveMotors) -> None:
    for command in (WheelCommand(0.2, 0.2), WheelCommand(-0.2, 0.2), STOP):
        applied = await motors.drive(command)
        assert isinstance(applied, WheelCommand), f"drive() returned {applied!r}, not what it applied"
        for duty, wanted in zip(applied, command, strict=True):
            assert abs(duty) <= abs(wanted) and duty * wanted >= 0.0, f"{command} was applied as {applied}"
    turning = await motors.read_back()
    assert turning in (None, STOP), f"read_back() says {turning} after a stop: None means that it cannot be asked"
    motors.halt()
    health = await motors.health()
    assert health.battery_v is None or health.battery_v >= 0.0, f"battery_v {health.battery_v}: None means unknown"


async def check_position_receiver(
    factory: Callable[[], PositionReceiver], unreachable: Callable[[], PositionReceiver] | None = None
) -> None:
    """Check the life cycle of a ``hal.PositionReceiver``, and what it gives: a fix that can be, or None."""
    await _check_life_cycle(factory, unreachable)
    async with _opened(factory()) as receiver:
        fix = await receiver.read()
    if fix is not None:
        _check_range("latitude_deg", fix.latitude_deg, -90.0, 90.0)
        _check_range("longitude_deg", fix.longitude_deg, -180.0, 180.0)
        assert fix.error_m is None or fix.error_m >= 0.0, f"error_m {fix.error_m}: None means unknown"


async def check_status_light(
    factory: Callable[[], StatusLight], unreachable: Callable[[], StatusLight] | None = None
) -> None:
    """Check the life cycle of a ``hal.StatusLight``, and that it takes any colour, again and again."""
    await _check_life_cycle(factory, unreachable)
    async with _opened(factory()) as light:
        for colour in (Colour(1.0, 0.6, 0.0), Colour(1.0, 0.6, 0.0), Colour(0.0, 0.0, 0.0)):
            await light.show(colour)


@asynccontextmanager
async def _opened(part: P) -> AsyncIterator[P]:
    await part.open()
    try:
        yield part
    finally:
        await part.close()


async def _check_life_cycle(factory: Callable[[], P], unreachable: Callable[[], P] | None) -> None:
    part = factory()
    assert isinstance(part.name, str) and part.name, "name is empty: logs and messages need it"
    await _promised("close() before open()", part.close())
    await part.open()
    await _promised("close()", part.close())
    await _promised("a second close()", part.close())
    await part.open()  # the supervisor opens a part again after a failure
    await _promised("close() after the second open()", part.close())
    if unreachable is not None:
        await _check_failed_open(unreachable())


async def _check_failed_open(part: Driver) -> None:
    try:
        await part.open()
    except DriverError as error:
        assert str(error), "open() failed without a text: say bus, address and the likely cause"
    except Exception as error:
        raise AssertionError(f"open() without hardware raised {error!r}; it must be a NotResponding") from error
    else:
        raise AssertionError("open() without hardware did not fail; it must speak to the part")
    await _promised("close() after a failed open()", part.close())


async def _promised(what: str, call: Any) -> None:
    """Await something that must never raise."""
    try:
        await call
    except Exception as error:
        raise AssertionError(f"{what} raised {error!r}; it must never raise") from error


async def _readings(sensor: Any) -> list[Any]:
    """Return a few readings, each with a fresh time."""
    time = asyncio.get_running_loop().time
    readings = []
    async with _opened(sensor):
        for _ in range(READINGS):
            await asyncio.sleep(READING_GAP_S)
            asked_s, reading = time(), await sensor.read()
            assert isinstance(reading.t_s, float) and asked_s - FRESH_S <= reading.t_s <= time(), (
                f"t_s {reading.t_s!r} is not within the last {FRESH_S:g} s on the event loop's clock ({time():.3f})"
            )
            readings.append(reading)
    return readings


def _check_range(name: str, value: float, low: float, high: float) -> None:
    assert isfinite(value), f"{name} is {value}: raise BadReading instead"
    assert low <= value <= high, f"{name} {value} is not in {low:g}..{high:g}"
