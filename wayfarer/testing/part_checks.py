"""The checks of parts: the promises of ``hal`` on the life cycle, the readings, and that the wheels stop."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from math import isfinite, nextafter
from typing import Any, Generic, TypeVar
from unittest import SkipTest

from wayfarer.errors import DriverError
from wayfarer.hal import (
    STOP,
    Colour,
    Compass,
    CompassReading,
    ContactReading,
    ContactSensor,
    DriveMotors,
    Driver,
    MotionReading,
    MotionSensor,
    MotorHealth,
    PositionFix,
    PositionReceiver,
    Side,
    StatusLight,
    WheelCommand,
    WheelReading,
    WheelSensor,
)
from wayfarer.testing.promises import Promise, Report, checks_in, promised, run_all

READINGS = 5  # taken from each sensor
READING_GAP_S = 0.05
FRESH_S = 1.0  # older than this when it is returned, a reading says nothing about now
BLOCKS_S = 1.0  # a halt that takes longer waits for something
DEADMAN_LATE_S = 0.15
DUTY_STEP = 0.02  # as a board may round
GENTLE = WheelCommand(0.2, 0.2)

BELOW_180, BELOW_360 = nextafter(180.0, 0.0), nextafter(360.0, 0.0)  # 360 is 0

SENSORS = ("compass", "motion", "contact", "wheels")
READING = (CompassReading, MotionReading, ContactReading, WheelReading, PositionFix)
PARTS = (*SENSORS, "position", "motors", "light")
TABLE: list[Promise] = []

P = TypeVar("P", bound=Driver)
Make = Callable[[], Any]
_of = partial(promised, TABLE)


@asynccontextmanager
async def _opened(part: P) -> AsyncIterator[P]:
    await part.open()
    try:
        yield part
    finally:
        await part.close()


async def _never_raises(what: str, call: Any) -> None:
    try:
        await call
    except Exception as error:
        raise AssertionError(f"{what} raised {error!r}") from error


async def _readings(make: Make) -> list[Any]:
    readings = []
    async with _opened(make()) as sensor:
        for _ in range(READINGS):
            await asyncio.sleep(READING_GAP_S)
            readings.append(await sensor.read())
    return readings


async def _in_range(make: Make, *, unit: str, low: float, high: float, names: tuple[str, ...]) -> None:
    """Check values of readings that are not None; skip if there is none."""
    values = [
        (name, value) for each in await _readings(make) for name in names if (value := getattr(each, name)) is not None
    ]
    if not values:
        raise SkipTest(f"no reading had {' or '.join(names)}")
    for name, value in values:
        if not low <= value <= high:
            raise AssertionError(f"{name} is {value}{unit}, not in {low:g}..{high:g}")


# -- every part --------------------------------------------------------------------------------------------------------


@_of("wayfarer.hal.Driver", "``name`` is for logs and messages: the part and where it is connected.", *PARTS)
async def _has_a_name(make: Make) -> None:
    name = make().name
    if not (isinstance(name, str) and name):
        raise AssertionError(f"name is {name!r}")


@_of("wayfarer.hal", "``__init__`` only stores its arguments and uses no bus", *PARTS, without_hardware=True)
async def _is_made_without_hardware(unreachable: Make) -> None:
    unreachable()


@_of("wayfarer.hal.Driver.close", "Safe twice and after a failed ``open``; never raises.", *PARTS)
async def _closes_at_any_time(make: Make) -> None:
    part = make()
    await _never_raises("close() before open()", part.close())
    await part.open()
    await _never_raises("close()", part.close())
    await _never_raises("a second close()", part.close())


@_of("wayfarer.hal", "``open`` may be called again, as it is after a failure.", *PARTS)
async def _opens_again(make: Make) -> None:
    part = make()
    for _ in range(2):
        await part.open()
        await part.close()


@_of(
    "wayfarer.hal.Driver.open",
    "NotResponding: no answer; the text names bus, address and the likely cause.",
    *PARTS,
    without_hardware=True,
)
async def _missing_hardware_is_told(unreachable: Make) -> None:
    part = unreachable()
    try:
        await part.open()
    except DriverError as error:
        if not str(error):
            raise AssertionError("open() without hardware failed without a text") from None
    except Exception as error:
        raise AssertionError(f"open() without hardware raised {error!r}, which is not a DriverError") from error
    else:
        raise AssertionError("open() without hardware did not fail; it must speak to the part")


@_of(
    "wayfarer.hal.Driver.close",
    "Safe twice and after a failed ``open``; never raises.",
    *PARTS,
    without_hardware=True,
)
async def _closes_after_a_failed_open(unreachable: Make) -> None:
    part = unreachable()
    try:
        await part.open()
    except Exception:
        await _never_raises("close() after a failed open()", part.close())
    else:
        raise SkipTest("open() without hardware did not fail")


# -- sensors -----------------------------------------------------------------------------------------------------------


@_of(
    "wayfarer.hal",
    "``t_s`` is the time of the reading on the event loop's clock (``asyncio.get_running_loop().time()``), in seconds.",
    *SENSORS,
)
async def _reading_is_of_now(make: Make) -> None:
    time = asyncio.get_running_loop().time
    async with _opened(make()) as sensor:
        for _ in range(READINGS):
            await asyncio.sleep(READING_GAP_S)
            asked_s, reading = time(), await sensor.read()
            if not (isinstance(reading.t_s, float) and asked_s - FRESH_S <= reading.t_s <= time()):
                raise AssertionError(f"t_s is {reading.t_s!r} s, and on the event loop's clock it was {time():.3f} s")


@_of(
    "wayfarer.hal",
    "readings are immutable, finite and in range; a driver that cannot give such a reading raises ``BadReading``.",
    *SENSORS,
    "position",
)
async def _reading_is_finite(make: Make) -> None:
    for reading in await _readings(make):
        if reading is None:
            continue  # a receiver without a fix
        if not isinstance(reading, READING):
            raise AssertionError(f"read() returned {reading!r}, which is none of the readings in hal")
        for name, value in zip(reading.__match_args__, reading, strict=True):
            if isinstance(value, float) and not isfinite(value):
                raise AssertionError(f"{name} is {value}")


# Name, kind, where the sentence is, the sentence; values of a reading, their unit, and their range.
_RANGES: tuple[tuple[str, str, str, str, tuple[str, ...], str, float, float], ...] = (
    ("heading_is_in_range", "compass", "hal", "headings are degrees clockwise from magnetic north in [0, 360).",
        ("heading_deg",), " degrees", 0.0, BELOW_360),
    ("tilt_is_in_range", "compass", "hal",
        "pitch is positive nose up, roll is positive right side down, both in degrees in [-180, 180].",
        ("pitch_deg", "roll_deg"), " degrees", -180.0, 180.0),
    ("calibration_is_in_range", "compass", "hal.CompassReading",
        "``calibration`` is 0 (not calibrated) to 3 (fully), or None if the part does not report it.",
        ("calibration",), "", 0, 3),
    ("quality_is_in_range", "motion", "hal.MotionReading", "``quality`` is from 0 (nothing is known) to 1.",
        ("quality",), "", 0.0, 1.0),
    ("displacement_is_of_one_read", "motion", "hal.MotionReading",
        "Displacement over ground since the previous read, in the body's own frame.",
        ("forward_m", "right_m"), f" metres in {READING_GAP_S:g} s", -1.0, 1.0),
    ("bearing_is_in_range", "contact", "hal.ContactReading",
        "``obstacle_bearing_deg`` is the compass bearing of the long axis of the obstacle, in [0, 180), or None if "
        "that is not known (a tree, a rover that cannot sense it).",
        ("obstacle_bearing_deg",), " degrees", 0.0, BELOW_180),
    ("way_is_of_one_read", "wheels", "hal.WheelReading",
        "``left_m`` and ``right_m`` are how far the rims of a side have turned since the previous read, ahead "
        "positive; where the body went meanwhile is another matter.",
        ("left_m", "right_m"), f" metres in {READING_GAP_S:g} s", -1.0, 1.0),
    ("current_is_a_size", "wheels", "hal.WheelReading",
        "``left_a`` and ``right_a`` are the size of the current of a side's motors in amperes, 0 or more.",
        ("left_a", "right_a"), " amperes", 0.0, 1000.0),
)  # fmt: skip
for _name, _kind, _where, _sentence, _values, _unit, _low, _high in _RANGES:
    _in_this_range = partial(_in_range, unit=_unit, low=_low, high=_high, names=_values)
    _of(f"wayfarer.{_where}", _sentence, _kind, name=_name)(_in_this_range)


@_of("wayfarer.hal.ContactReading", "``sides`` is empty when nothing does.", "contact")
async def _sides_are_a_tuple_of_sides(make: Make) -> None:
    for reading in await _readings(make):
        if not (isinstance(reading.sides, tuple) and all(isinstance(side, Side) for side in reading.sides)):
            raise AssertionError(f"sides is {reading.sides!r}, not a tuple of hal.Side: readings are immutable")


@_of(
    "wayfarer.hal.PositionFix",
    "Degrees north and east (WGS 84) and the horizontal error in metres (None if the receiver does not report it).",
    "position",
)
async def _fix_is_on_the_earth(make: Make) -> None:
    async with _opened(make()) as receiver:
        fix = await receiver.read()
    if fix is None:
        raise SkipTest("it had no fix")
    if not isinstance(fix, PositionFix):
        raise AssertionError(f"read() returned {fix!r}")
    if not (-90.0 <= fix.latitude_deg <= 90.0 and -180.0 <= fix.longitude_deg <= 180.0):
        raise AssertionError(f"latitude_deg {fix.latitude_deg} and longitude_deg {fix.longitude_deg} are nowhere")
    if fix.error_m is not None and not fix.error_m >= 0.0:
        raise AssertionError(f"error_m is {fix.error_m} metres")


@_of("wayfarer.hal.StatusLight.show", "Show a colour until the next call.", "light")
async def _shows_any_colour(make: Make) -> None:
    async with _opened(make()) as light:
        for colour in (Colour(1.0, 0.6, 0.0), Colour(1.0, 0.6, 0.0), Colour(0.0, 0.0, 0.0)):
            await light.show(colour)


# -- motors ------------------------------------------------------------------------------------------------------------

STOPS = "Stop both wheels. Needs no earlier state, works before ``open``, may be repeated, never raises."
HALTS = "It never raises and never blocks."


@asynccontextmanager
async def _driving(make: Make, command: WheelCommand = GENTLE) -> AsyncIterator[tuple[DriveMotors, WheelCommand]]:
    """Yield open motors and what they applied of a command; they are stopped also after an error."""
    async with _opened(make()) as motors:
        try:
            yield motors, await motors.drive(command)
        finally:
            await motors.stop()


async def _asked(motors: DriveMotors) -> WheelCommand:
    if (turning := await motors.read_back()) is None:
        raise SkipTest("the board cannot be asked")
    return turning


async def _stops(make: Make) -> None:
    motors = make()
    await _never_raises("stop() before open()", motors.stop())
    await _never_raises("a second stop()", motors.stop())
    await motors.close()


async def _halts(make: Make) -> None:
    motors, raised = make(), []

    def halt() -> None:
        try:
            motors.halt()
        except Exception as error:
            raised.append(error)

    thread = threading.Thread(target=halt, daemon=True)
    thread.start()
    thread.join(BLOCKS_S)
    if thread.is_alive():
        raise AssertionError(f"halt() had not returned after {BLOCKS_S:g} s")
    if raised:
        raise AssertionError(f"halt() raised {raised[0]!r}")
    await motors.close()


for _where, _sentence, _attempt in (("stop", STOPS, _stops), ("halt", HALTS, _halts)):
    _motors = partial(_of, f"wayfarer.hal.DriveMotors.{_where}", _sentence, "motors")
    _motors(name=f"{_where}s_before_open")(_attempt)
    _motors(name=f"{_where}s_without_hardware", without_hardware=True)(_attempt)


@_of("wayfarer.hal.DriveMotors", "and turns no wheel.", "motors")
async def _opening_turns_no_wheel(make: Make) -> None:
    async with _opened(make()) as motors:
        if (turning := await _asked(motors)) != STOP:
            raise AssertionError(f"read_back() says {turning} after open()")


@_of(
    "wayfarer.hal.DriveMotors.drive",
    "Apply the command and return what was really applied after the driver's own limits.",
    "motors",
)
async def _applies_what_it_says(make: Make) -> None:
    for command in (GENTLE, WheelCommand(-0.2, 0.2), STOP):
        async with _driving(make, command) as (_, applied):
            if not isinstance(applied, WheelCommand):
                raise AssertionError(f"drive() returned {applied!r}, not what it applied")
            for duty, wanted in zip(applied, command, strict=True):
                if not (abs(duty) <= abs(wanted) and duty * wanted >= 0.0):
                    raise AssertionError(f"{command} was applied as {applied}")


@_of(
    "wayfarer.hal.DriveMotors.read_back",
    "Return the duties that the board reports as applied now, or None if the board cannot report them.",
    "motors",
)
async def _reports_what_it_applies(make: Make) -> None:
    async with _driving(make) as (motors, applied):
        turning = await _asked(motors)
        if any(abs(one - other) > DUTY_STEP for one, other in zip(turning, applied, strict=True)):
            raise AssertionError(f"read_back() says {turning} after {applied} was applied")
        await motors.stop()
        if (turning := await _asked(motors)) != STOP:
            raise AssertionError(f"read_back() says {turning} after a stop")


@_of(
    "wayfarer.hal.MotorHealth",
    "State of the motor board: battery in volts (None if not measured), and texts of its faults, empty if none.",
    "motors",
)
async def _health_is_volts_and_texts(make: Make) -> None:
    async with _opened(make()) as motors:
        health = await motors.health()
    volts_are = health.battery_v is None or health.battery_v >= 0.0
    if not (isinstance(health, MotorHealth) and volts_are and all(isinstance(text, str) for text in health.faults)):
        raise AssertionError(f"health() returned {health!r}: volts of 0 or more, None if unknown, and texts")


DEADMAN = "``deadman_s`` is how long after the last command the board itself stops the wheels; None if it cannot."


@_of("wayfarer.hal.DriveMotors", DEADMAN, "motors")
async def _deadman_is_declared(make: Make) -> None:
    deadman_s = make().deadman_s
    if not (deadman_s is None or (isfinite(deadman_s) and deadman_s > 0.0)):
        raise AssertionError(f"deadman_s is {deadman_s!r} seconds")


@_of("wayfarer.hal.DriveMotors", DEADMAN, "motors")
async def _deadman_stops_the_wheels(make: Make) -> None:
    async with _driving(make) as (motors, _):
        if motors.deadman_s is None:
            raise SkipTest("the board has no deadman: only a person can stop its wheels")
        await _asked(motors)
        await asyncio.sleep(motors.deadman_s + DEADMAN_LATE_S)
        if (turning := await _asked(motors)) != STOP:
            raise AssertionError(f"read_back() says {turning} after {motors.deadman_s:g} s without a command")


# -- all of a kind -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class AllOf(Generic[P]):
    """Runs all checks of a kind of part, and returns a ``Report`` of which did run.

    It is called with what makes a part, what makes one without its hardware, and the ``gaps``: why a check is known to
    fail, by its name. If the motors are real, lift the rover first: its wheels turn, both ways.
    """

    kind: str

    async def __call__(
        self,
        make: Callable[[], P],
        unreachable: Callable[[], P] | None = None,
        gaps: Mapping[str, str] | None = None,
    ) -> Report:
        """Run them; raises ``AssertionError`` for the first promise that is not kept."""
        return await run_all(self.kind, checks_in(TABLE, self.kind, make, unreachable, gaps))


check_compass: AllOf[Compass] = AllOf("compass")
check_motion_sensor: AllOf[MotionSensor] = AllOf("motion")
check_contact_sensor: AllOf[ContactSensor] = AllOf("contact")
check_wheel_sensor: AllOf[WheelSensor] = AllOf("wheels")
check_motors: AllOf[DriveMotors] = AllOf("motors")
check_position_receiver: AllOf[PositionReceiver] = AllOf("position")
check_status_light: AllOf[StatusLight] = AllOf("light")
