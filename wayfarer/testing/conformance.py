"""Conformance checks: of an algorithm on an artificial drive; of a part its life cycle, readings, and that it stops."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import fields
from math import degrees, isfinite
from random import Random
from typing import Any, TypeVar

from wayfarer.config.registry import algorithm_of
from wayfarer.errors import DriverError
from wayfarer.escape.api import Anomaly, Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.catalogue import Algorithm
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.hal import (
    STOP,
    Colour,
    Compass,
    ContactReading,
    ContactSensor,
    DriveMotors,
    Driver,
    MotionSensor,
    PositionReceiver,
    Rover,
    Side,
    StatusLight,
    WheelCommand,
    WheelSensor,
)

TICK_S = 0.0625  # a binary fraction, as are all angles: turning them together loses no digit
ANGLE_STEPS = 64  # per degree
TICKS = 800
PHASE_MAX_S = 120.0  # three times the longest phase of the paper's algorithms, a stride of 10 m
_VEHICLE = Vehicle(length_m=0.4, width_m=0.4, track_m=0.5, max_speed_m_s=1.4)
_PLAIN_NAME = re.compile(r"[a-z][a-z_]*(\.[a-z_]+)*")
_OPTIONAL_PARTS = {field.name for field in fields(Rover)} - {"compass", "motors"}


def check_algorithm(given: Algorithm | type[EscapeHandler]) -> None:
    """Check the promises of ``escape.api.EscapeHandler`` on a rehearsed drive, with and without contact.

    Decisions are finite wheels in -1..1 with a fixed ``why``; the same seed gives the same decisions; where north is
    does not matter; ``reset`` forgets; every phase but ``FOLLOW`` ends; ``memory`` has ``counter_deg`` and
    ``episodes``.

    Raises:
        AssertionError: a promise is not kept; the text says which.
    """
    algorithm = algorithm_of(given)
    unknown = algorithm.requires - _OPTIONAL_PARTS
    assert not unknown, f"requires {sorted(unknown)}: a rover has only {sorted(_OPTIONAL_PARTS)}"
    for contact in (True, False):
        if contact or "contact" not in algorithm.requires:
            drive = _rehearse(algorithm, contact=contact)
            _check_determinism(algorithm, drive)
            _check_rotation(algorithm, drive)
            _check_reset(algorithm, drive)
    _check_phases_end(algorithm)


def _rehearse(algorithm: Algorithm, *, contact: bool) -> list[Observation]:
    """Drive through made-up trouble, checking each decision; return what was observed."""
    handler, rng = _make(algorithm), Random(1)
    wheels, seen = STOP, []
    heading_steps, travelled_m = 0, 0.0
    for tick in range(1, TICKS):
        turn_deg = degrees((wheels.left - wheels.right) * _VEHICLE.max_speed_m_s / _VEHICLE.track_m) * TICK_S
        heading_steps += round(turn_deg * ANGLE_STEPS * rng.choice((0.0, 1.0, 1.0)))
        travelled_m += abs(wheels.left + wheels.right) / 2 * _VEHICLE.max_speed_m_s * TICK_S
        met = rng.random() < 0.05
        observation = Observation(
            t_s=tick * TICK_S,
            heading_deg=heading_steps % (360 * ANGLE_STEPS) / ANGLE_STEPS,
            pitch_deg=0.0,
            roll_deg=0.0,
            anomalies=(rng.choice(tuple(Anomaly)),) if met else (),
            contact=_touch(rng, tick * TICK_S, met) if contact else None,
            goal_heading_deg=0.0,
            travelled_m=travelled_m,
        )
        wheels = _decide(handler, observation).wheels
        seen.append(observation)
    _check_memory(handler)
    return seen


def _touch(rng: Random, t_s: float, met: bool) -> ContactReading:
    sides = (rng.choice(tuple(Side)),) if met else ()
    axis_deg = rng.randrange(180) if met and rng.random() < 0.5 else None
    return ContactReading(t_s, sides, axis_deg)


def _make(algorithm: Algorithm) -> EscapeHandler:
    return algorithm.make(EscapeSettings(), _VEHICLE, Random(7))


def _decide(handler: EscapeHandler, observation: Observation) -> Decision:
    try:
        decision = handler.decide(observation)
    except Exception as error:
        raise AssertionError(f"decide() raised {error!r} on {observation}; it must never raise") from error
    assert isinstance(decision, Decision), f"decide() returned {decision!r}, not a Decision"
    assert isinstance(decision.phase, Phase), f"phase {decision.phase!r} is not a Phase"
    for duty in decision.wheels:
        assert isfinite(duty) and -1.0 <= duty <= 1.0, f"wheels {decision.wheels} are not finite duties in -1..1"
    fixed = isinstance(decision.why, str) and _PLAIN_NAME.fullmatch(decision.why)
    assert fixed, f"why {decision.why!r} is not a fixed name such as 'probe.unwound': no values, no spaces"
    return decision


def _decisions(algorithm: Algorithm, drive: Sequence[Observation]) -> Iterator[tuple[Decision, dict[str, Any]]]:
    handler = _make(algorithm)
    for observation in drive:
        yield _decide(handler, observation), dict(handler.memory())


def _check_determinism(algorithm: Algorithm, drive: Sequence[Observation]) -> None:
    for first, second in zip(_decisions(algorithm, drive), _decisions(algorithm, drive), strict=True):
        assert first == second, (
            f"the same seed and observations gave {first} and then {second}; "
            "take chance only from the Random that make() is given, and time from t_s"
        )


def _check_rotation(algorithm: Algorithm, drive: Sequence[Observation]) -> None:
    for turned_deg in (90.0, 213.625):
        turned = [_turned(observation, turned_deg) for observation in drive]
        for (first, _), (second, _) in zip(_decisions(algorithm, drive), _decisions(algorithm, turned), strict=True):
            apart = max(abs(a - b) for a, b in zip(first.wheels, second.wheels, strict=True))
            assert apart < 1e-9 and first[1:] == second[1:], (
                f"turning all headings by {turned_deg} degrees changed {first} to {second}; "
                "use headings only as differences (wayfarer.angles.wrap180)"
            )


def _turned(observation: Observation, by_deg: float) -> Observation:
    contact = observation.contact
    if contact is not None and contact.obstacle_bearing_deg is not None:
        contact = contact._replace(obstacle_bearing_deg=(contact.obstacle_bearing_deg + by_deg) % 180.0)
    return observation._replace(
        heading_deg=(observation.heading_deg + by_deg) % 360.0,
        goal_heading_deg=(observation.goal_heading_deg + by_deg) % 360.0,
        contact=contact,
    )


def _check_phases_end(algorithm: Algorithm) -> None:
    """Wheels spin and nothing moves: no phase may wait for something that cannot come."""
    for anomalies in ((), (Anomaly.IMMOBILISED,)):
        handler, wheels, travelled_m = _make(algorithm), STOP, 0.0
        phase, since_s = Phase.FOLLOW, 0.0
        for tick in range(1, int(2.5 * PHASE_MAX_S / TICK_S)):
            t_s = tick * TICK_S
            travelled_m += abs(wheels.left + wheels.right) / 2 * _VEHICLE.max_speed_m_s * TICK_S
            contact = ContactReading(t_s, (), None)
            held = anomalies if tick > 1 else (Anomaly.IMMOBILISED,)
            decision = _decide(handler, Observation(t_s, 0.0, 0.0, 0.0, held, contact, 0.0, travelled_m))
            wheels = decision.wheels
            if decision.phase is not phase or (phase is Phase.FOLLOW and not held):
                phase, since_s = decision.phase, t_s
            assert t_s - since_s <= PHASE_MAX_S, (
                f"{phase.value} did not end within {PHASE_MAX_S:g} s while the rover was stuck; "
                "bound every phase in time and in commanded distance"
            )


def _check_reset(algorithm: Algorithm, drive: Sequence[Observation]) -> None:
    """Check that a new mission does not begin in the middle of the last one."""
    used = _make(algorithm)
    for observation in drive:
        _decide(used, observation)
    used.reset()
    first = drive[0]._replace(t_s=drive[-1].t_s + 60.0)
    fresh = _decide(_make(algorithm), first)
    assert _decide(used, first) == fresh, "after reset() the first decision is not that of a new handler"


def _check_memory(handler: EscapeHandler) -> None:
    memory = handler.memory()
    for key in ("counter_deg", "episodes"):
        assert key in memory, f"memory() has no '{key}': {dict(memory)}"
        value = memory[key]
        assert isinstance(value, float | int) and isfinite(value), (
            f"memory()['{key}'] is {value!r}, not a finite number"
        )


# -- parts -------------------------------------------------------------------------------------------------------------

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


async def check_wheel_sensor(
    factory: Callable[[], WheelSensor], unreachable: Callable[[], WheelSensor] | None = None
) -> None:
    """Check the life cycle and the readings of a ``hal.WheelSensor``."""
    await _check_life_cycle(factory, unreachable)
    for reading in await _readings(factory()):
        for name in ("left_m", "right_m"):
            if (way_m := getattr(reading, name)) is not None:
                _check_range(name, way_m, -1.0, 1.0)
        for name in ("left_a", "right_a"):
            if (current_a := getattr(reading, name)) is not None:
                _check_range(name, current_a, 0.0, 1000.0)


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
