"""Device depth and bus depth are one rover: the real drivers over chips decide what the simulated parts decide."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import pytest

from tests.virtual import virtual
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.drivers.bumper import Bumper, BumperSettings
from wayfarer.drivers.cmps14 import CMPS14
from wayfarer.drivers.gpio_light import GpioLight
from wayfarer.drivers.pmw3901 import PMW3901
from wayfarer.drivers.sabertooth import Sabertooth
from wayfarer.drivers.thunderborg import ThunderBorg
from wayfarer.errors import BadConfig, NotResponding
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.hal import STOP, ContactSensor, MotionSensor, PositionReceiver, Rover, Side, WheelCommand
from wayfarer.simhal.build_rover import build
from wayfarer.simhal.parts import SimBumper, SimCompass, SimFlow, SimMotors
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING, Forest
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Depth, Physics
from wayfarer.simhal.world.world import World
from wayfarer.testing import ChipWiring, SimulatedChip

AHEAD = WheelCommand(0.5, 0.5)


def rover_in(forest: Forest, config: RoverConfig, depth: Depth, seed: int = 3) -> tuple[World, Rover]:
    """A rover at one of the depths, made on the running loop, and its world."""
    streams = RandomStreams(seed)
    world = World(forest, config.vehicle, Physics(), streams)
    return world, build(depth, world, streams, config, asyncio.get_running_loop().time)


# -- whole trials ------------------------------------------------------------------------------------------------


# The algorithm does not know the depth: two of them share the layouts, noises and seeds.
ON_H_BRIDGES = "sim, with its motors on H-bridges"
DRAWN = [
    ("sim", "forest-pledge", 1, 0, 0),
    ("sim", "cv-pledge", 7, 1, 3),
    ("sim", "forest-pledge", 12, 0, 9),
    ("sim", "cv-pledge", 20, 1, 4),
    (ON_H_BRIDGES, "forest-pledge", 12, 0, 9),
    ("forestrover", "forest-pledge", 7, 1, 3),  # another height of the sensor, other speeds, a start delay
]
BUDGET_M = 40.0


def spec_of(rover: str, algorithm: str, layout: int, noise: int, seed: int) -> TrialSpec:
    forest = generate_forest(layout, noise, seed)
    config = on_h_bridges(pulse=5, deadman_s=0.3) if rover == ON_H_BRIDGES else load_rover(rover)
    return TrialSpec(0, algorithm, forest, seed, config, budget_m=BUDGET_M)


def on_h_bridges(**settings: Any) -> RoverConfig:
    pins = {"driver": "gpio_motors", "left_pwm": 12, "left_direction": 6, "right_pwm": 13, "right_direction": 19}
    return RoverConfig.model_validate(with_part(load_rover("sim"), motors=pins | settings).model_dump())


@pytest.mark.parametrize("drawn", DRAWN, ids=lambda drawn: "-".join(map(str, drawn)))
def test_trial_is_the_same_at_both_depths(drawn: tuple[str, str, int, int, int]) -> None:
    spec = spec_of(*drawn)
    device = run_trial(spec)
    assert run_trial(replace(spec, depth=Depth.BUS)) == device
    assert device.outcome != "fault"
    assert device.anomalies > 0
    assert device.path_m > 20.0


def test_trials_of_other_seeds_differ() -> None:
    """The tests above compare something that a rover's sensors decide."""
    spec = replace(spec_of(*DRAWN[0]), budget_m=20.0)
    assert run_trial(spec).path_m != run_trial(replace(spec, seed=1)).path_m


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """The values of a log record, each under its dotted key."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from leaves(inner, f"{key}.{name}")
    else:
        yield key, round(value, 6) if isinstance(value, float) else value


def test_field_log_of_a_trial_is_the_same_at_both_depths_tick_by_tick(tmp_path: Path) -> None:
    """Readings, decisions, what was applied, and the handler's memory; times differ by rounding errors.

    The records' numbers differ, and so their checksums: a chip counts what it cannot follow, and its driver notes that.
    """

    def ticks(depth: Depth) -> list[dict[str, Any]]:
        spec = TrialSpec(0, "forest-pledge", generate_forest(1, 0, 0), 0, load_rover("sim"), budget_m=20.0, depth=depth)
        run_trial(spec, tmp_path / depth)
        lines = (tmp_path / depth / "run.00001.jsonl").read_text(encoding="utf-8").splitlines()
        records = [record for record in map(json.loads, lines) if record["record"] == "tick"]
        return [dict(leaves({key: record[key] for key in record if key != "n"})) for record in records]

    device, bus = ticks(Depth.DEVICE), ticks(Depth.BUS)
    assert len(device) > 300
    assert {key for tick in device for key in tick} >= {".compass.heading_deg", ".motion.forward_m", ".travelled_m"}
    for one, other in zip(device, bus, strict=True):
        assert one == other


def test_minirover_with_its_camera_and_board_runs_a_trial_to_its_end() -> None:
    forest = generate_forest(1, 0, 0)
    spec = TrialSpec(0, "forest-pledge", forest, 1, load_rover("minirover"), budget_m=6.0, depth=Depth.BUS)
    result = run_trial(spec)
    assert result.outcome == "entrapped", "its budget is over"
    assert result.path_m > 1.0
    assert result.ticks == pytest.approx(24.0 * 20, abs=20)
    assert run_trial(spec) == result


CLAW_WHEELS = {"driver": "roboclaw_wheels", "left": 2, "reverse_left": True, "counts_per_m": 3000.0}
PINS = {"left_a": 5, "left_b": 6, "right_a": 12, "right_b": 13}
ENCODERS = {"driver": "encoders", **PINS, "reverse_right": True, "counts_per_m": 1000.0}


@pytest.mark.parametrize("wheels", [CLAW_WHEELS, ENCODERS])
def test_rover_with_a_roboclaw_runs_the_same_trial_at_both_depths(wheels: dict[str, Any]) -> None:
    claw = {"driver": "roboclaw", "left": 2, "reverse_right": True, "duty_limit": 0.9}
    config = with_part(load_rover("forestrover"), wheels=wheels, motors=claw)
    spec = TrialSpec(0, "forest-pledge", generate_forest(1, 0, 0), 0, config, budget_m=20.0)
    device = run_trial(spec)
    assert run_trial(replace(spec, depth=Depth.BUS)) == device
    assert device.path_m > 15.0


@pytest.mark.parametrize("place", [{"bus": "/dev/i2c-1"}, {"port": "/dev/ttyAMA2"}])
def test_bno055_steers_a_trial_on_each_of_its_lines(place: dict[str, str]) -> None:
    rover = with_part(load_rover("sim"), compass={"driver": "bno055", "heading_offset_deg": 90.0} | place)
    spec = TrialSpec(0, "forest-pledge", generate_forest(1, 0, 0), 1, rover, budget_m=6.0, depth=Depth.BUS)
    result = run_trial(spec)
    assert result.outcome == "entrapped", "its budget is over"
    assert result.path_m > 1.0


# -- motors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wanted", [0.5, 0.501, -0.333, 1.0, -1.0, 0.003, 0.0])
def test_motors_apply_the_same_steps_at_both_depths(wanted: float) -> None:
    @virtual
    async def applied(depth: Depth, name: str) -> tuple[WheelCommand, tuple[float, ...]]:
        world, rover = rover_in(CLEARING, load_rover(name), depth)
        await rover.motors.open()
        return await rover.motors.drive(WheelCommand(wanted, -wanted)), world.commanded

    for name in ("sim", "minirover"):
        told, turning = applied(Depth.DEVICE, name)
        chip_told, chip_turning = applied(Depth.BUS, name)
        assert chip_told == pytest.approx(told)
        assert chip_turning == pytest.approx(turning)
        assert turning == pytest.approx(tuple(told))


# -- which parts -------------------------------------------------------------------------------------------------


async def test_bus_depth_has_the_real_drivers_and_device_depth_has_not() -> None:
    _, bus = rover_in(CLEARING, load_rover("sim"), Depth.BUS)
    assert [type(part) for part in (bus.compass, bus.motors, bus.motion)] == [CMPS14, Sabertooth, PMW3901]
    _, device = rover_in(CLEARING, load_rover("sim"), Depth.DEVICE)
    assert [type(part) for part in (device.compass, device.motors, device.motion)] == [SimCompass, SimMotors, SimFlow]
    for rover in (bus, device):
        assert isinstance(rover.contact, ContactSensor)
        assert isinstance(rover.motion, MotionSensor)
    for depth in Depth:
        assert rover_in(CLEARING, load_rover("minirover"), depth)[1].contact is None, "its file has none"


def with_part(config: RoverConfig, **tables: dict[str, Any]) -> RoverConfig:
    return config.model_copy(update={"parts": config.parts | tables})


@virtual
async def test_lights_at_a_pin_and_on_the_board_and_a_receiver_are_there() -> None:
    equipped = with_part(load_rover("sim"), position={"driver": "gpsd"}, light={"driver": "gpio_light", "red": 17})
    _, rover = rover_in(CLEARING, equipped, Depth.BUS)
    assert isinstance(rover.light, GpioLight)
    assert isinstance(rover.position, PositionReceiver)
    _, mini = rover_in(CLEARING, load_rover("minirover"), Depth.BUS)
    assert mini.light is not None
    for part in (mini.motors, mini.light):
        await part.open()
    assert isinstance(mini.motors, ThunderBorg)


class WiredBumper(Bumper):
    """A bumper somebody has wired to simulated pins."""

    simulated_chip: ClassVar[str] = "tests.simhal.test_build_rover:SWITCHES"


def press_what_is_touched(settings: BumperSettings, wiring: ChipWiring) -> None:
    pins = wiring.buses.pins()

    def follow() -> None:
        touch = wiring.world.touch
        for side, pin in settings.pins.items():
            pins.wire(pin).level = 0.0 if touch is not None and side in touch.sides else None

    pins.before_read.append(follow)


SWITCHES = SimulatedChip(press_what_is_touched)


@pytest.mark.parametrize("driver", ["bumper", "tests.simhal.test_build_rover:WiredBumper"])
def test_bumper_with_a_chip_is_the_real_driver_on_pins_and_any_other_a_simulated_part(driver: str) -> None:
    @virtual
    async def bumps() -> set[Side]:
        config = with_part(
            load_rover("sim"), contact={"driver": driver, "front": 5, "left": 6, "right": 12, "rear": 13}
        )
        world, rover = rover_in(generate_forest(1, 0, 0), config, Depth.BUS)
        assert await opens(rover)
        assert rover.contact is not None
        assert (type(rover.contact) is SimBumper) is (driver == "bumper")
        seen: set[Side] = set()
        for _ in range(400):
            await rover.motors.drive(AHEAD)
            seen |= set((await rover.contact.read()).sides)
            await asyncio.sleep(0.05)
        assert world.touch is not None
        return seen

    assert bumps() == {Side.LEFT}


async def test_part_without_a_simulated_chip_is_refused_at_bus_depth_only() -> None:
    chipless = with_part(load_rover("sim"), compass={"driver": "tests.fake_plugins:Chipless"})
    with pytest.raises(BadConfig, match=r"'sim': no simulated chip for '.*'; use --depth device, or name one in the"):
        rover_in(CLEARING, chipless, Depth.BUS)
    rover_in(CLEARING, chipless, Depth.DEVICE)


@virtual
async def test_settings_of_the_file_decide_where_the_chips_are() -> None:
    config = load_rover("sim")
    moved = with_part(
        config,
        compass={"driver": "cmps14", "bus": "/dev/i2c-5", "address": 0x62},
        motion={"driver": "pmw3901", "bus": "/dev/spidev1.0", "height_m": 0.2},
        motors={"driver": "sabertooth", "port": "/dev/ttyAMA9", "address": 131, "left": 2, "reverse_right": True},
    )
    world, rover = rover_in(CLEARING, moved, Depth.BUS)
    assert await opens(rover)
    await rover.motors.drive(WheelCommand(1.0, 0.5))
    assert world.commanded == pytest.approx((1.0, 0.5), abs=0.01)


async def opens(rover: Rover) -> bool:
    for part in rover.parts.values():
        try:
            await part.open()
        except NotResponding:
            return False
    return True


# -- the board's own deadman -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "deadman_s"), [("forestrover", 0.3), ("minirover", 0.25)])
@virtual
async def test_wheels_stop_by_the_board_alone_when_the_control_task_stalls(name: str, deadman_s: float) -> None:
    """Only the compass is read; nobody speaks to the motors any more."""
    time = asyncio.get_running_loop().time
    world, rover = rover_in(CLEARING, load_rover(name), Depth.BUS)
    assert await opens(rover)
    assert rover.motors.deadman_s == deadman_s
    for _ in range(40):
        await rover.motors.drive(AHEAD)
        await asyncio.sleep(0.05)
    stalled_s = time() - 0.05  # the last command
    await asyncio.sleep(0.02)  # off the grid of steps, where rounding errors decide
    turning: dict[float, bool] = {}
    for _ in range(40):
        await rover.compass.read()
        turning[time() - stalled_s] = world.commanded != STOP
        await asyncio.sleep(0.05)
    assert {after_s for after_s, turns in turning.items() if turns} == {
        after_s for after_s in turning if after_s < deadman_s
    }
    stands_at_m = world.path_m
    assert stands_at_m > 0.5
    await asyncio.sleep(10.0)
    await rover.compass.read()
    assert world.path_m == pytest.approx(stands_at_m, abs=1e-6)


@pytest.mark.parametrize("sensor", ["compass", "motion"])
def test_deadman_acts_at_its_own_time_even_if_nobody_looks_until_much_later(sensor: str) -> None:
    """Physics must not go on driving to the moment at which something speaks again."""

    @virtual
    async def path_m(silent_s: float) -> float:
        world, rover = rover_in(CLEARING, load_rover("sim"), Depth.BUS)
        assert await opens(rover)
        await rover.motors.drive(WheelCommand(1.0, 1.0))
        await asyncio.sleep(silent_s)
        await rover.parts[sensor].read()  # type: ignore[attr-defined]
        return world.path_m

    soon_m, late_m = (path_m(silent_s) for silent_s in (2.0, 60.0))
    assert late_m == pytest.approx(soon_m, abs=1e-3)
    assert 0.2 < late_m < 1.4 * (0.3 + 0.1), "at most full speed for the timeout and the motors' lag"
