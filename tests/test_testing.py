"""The checks for third parties: what wayfarer ships passes them, what is broken fails with a text that says why."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import replace
from itertools import count
from math import nan
from random import Random
from types import SimpleNamespace
from typing import Any, cast

import pytest

from tests.kit.motors import Motors
from tests.simhal.clearing import steady_world
from tests.virtual import run_virtually
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import NotResponding
from wayfarer.escape.api import Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.catalogue import BUILT_IN, CATALOGUE, Algorithm, clockwise, fixed_angle
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler
from wayfarer.escape.phases import PLEDGE
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.hal import (
    STOP,
    Colour,
    CompassReading,
    ContactReading,
    MotionReading,
    MotorHealth,
    PositionFix,
    Side,
    WheelCommand,
    WheelReading,
)
from wayfarer.simhal.build_rover import device_depth
from wayfarer.simhal.parts import SimWheels
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.testing import (
    check_algorithm,
    check_compass,
    check_contact_sensor,
    check_motion_sensor,
    check_motors,
    check_position_receiver,
    check_status_light,
    check_wheel_sensor,
)

# -- algorithms --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_algorithms_pass(name: str) -> None:
    check_algorithm(BUILT_IN[name])


class Unforgetting(PhasedHandler):
    """Forest-Pledge that begins a new mission where the last one ended."""

    def reset(self) -> None:
        if not hasattr(self, "_manoeuvre"):
            super().reset()


def test_handler_that_does_not_forget_is_found() -> None:
    spec = AlgorithmSpec(PLEDGE, clockwise, fixed_angle, resets=True, keeps_side=True)
    unforgetting = replace(CATALOGUE["forest-pledge"], make=lambda *parts: Unforgetting(spec, *parts))
    with pytest.raises(AssertionError, match=r"after reset\(\)"):
        check_algorithm(unforgetting)


def spoilt(
    spoil: Callable[[Decision, Observation], Any] = lambda decision, _: decision,
    memory: Mapping[str, Any] | None = None,
) -> Algorithm:
    """Return Forest-Pledge with one thing spoilt."""
    whole = CATALOGUE["forest-pledge"]

    def make(settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> EscapeHandler:
        inner = whole.make(settings, vehicle, rng)
        handler: Any = SimpleNamespace(
            decide=lambda seen: spoil(inner.decide(seen), seen),
            reset=inner.reset,
            memory=inner.memory if memory is None else lambda: memory,
        )
        return cast(EscapeHandler, handler)

    return replace(whole, name="spoilt", make=make)


ticks = count()
SPOILT = {
    "not finite duties": spoilt(lambda decision, _: decision._replace(wheels=WheelCommand(nan, 0.0))),
    "not finite duties in -1..1": spoilt(lambda decision, _: decision._replace(wheels=WheelCommand(0.0, 1.01))),
    "is not a fixed name": spoilt(lambda decision, seen: decision._replace(why=f"at {seen.heading_deg:.0f}")),
    "is not a Phase|Phase object expected": spoilt(  # compiled, there is no such decision
        lambda decision, _: Decision(decision.wheels, cast(Phase, "follow"), decision.why)
    ),
    "not a Decision": spoilt(lambda decision, _: tuple(decision)),
    "raised ZeroDivisionError": spoilt(lambda decision, seen: decision if seen.t_s < 1.0 else 1 / 0),
    "take chance only from the Random": spoilt(
        lambda decision, _: decision._replace(wheels=WheelCommand(random.uniform(0.0, 0.5), 0.0))
    ),
    "the same seed and observations gave": spoilt(
        lambda decision, _: decision._replace(why="odd" if next(ticks) % 7 else "even")
    ),
    "use headings only as differences": spoilt(
        lambda decision, seen: decision._replace(wheels=STOP) if seen.heading_deg > 180.0 else decision
    ),
    "stride did not end": spoilt(lambda decision, _: decision._replace(phase=Phase.STRIDE)),
    "halt did not end": spoilt(lambda decision, _: decision._replace(wheels=STOP, phase=Phase.HALT)),
    "follow did not end": spoilt(lambda decision, _: decision._replace(phase=Phase.FOLLOW)),
    r"memory\(\) has no 'episodes'": spoilt(memory={"counter_deg": 0.0}),
    "not a finite number": spoilt(memory={"counter_deg": nan, "episodes": 0}),
}


@pytest.mark.parametrize(("text", "algorithm"), SPOILT.items(), ids=SPOILT)
def test_spoilt_algorithm_is_told_what_is_wrong(text: str, algorithm: Algorithm) -> None:
    with pytest.raises(AssertionError, match=text):
        check_algorithm(algorithm)


def test_requirement_that_no_rover_can_meet_is_named() -> None:
    with pytest.raises(AssertionError, match="requires \\['lidar'\\]"):
        check_algorithm(replace(CATALOGUE["pledge"], requires=frozenset({"lidar"})))


# -- parts -------------------------------------------------------------------------------------------------------


CHECKS: dict[str, Callable[..., Coroutine[Any, Any, None]]] = {
    "compass": check_compass,
    "motion": check_motion_sensor,
    "contact": check_contact_sensor,
    "wheels": check_wheel_sensor,
    "motors": check_motors,
    "position": check_position_receiver,
    "light": check_status_light,
}


@pytest.mark.parametrize("part", sorted(set(CHECKS) - {"position", "light"}))
def test_simulated_parts_pass(part: str) -> None:
    def made() -> Any:
        rover = device_depth(steady_world(), RandomStreams(1), load_rover("sim"))
        return getattr(replace(rover, wheels=SimWheels(steady_world())), part)

    run_virtually(CHECKS[part](made))


class Part(Motors):
    """A part of every kind that keeps every promise; tests replace one method or value."""

    name = "bench part"
    reading: Callable[[float], Any]

    def __init__(self, **changes: Any) -> None:
        super().__init__()
        for name, change in changes.items():
            setattr(self, name, change)

    async def read(self) -> Any:
        return self.reading(asyncio.get_running_loop().time())

    async def show(self, colour: Colour) -> None: ...


async def fail(*_: Any) -> Any:
    raise OSError("bus error")


async def refuse() -> None:
    raise NotResponding("bench part: no answer; check the cable")


def returns(value: Any) -> Callable[..., Coroutine[Any, Any, Any]]:
    async def method(*_: Any) -> Any:
        return value

    return method


READINGS: dict[str, Callable[[float], Any]] = {
    "compass": lambda t_s: CompassReading(t_s, 0.0, -3.0, 3.0, None),
    "position": lambda t_s: PositionFix(t_s, 52.0, 13.0, None),
    "motion": lambda t_s: MotionReading(t_s, 0.0, 0.0, 1.0),
    "contact": lambda t_s: ContactReading(t_s, (Side.LEFT,), 179.0),
    "wheels": lambda t_s: WheelReading(t_s, 0.02, None, 1.5, None),
    "motors": lambda t_s: None,
}


def part(kind: str, **changes: Any) -> Callable[[], Part]:
    return lambda: Part(**({"reading": READINGS.get(kind)} | changes))


@pytest.mark.parametrize("kind", CHECKS)
def test_part_that_keeps_every_promise_passes(kind: str) -> None:
    run_virtually(CHECKS[kind](part(kind), part(kind, open=refuse)))


@pytest.mark.parametrize("kind", CHECKS)
@pytest.mark.parametrize(
    ("text", "changes", "without_hardware"),
    [
        (r"close\(\) before open\(\) raised OSError", {"close": fail}, {"open": refuse}),
        ("name is empty", {"name": ""}, {"open": refuse}),
        (r"open\(\) without hardware did not fail", {}, {}),
        (r"open\(\) without hardware raised OSError", {}, {"open": fail}),
        (r"close\(\) after a failed open\(\) raised OSError", {}, {"open": refuse, "close": fail}),
    ],
)
def test_every_part_has_a_life_cycle(
    kind: str, text: str, changes: dict[str, Any], without_hardware: dict[str, Any]
) -> None:
    with pytest.raises(AssertionError, match=text):
        run_virtually(CHECKS[kind](part(kind, **changes), part(kind, **without_hardware)))


def test_second_close_must_not_raise() -> None:
    class ClosesOnce(Part):
        handle: object

        async def close(self) -> None:
            del self.handle  # a second time there is none

    with pytest.raises(AssertionError, match=r"^close\(\) raised AttributeError"):
        run_virtually(check_motors(lambda: ClosesOnce(handle=1)))


@pytest.mark.parametrize(
    ("kind", "text", "reading"),
    [
        ("compass", "heading_deg is 360.0: that is 0", lambda t_s: CompassReading(t_s, 360.0, 0.0, 0.0, 3)),
        ("compass", "heading_deg -1.0 is not in 0..360", lambda t_s: CompassReading(t_s, -1.0, 0.0, 0.0, 3)),
        ("compass", "pitch_deg is nan: raise BadReading", lambda t_s: CompassReading(t_s, 0.0, nan, 0.0, 3)),
        ("compass", "roll_deg 181.0 is not in", lambda t_s: CompassReading(t_s, 0.0, 0.0, 181.0, 3)),
        ("compass", "calibration 4 is not", lambda t_s: CompassReading(t_s, 0.0, 0.0, 0.0, 4)),
        ("compass", "on the event loop's clock", lambda t_s: CompassReading(t_s - 5.0, 0.0, 0.0, 0.0, 3)),
        ("compass", "on the event loop's clock", lambda t_s: CompassReading(t_s + 1e9, 0.0, 0.0, 0.0, 3)),
        ("motion", "quality 255.0 is not in 0..1", lambda t_s: MotionReading(t_s, 0.0, 0.0, 255.0)),
        ("motion", "forward_m 12.0 is not in", lambda t_s: MotionReading(t_s, 12.0, 0.0, 1.0)),
        ("contact", "readings are immutable", lambda t_s: ContactReading(t_s, [Side.LEFT], None)),  # type: ignore[arg-type]
        ("contact", "are not all hal.Side", lambda t_s: ContactReading(t_s, ("left",), None)),  # type: ignore[arg-type]
        ("wheels", "left_m -3.0 is not in", lambda t_s: WheelReading(t_s, -3.0, None)),
        ("wheels", "right_a -1.0 is not in", lambda t_s: WheelReading(t_s, None, None, None, -1.0)),
        ("position", "latitude_deg 91.0 is not in", lambda t_s: PositionFix(t_s, 91.0, 13.0, None)),
        ("contact", "obstacle_bearing_deg 200.0 is not in", lambda t_s: ContactReading(t_s, (), 200.0)),
    ],
)
def test_reading_that_cannot_be_true_is_told(kind: str, text: str, reading: Callable[[float], Any]) -> None:
    with pytest.raises(AssertionError, match=text):
        run_virtually(CHECKS[kind](part(kind, reading=reading)))


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        (r"stop\(\) before open\(\) raised OSError", {"stop": fail}),
        ("was applied as", {"drive": returns(WheelCommand(0.3, 0.3))}),
        ("None means unknown", {"health": returns(MotorHealth(-0.1, ()))}),
        ("after a stop", {"read_back": returns(WheelCommand(0.2, 0.2))}),
    ],
)
def test_motors_that_cannot_be_trusted_are_told(text: str, changes: dict[str, Any]) -> None:
    with pytest.raises(AssertionError, match=text):
        run_virtually(check_motors(part("motors", **changes)))
