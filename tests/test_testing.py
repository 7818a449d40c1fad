"""The checks for third parties: what wayfarer ships passes them, what is broken fails with a text that says why."""

from __future__ import annotations

import ast
import asyncio
import os
import random
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import replace
from itertools import count
from math import nan
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any, cast

import pytest

from tests.kit.motors import Motors
from tests.simhal.clearing import steady_world
from tests.virtual import run_virtually
from wayfarer import testing
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import DriverError, NotResponding
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
    algorithm_checks,
    check_algorithm,
    check_compass,
    check_contact_sensor,
    check_motion_sensor,
    check_motors,
    check_position_receiver,
    check_status_light,
    check_wheel_sensor,
    checks_of,
    part_checks,
)
from wayfarer.testing.part_checks import AllOf
from wayfarer.testing.promises import NO_HARDWARE, Promise

# -- the kit -----------------------------------------------------------------------------------------------------

ROOT = Path(__file__).parents[1]
KINDS = ("compass", "motion", "contact", "wheels", "motors", "position", "light")
EVERY = (*part_checks.TABLE, *algorithm_checks.TABLE)


def test_every_public_name_is_there_and_shown() -> None:
    assert set(testing.__all__) <= set(dir(testing))
    assert all(getattr(testing, name) for name in testing.__all__)


@pytest.mark.parametrize("promise", EVERY, ids=lambda promise: promise.name)
def test_each_promise_is_a_sentence_of_the_interface(promise: Promise) -> None:
    assert " ".join(promise.sentence.split()) in " ".join(docstring(promise.where).split())


def docstring(where: str) -> str:
    """The docstring of a module, a class or a method in its source: what is compiled has none."""
    parts = where.split(".")
    cut = next(cut for cut in range(len(parts), 0, -1) if ROOT.joinpath(*parts[:cut]).with_suffix(".py").exists())
    module = ast.parse(ROOT.joinpath(*parts[:cut]).with_suffix(".py").read_text(encoding="utf-8"))
    node: Any = module
    for name in parts[cut:]:
        found = [each for each in node.body if getattr(each, "name", None) == name]
        if not found:  # what hal hands on
            return docstring(where.replace("wayfarer.hal", "wayfarer.readings"))
        (node,) = found
    return ast.get_docstring(node) or ""


def test_names_of_checks_are_names() -> None:
    for kind in (*KINDS, "algorithm"):
        names = [check.name for check in checks_of(kind, CATALOGUE["pledge"])]
        assert len(set(names)) == len(names) > 6


@pytest.mark.process
def test_pytest_shows_each_check_and_why_one_was_not_tried(tmp_path: Path) -> None:
    """Also under python -O, which takes the assert statements out of a kit."""
    file = tmp_path / "test_mine.py"
    file.write_text(
        "import asyncio, pytest\n"
        "from tests.test_testing import Part, READINGS\n"
        "from wayfarer.testing import checks_of\n"
        "mine = checks_of('compass', lambda: Part(reading=READINGS['compass'], name=''))\n"
        "@pytest.mark.parametrize('check', mine, ids=str)\n"
        "def test_my_compass(check):\n"
        "    asyncio.run(check.run())\n"
    )
    command = [sys.executable, "-O", "-m", "pytest", "-rsf", "-p", "no:cacheprovider", "-c", "/dev/null", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "200"})
    assert "test_my_compass[has_a_name] - AssertionError: has_a_name: name is ''" in done.stdout, done.stdout
    assert "1 failed, 6 passed, 4 skipped" in done.stdout
    assert "SKIPPED [1]" in done.stdout
    assert "no maker of a part whose hardware does not answer" in done.stdout


def test_report_counts_what_ran_and_says_why_the_rest_did_not() -> None:
    report = run_virtually(check_compass(part("compass")))
    assert len(report.ran) + len(report.skipped) == len(checks_of("compass", None))
    assert set(report.skipped) == {
        "is_made_without_hardware", "missing_hardware_is_told", "closes_after_a_failed_open", "calibration_is_in_range",
    }  # fmt: skip
    first, *others = str(report).splitlines()
    assert first == f"compass: {len(report.ran)} of {len(report.ran) + 4} checks ran, and passed"
    assert "  not tried: calibration_is_in_range: no reading had calibration" in others
    assert len(others) == 4


def test_known_gap_is_told_and_is_an_error_once_it_is_none() -> None:
    gaps = {"has_a_name": "it was never named"}
    report = run_virtually(check_compass(part("compass", name=""), gaps=gaps))
    assert report.skipped["has_a_name"] == "a known gap, it was never named: name is ''"
    with pytest.raises(AssertionError, match=r"has_a_name is listed as a gap \(it was never named\) and passes"):
        run_virtually(check_compass(part("compass"), gaps=gaps))
    with pytest.raises(ValueError, match=r"no check for \['has_no_name'\]: there are applies_what_it_says, "):
        checks_of("motors", part("motors"), gaps={"has_no_name": ""})
    with pytest.raises(ValueError, match="no check for lidar: there are algorithm, compass, contact, light"):
        checks_of("lidar", None)


# -- algorithms --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_algorithms_pass(name: str) -> None:
    report = check_algorithm(BUILT_IN[name])
    assert (len(report.ran), report.skipped) == (len(algorithm_checks.TABLE), {})


class Unforgetting(PhasedHandler):
    """Forest-Pledge that begins a new mission where the last one ended."""

    def reset(self) -> None:
        if not hasattr(self, "_manoeuvre"):
            super().reset()


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


def unforgetting() -> Algorithm:
    spec = AlgorithmSpec(PLEDGE, clockwise, fixed_angle, resets=True, keeps_side=True)
    return replace(CATALOGUE["forest-pledge"], make=lambda *parts: Unforgetting(spec, *parts))


ticks = count()
# The check that has to find it, what it says, and the algorithm.
SPOILT: list[tuple[str, str, Algorithm]] = [
    ("wheels_are_in_range", r"the wheels are WheelCommand.left=nan", spoilt(
        lambda decision, _: decision._replace(wheels=WheelCommand(nan, 0.0)))),
    ("wheels_are_in_range", r"right=1\.01. at t_s = 0\.0625 s", spoilt(
        lambda decision, _: decision._replace(wheels=WheelCommand(0.0, 1.01)))),
    ("why_is_a_fixed_name", "why is 'at 0': no values, no spaces", spoilt(
        lambda decision, seen: decision._replace(why=f"at {seen.heading_deg:.0f}"))),
    ("decides_at_each_tick", "not a Decision with a Phase|Phase object expected", spoilt(  # compiled, there is none
        lambda decision, _: Decision(decision.wheels, cast(Phase, "follow"), decision.why))),
    ("decides_at_each_tick", "not a Decision with a Phase", spoilt(lambda decision, _: tuple(decision))),
    ("decides_at_each_tick", "raised ZeroDivisionError", spoilt(
        lambda decision, seen: decision if seen.t_s < 1.0 else 1 / 0)),
    ("decides_the_same_again", "take chance only from the Random", spoilt(
        lambda decision, _: decision._replace(wheels=WheelCommand(random.uniform(0.0, 0.5), 0.0)))),
    ("decides_the_same_again", "the same seed and observations gave", spoilt(
        lambda decision, _: decision._replace(why="odd" if next(ticks) % 7 else "even"))),
    ("north_does_not_matter", "use headings only as differences", spoilt(
        lambda decision, seen: decision._replace(wheels=STOP) if seen.heading_deg > 180.0 else decision)),
    ("phases_end", "stride did not end within 120 s", spoilt(
        lambda decision, _: decision._replace(phase=Phase.STRIDE))),
    ("phases_end", "halt did not end", spoilt(
        lambda decision, _: decision._replace(wheels=STOP, phase=Phase.HALT))),
    ("phases_end", "follow did not end", spoilt(lambda decision, _: decision._replace(phase=Phase.FOLLOW))),
    ("memory_has_counter_and_episodes", "has episodes = None, which is not a finite number", spoilt(
        memory={"counter_deg": 0.0})),
    ("memory_has_counter_and_episodes", "has counter_deg = nan", spoilt(memory={"counter_deg": nan, "episodes": 0})),
    ("memory_has_counter_and_episodes", r"has seen = \[1\], which is not a number or a text", spoilt(
        memory={"counter_deg": 0.0, "episodes": 0, "seen": [1]})),
    ("reset_forgets", r"after reset\(\) the first decision is", unforgetting()),
    ("requires_what_a_rover_can_have", r"requires is \['lidar'\], and a rover can have \['contact'",
        replace(CATALOGUE["pledge"], requires=frozenset({"lidar"}))),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "algorithm"), SPOILT, ids=[f"{name}-{text}" for name, text, _ in SPOILT])
def test_spoilt_algorithm_is_told_what_is_wrong(name: str, text: str, algorithm: Algorithm) -> None:
    (check,) = (check for check in checks_of("algorithm", algorithm) if check.name == name)
    with pytest.raises(AssertionError, match=text) as told:
        run_virtually(check.run())
    assert str(told.value).startswith(f"{name}: ")
    assert check.promise in str(told.value)
    with pytest.raises(AssertionError):
        check_algorithm(algorithm)


def test_each_check_of_an_algorithm_is_known_to_bite() -> None:
    assert {name for name, _, _ in SPOILT} == {promise.name for promise in algorithm_checks.TABLE}


# -- parts -------------------------------------------------------------------------------------------------------


CHECKS: dict[str, AllOf[Any]] = {
    "compass": check_compass,
    "motion": check_motion_sensor,
    "contact": check_contact_sensor,
    "wheels": check_wheel_sensor,
    "motors": check_motors,
    "position": check_position_receiver,
    "light": check_status_light,
}


@pytest.mark.parametrize("kind", sorted(set(CHECKS) - {"position", "light"}))
def test_simulated_parts_pass(kind: str) -> None:
    def made() -> Any:
        world = steady_world()
        rover = device_depth(world, RandomStreams(1), load_rover("sim"))
        return rover.motors if kind == "motors" else getattr(rover, kind) or SimWheels(world)

    gaps = {"deadman_stops_the_wheels": "the world goes on when a sensor is read"} if kind == "motors" else {}
    report = run_virtually(CHECKS[kind](made, gaps=gaps))
    skipped = {name for name, why in report.skipped.items() if why != NO_HARDWARE}
    assert skipped <= {"bearing_is_in_range", *gaps}, "nothing touches it in a clearing"


class Part(Motors):
    """A part of every kind that keeps every promise; tests replace one method or value."""

    name = "bench part"
    deadman_s: float | None = 0.3
    trips_after_s = 0.3
    reading: Callable[[float], Any]

    def __init__(self, **changes: Any) -> None:
        super().__init__()
        self.turns, self.told_s = STOP, 0.0
        for name, change in changes.items():
            setattr(self, name, change)

    async def drive(self, command: WheelCommand) -> WheelCommand:
        self.turns, self.told_s = command, asyncio.get_running_loop().time()
        return command

    async def stop(self) -> None:
        self.turns = STOP

    async def read_back(self) -> WheelCommand | None:
        return STOP if asyncio.get_running_loop().time() > self.told_s + self.trips_after_s else self.turns

    async def read(self) -> Any:
        return self.reading(asyncio.get_running_loop().time())

    async def show(self, colour: Colour) -> None: ...


async def fail(*_: Any) -> Any:
    raise OSError("bus error")


async def mute() -> None:
    raise DriverError("")


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
    report = run_virtually(CHECKS[kind](part(kind), part(kind, open=refuse)))
    assert {why for why in report.skipped.values() if not why.startswith("no reading had")} == set()


def bitten(kind: str, check: str, made: Callable[[], Any] | None, without_hardware: Callable[[], Any] | None) -> str:
    (tried,) = (each for each in checks_of(kind, made, without_hardware) if each.name == check)
    with pytest.raises(AssertionError) as told:
        run_virtually(tried.run())
    assert str(told.value).startswith(f"{check}: ")
    assert str(told.value).endswith(f'promises: "{tried.promise}"')
    return str(told.value)


class ClosesTwice(Part):
    closed = 0

    async def close(self) -> None:
        self.closed += 1
        if self.closed > 2:
            raise OSError("closed already")


class OpensOnce(Part):
    opened = False

    async def open(self) -> None:
        if self.opened:
            raise NotResponding("bench part: busy")
        self.opened = True


def cannot_be_made() -> Any:
    raise OSError("no bus")


# The check, what it says, the part, and the part without its hardware.
LIFE_CYCLES: list[tuple[str, str, Callable[[], Any], Callable[[], Any]]] = [
    ("has_a_name", "name is ''", lambda: Part(name=""), Part),
    ("is_made_without_hardware", r"OSError was raised \(no bus\)", Part, cannot_be_made),
    ("closes_at_any_time", r"close\(\) before open\(\) raised OSError", lambda: Part(close=fail), Part),
    ("closes_at_any_time", r"a second close\(\) raised OSError", ClosesTwice, Part),
    ("opens_again", r"NotResponding was raised \(bench part: busy\)", OpensOnce, Part),
    ("missing_hardware_is_told", r"did not fail; it must speak to the part", Part, Part),
    ("missing_hardware_is_told", r"raised OSError.*not a DriverError", Part, lambda: Part(open=fail)),
    ("missing_hardware_is_told", r"failed without a text", Part, lambda: Part(open=mute)),
    ("closes_after_a_failed_open", r"after a failed open\(\) raised OSError", Part,
        lambda: Part(open=refuse, close=fail)),
]  # fmt: skip


@pytest.mark.parametrize("kind", CHECKS)
@pytest.mark.parametrize(("check", "text", "made", "without_hardware"), LIFE_CYCLES)
def test_every_part_has_a_life_cycle(
    kind: str, check: str, text: str, made: Callable[[], Any], without_hardware: Callable[[], Any]
) -> None:
    assert re.search(text, bitten(kind, check, made, without_hardware))


def wheels(t_s: float, **values: float) -> WheelReading:
    return WheelReading(**({"t_s": t_s, "left_m": 0.0, "right_m": 0.0} | values))


UNTRUE: list[tuple[str, str, str, Callable[[float], Any]]] = [
    ("compass", "heading_is_in_range", r"heading_deg is 360\.0 degrees, not in 0\.\.",
        lambda t_s: CompassReading(t_s, 360.0, 0.0, 0.0, 3)),
    ("compass", "heading_is_in_range", r"heading_deg is -1\.0 degrees",
        lambda t_s: CompassReading(t_s, -1.0, 0.0, 0.0, 3)),
    ("compass", "reading_is_finite", "pitch_deg is nan", lambda t_s: CompassReading(t_s, 0.0, nan, 0.0, 3)),
    ("compass", "reading_is_finite", "which is none of the readings in hal", lambda t_s: (t_s, 0.0, 0.0, 0.0, 3)),
    ("compass", "tilt_is_in_range", "roll_deg is 181.0 degrees", lambda t_s: CompassReading(t_s, 0.0, 0.0, 181.0, 3)),
    ("compass", "calibration_is_in_range", "calibration is 4, not in 0..3",
        lambda t_s: CompassReading(t_s, 0.0, 0.0, 0.0, 4)),
    ("compass", "reading_is_of_now", "on the event loop's clock", lambda t_s: CompassReading(t_s - 5.0, 0, 0, 0, 3)),
    ("compass", "reading_is_of_now", "on the event loop's clock", lambda t_s: CompassReading(t_s + 1e9, 0, 0, 0, 3)),
    ("motion", "quality_is_in_range", "quality is 255.0, not in 0..1", lambda t_s: MotionReading(t_s, 0, 0, 255.0)),
    ("motion", "displacement_is_of_one_read", r"forward_m is 12\.0 metres in 0\.05 s",
        lambda t_s: MotionReading(t_s, 12.0, 0.0, 1.0)),
    ("contact", "sides_are_a_tuple_of_sides", "readings are immutable",
        lambda t_s: ContactReading(t_s, [Side.LEFT], None)),  # type: ignore[arg-type]
    ("contact", "sides_are_a_tuple_of_sides", "not a tuple of hal.Side",
        lambda t_s: ContactReading(t_s, ("left",), None)),  # type: ignore[arg-type]
    ("contact", "bearing_is_in_range", "obstacle_bearing_deg is 180.0 degrees",
        lambda t_s: ContactReading(t_s, (), 180.0)),
    ("wheels", "way_is_of_one_read", r"left_m is 12\.0 metres", lambda t_s: wheels(t_s, left_m=12.0)),
    ("wheels", "current_is_a_size", r"right_a is -2\.0 amperes", lambda t_s: wheels(t_s, right_a=-2.0)),
    ("position", "fix_is_on_the_earth", "latitude_deg 91.0", lambda t_s: PositionFix(t_s, 91.0, 13.0, None)),
    ("position", "fix_is_on_the_earth", "error_m is -1.0 metres", lambda t_s: PositionFix(t_s, 9.0, 13.0, -1.0)),
    ("position", "fix_is_on_the_earth", "read.. returned .1.0, 2.0.", lambda t_s: (1.0, 2.0)),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "check", "text", "reading"), UNTRUE)
def test_reading_that_cannot_be_true_is_told(kind: str, check: str, text: str, reading: Callable[[float], Any]) -> None:
    assert re.search(text, bitten(kind, check, part(kind, reading=reading), None))


class Hangs(Part):
    def halt(self) -> None:
        threading.Event().wait(0.2)


class NeverStops(Part):
    async def stop(self) -> None: ...


UNTRUSTED: list[tuple[str, str, Callable[[], Any]]] = [
    ("stops_before_open", r"stop\(\) before open\(\) raised OSError", lambda: Part(stop=fail)),
    ("stops_without_hardware", r"stop\(\) before open\(\) raised OSError", lambda: Part(stop=fail)),
    ("halts_before_open", r"halt\(\) raised ZeroDivisionError", lambda: Part(halt=lambda: 1 // 0)),
    ("halts_before_open", r"halt\(\) had not returned after 0\.05 s", Hangs),
    ("halts_without_hardware", r"halt\(\) had not returned", Hangs),
    ("opening_turns_no_wheel", r"after open\(\)", lambda: Part(read_back=returns(WheelCommand(0.2, 0.2)))),
    ("applies_what_it_says", "was applied as", lambda: Part(drive=returns(WheelCommand(0.3, 0.3)))),
    ("applies_what_it_says", "not what it applied", lambda: Part(drive=returns(None))),
    ("reports_what_it_applies", "after WheelCommand.left=0.2, right=0.2. was applied",
        lambda: Part(read_back=returns(STOP))),
    ("reports_what_it_applies", "after a stop", NeverStops),
    ("health_is_volts_and_texts", "volts of 0 or more", lambda: Part(health=returns(MotorHealth(-0.1, ())))),
    ("health_is_volts_and_texts", "and texts", lambda: Part(health=returns(MotorHealth(12.0, cast(Any, (3,)))))),
    ("deadman_is_declared", "deadman_s is 0.0 seconds", lambda: Part(deadman_s=0.0)),
    ("deadman_stops_the_wheels", "after 0.3 s without a command", lambda: Part(trips_after_s=9.0)),
]  # fmt: skip


@pytest.mark.parametrize(("check", "text", "made"), UNTRUSTED)
def test_motors_that_cannot_be_trusted_are_told(
    monkeypatch: pytest.MonkeyPatch, check: str, text: str, made: Callable[[], Any]
) -> None:
    monkeypatch.setattr(part_checks, "BLOCKS_S", 0.05)
    assert re.search(text, bitten("motors", check, made, made))


def test_light_that_fails_at_a_colour_is_told() -> None:
    assert "OSError was raised" in bitten("light", "shows_any_colour", lambda: Part(show=fail), None)


def test_each_check_of_a_part_is_known_to_bite() -> None:
    bites = {name for name, *_ in LIFE_CYCLES} | {name for _, name, *_ in UNTRUE} | {name for name, *_ in UNTRUSTED}
    assert bites | {"shows_any_colour"} == {promise.name for promise in part_checks.TABLE}
