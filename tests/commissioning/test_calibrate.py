"""Calibrating a simulated rover with a person who follows a script, in virtual time."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import pi
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.boards import now_s
from tests.kit.rover import ChipRig, Rig, Script, push_by_hand
from wayfarer.commissioning import checks
from wayfarer.commissioning.calibrate import STEPS, calibrate, residual_deg
from wayfarer.config.calibration_file import Calibration, FlowEntry, stamp
from wayfarer.drivers.bno055 import BNO055, BNO055Settings
from wayfarer.drivers.camera_motion import CameraMotion, CameraMotionSettings
from wayfarer.drivers.cmps14 import LEARN, OFF
from wayfarer.errors import BadInput, NotResponding, WayfarerError
from wayfarer.hal import MotionReading, Rover
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.bno055 import BNO055Chip
from wayfarer.simhal.chips.cmps14 import CALIBRATED, CMPS14Chip
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import HeadingSensorModel


class LearningChip(CMPS14Chip):
    """A compass whose levels rise with each look while it may learn, unless it is stubborn."""

    looks = 0
    stubborn = False
    lost_looks = range(0)
    is_silent = False  # in the lost looks; else they give garbage
    commands = ""

    def read(self, count: int) -> bytes:
        if self.config != LEARN:
            return super().read(count)
        self.looks += 1
        level = 1 if self.stubborn else min(3, self.looks // 2)
        self.calibration = 0b11_00_00_00 | level << 2 | min(level, self.looks // 4)
        if self.looks not in self.lost_looks:
            return super().read(count)
        if self.is_silent:
            raise NotResponding("gone")
        return bytes(count)

    def write(self, data: bytes) -> None:
        self.commands += data[1:].hex()
        super().write(data)


# What the driver writes for each, as on page 3 of the data sheet.
ERASE, LEARNING, STORE, STOP_LEARNING = "e0e5e2", "98959983", "f0f5f6", "98959980"


class LearningRig(ChipRig):
    """A rover whose compass learns."""

    compass_chip: LearningChip

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, LearningChip)


@pytest.fixture
def learning(tmp_path: Path) -> LearningRig:
    return LearningRig(tmp_path)


def person(rig: Rig, answers: dict[str, bool] | None = None, turn_deg: float = 90.0, push_m: float = 2.0) -> Script:
    """Someone who does as told: quarter turns by ``turn_deg``, a push by ``push_m``."""

    async def turn() -> None:
        rig.world.heading_rad += turn_deg * pi / 180.0

    async def push() -> None:
        await push_by_hand(rig.world, push_m)

    return Script(rig.world, answers or {}, {"Turn it to the right": turn, "Push it straight ahead": push})


def test_all_steps_are_measured_and_saved_with_date_and_part(rig: Rig) -> None:
    found = rig.calibrate(person(rig), *STEPS)
    assert rig.kept == found
    assert found.compass is not None
    assert found.flow is not None
    assert found.motors is not None
    assert {found.compass.date, found.flow.date, found.motors.date} == {"2026-11-18"}
    parts = (found.compass.part, found.flow.part, found.motors.part)
    assert parts == (rig.compass.name, rig.motion.name, rig.motors.name)


def test_each_step_is_saved_before_the_next_begins(rig: Rig) -> None:
    rig.motors.dead = True
    with pytest.raises(NotResponding):
        rig.calibrate(person(rig), *STEPS)
    saved = rig.kept
    assert saved.compass is not None
    assert saved.flow is not None
    assert saved.motors is None


def test_one_step_leaves_the_others_as_they_were(rig: Rig) -> None:
    old = FlowEntry(**stamp("flow", 1.0), scale=1.3)
    rig.keep(flow=old)
    assert rig.calibrate(person(rig), "motors").flow == old


def test_a_broken_file_is_not_overwritten(rig: Rig) -> None:
    rig.host.calibration_file.parent.mkdir()
    rig.host.calibration_file.write_text("{", encoding="ascii")
    with pytest.raises(BadInput):
        rig.calibrate(person(rig), "flow")
    assert rig.host.calibration_file.read_text(encoding="ascii") == "{"


# -- compass -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("forget", [True, False])
def test_the_compass_learns_stores_and_learns_no_more(learning: LearningRig, forget: bool) -> None:
    chip, someone = learning.compass_chip, person(learning, {"Forget": forget})
    found = learning.calibrate(someone, "compass").compass
    assert chip.commands == STOP_LEARNING + ERASE * forget + LEARNING + STORE + STOP_LEARNING
    assert (chip.config, chip.profile, chip.ignored) == (OFF, CALIBRATED, [])
    assert found is not None
    assert found.part.startswith("CMPS14")
    assert (found.level, found.residual_deg < 2.0) == (3, True)
    shown = [text for text in someone.told if text.startswith("field")]
    assert shown[0] == "field 0 of 3, tilt 0 of 3"
    assert shown[-1] == "field 3 of 3, tilt 3 of 3"
    assert len(shown) == len(set(shown))
    assert learning.world.most == 0.0


class LearningBNO055(BNO055Chip):
    """Its levels rise with each look."""

    looks = 0

    def _read(self, register: int, count: int) -> bytes:
        self.looks += 1
        self.calibration = 0xF0 | min(3, self.looks // 8) << 2 | min(3, self.looks // 6)
        return super()._read(register, count)


@pytest.mark.parametrize(("nose_deg", "advice"), [(10.0, []), (270.0, ["heading_offset_deg = 0"])])
def test_bno055_is_turned_about_and_its_offsets_and_its_north_are_told(
    rig: ChipRig, nose_deg: float, advice: list[str]
) -> None:
    there = LearningBNO055(HeadingSensorModel(rig.world, RandomStreams(0)), now_s)
    buses = FakeBuses()
    buses.i2c("/dev/i2c-1").attach(0x28, there)
    table = {"driver": "bno055", "heading_offset_deg": 90.0}
    rig.config = rig.config.model_copy(update={"parts": rig.config.parts | {"compass": table}})
    rig.rover = Rover(BNO055(BNO055Settings(heading_offset_deg=90.0), buses), rig.motors)
    someone = person(rig)
    someone.number_given = nose_deg  # it points west after three quarter turns, and the setting makes that north
    found = rig.calibrate(someone, "compass").compass
    assert found is not None
    assert (found.level, found.residual_deg < 2.0) == (3, True)
    written = [text.removeprefix("Write under [parts.compass]: ") for text in someone.told if text.startswith("Write")]
    assert written == [f'offsets = "{bytes(16).hex()}0000e803e001"', *advice]


def test_a_compass_that_never_gets_there_stores_nothing_and_stops_learning(learning: LearningRig) -> None:
    learning.compass_chip.stubborn = True
    with pytest.raises(WayfarerError, match="not calibrated within 300 s"):
        learning.calibrate(person(learning), "compass")
    assert learning.compass_chip.commands == STOP_LEARNING + ERASE + LEARNING + STOP_LEARNING
    assert not learning.host.calibration_file.exists()


@pytest.mark.parametrize("silent", [False, True])
def test_garbage_while_it_is_turned_about_is_passed_over_and_silence_ends_the_learning(
    learning: LearningRig, silent: bool
) -> None:
    chip = learning.compass_chip
    chip.lost_looks, chip.is_silent = range(3, 5), silent  # the driver reads twice
    if silent:
        with pytest.raises(NotResponding):
            learning.calibrate(person(learning), "compass")
    else:
        assert learning.calibrate(person(learning), "compass").compass is not None
    assert chip.commands.endswith(STOP_LEARNING)
    assert (STORE in chip.commands) is not silent


def test_a_compass_without_commands_is_only_measured(rig: Rig) -> None:
    someone = person(rig)
    assert rig.calibrate(someone, "compass").compass is not None
    assert any("accepts no calibration" in text for text in someone.told)


def test_quarter_turns_by_eighty_degrees_are_found_out(rig: Rig) -> None:
    found = rig.calibrate(person(rig, turn_deg=80.0), "compass").compass
    assert found is not None
    assert found.residual_deg == pytest.approx((3 * 10.0 + 30.0) / 4, abs=1.0)


@pytest.mark.parametrize("turn_deg", [-90.0, 0.0])
def test_a_heading_that_does_not_follow_is_refused(rig: Rig, turn_deg: float) -> None:
    with pytest.raises(WayfarerError, match="turned to the left, or there is a magnet"):
        rig.calibrate(person(rig, turn_deg=turn_deg), "compass")
    assert not rig.host.calibration_file.exists()


@given(first_deg=st.floats(0.0, 360.0), errors_deg=st.lists(st.floats(-5.0, 5.0), min_size=4, max_size=4))
def test_the_residual_does_not_depend_on_north_and_is_bounded_by_the_errors(
    first_deg: float, errors_deg: Sequence[float]
) -> None:
    headings_deg = [(first_deg + 90.0 * n + error) % 360.0 for n, error in enumerate(errors_deg)]
    assert residual_deg([(first_deg + 90.0 * n) % 360.0 for n in range(4)]) == pytest.approx(0.0, abs=1e-9)
    assert residual_deg(headings_deg) <= 2.0 * max(map(abs, errors_deg)) + 1e-9


# -- flow ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.6])
def test_a_push_gives_the_scale(rig: Rig, factor: float) -> None:
    rig.motion.ahead = factor
    found = rig.calibrate(person(rig), "flow").flow
    assert found is not None
    assert found.scale == pytest.approx(1.0 / factor, rel=0.05)
    assert rig.world.most == 0.0


@pytest.mark.parametrize(
    ("ahead", "aside", "quality", "why"),
    [
        (-1.0, 0.0, 0.8, r"the other way round: .*\[parts\.motion\]"),
        (0.0, 1.0, 0.8, r"a quarter turn round: .*\[parts\.motion\]"),
        (0.01, 0.0, 0.8, r"hardly pushed, .*\[parts\.motion\]"),
        (0.09, 0.0, 0.8, r"2 m was measured as 0\.18 m; .*\[parts\.motion\]"),
        (1.0, 0.0, 0.1, "saw nothing"),
    ],
)
def test_a_push_that_was_seen_otherwise_is_refused_with_what_to_do(
    rig: Rig, ahead: float, aside: float, quality: float, why: str
) -> None:
    rig.motion.ahead, rig.motion.aside, rig.motion.quality = ahead, aside, quality
    with pytest.raises(WayfarerError, match=why):
        rig.calibrate(person(rig), "flow")
    assert not rig.host.calibration_file.exists()


def test_a_push_that_lost_sight_for_a_moment_is_refused(rig: Rig) -> None:
    async def darken() -> None:
        rig.motion.quality = 0.1
        await push_by_hand(rig.world, 0.4)
        rig.motion.quality = 0.8
        await push_by_hand(rig.world, 1.6)

    with pytest.raises(WayfarerError, match="did not see the ground"):
        rig.calibrate(Script(rig.world, {}, {"Push it straight ahead": darken}), "flow")


@pytest.mark.parametrize("metres", [0.0, -2.0, 1000.0, float("nan")])
def test_a_distance_that_is_none_is_refused(rig: Rig, metres: float) -> None:
    someone = person(rig)
    someone.number_given = metres
    with pytest.raises(BadInput):
        rig.calibrate(someone, "flow")


class Watching(CameraMotion):
    """A camera that looks ahead: its picture changes by noise, and with every step of the world."""

    def __init__(self, rig: Rig, noise: float, per_m: float) -> None:
        settings = CameraMotionSettings(method="difference", difference_still=1.0, difference_moving=2.0)
        super().__init__(settings, FakeBuses())
        self._world, self._noise, self._per_m = rig.world, noise, per_m
        self._seen_m = 0.0

    async def open(self) -> None: ...

    async def read(self) -> MotionReading:
        return MotionReading(asyncio.get_running_loop().time(), 0.0, 0.0, 1.0, signed=False)

    async def change(self) -> float:
        await asyncio.sleep(0.1)
        moved_m, self._seen_m = self._world.path_m - self._seen_m, self._world.path_m
        return self._noise + self._per_m * moved_m


def test_camera_that_only_sees_change_gets_the_numbers_for_its_rover_file(rig: Rig) -> None:
    rig.rover = replace(rig.rover, motion=Watching(rig, noise=1.5, per_m=100.0))
    someone = person(rig)
    found = rig.calibrate(someone, "flow").flow
    assert found is not None
    assert (found.part, found.scale) == ("camera 0 as motion sensor", 1.0)
    said = next(line for line in someone.told if "difference_still" in line)
    still, moving, speed_m_s = (float(number) for number in re.findall(r"= ([0-9.]+)", said))
    assert still == 1.5
    assert moving == pytest.approx(1.5 + 100.0 * speed_m_s * 0.1, rel=0.3)


def test_camera_whose_picture_hardly_changes_is_refused(rig: Rig) -> None:
    rig.rover = replace(rig.rover, motion=Watching(rig, noise=5.0, per_m=10.0))
    with pytest.raises(WayfarerError, match=r"grey levels when pushed and by 5\.0 when still"):
        rig.calibrate(person(rig), "flow")


def test_a_rover_without_motion_sensor_keeps_what_is_known(rig: Rig) -> None:
    rig.rover = replace(rig.rover, motion=None)
    assert rig.calibrate(person(rig), "flow") == Calibration()


# -- motors --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("full_shift_deg", "passed"), [(0.0, True), (8.0, True), (13.0, False), (-13.0, False)])
def test_the_heading_shift_of_the_motors_is_measured_and_judged(rig: Rig, full_shift_deg: float, passed: bool) -> None:
    rig.world.heading_rad = 0.01  # the shift goes across north
    rig.compass.bias_deg = lambda: full_shift_deg * rig.world.commanded[0]
    someone = person(rig)
    found = rig.calibrate(someone, "motors").motors
    assert found is not None
    assert found.shift_half_deg == pytest.approx(abs(full_shift_deg) / 2, abs=1.0)
    assert found.shift_full_deg == pytest.approx(abs(full_shift_deg), abs=1.0)
    assert found.passed is passed
    assert any("mast" in text for text in someone.told) is not passed
    judged = rig.look(partial(checks.calibrated.calibrated, "motors"))
    assert (judged.verdict is checks.CheckVerdict.OK, "motor current shifts the heading" in judged.text) == (
        passed,
        not passed,
    )


def test_no_wheel_turns_without_a_yes(rig: Rig) -> None:
    assert rig.calibrate(person(rig, {"on blocks": False}), "motors") == Calibration()
    assert rig.world.most == 0.0
    assert not rig.host.calibration_file.exists()


def test_duty_grows_slowly_and_commands_never_pause(rig: Rig) -> None:
    rig.calibrate(person(rig), "motors")
    duties = [command.left for command in rig.motors.commands]
    assert max(after - before for before, after in pairwise(duties)) <= 0.1 + 1e-9
    assert max(duties) == 1.0


def test_a_limited_rover_is_measured_within_its_limit(rig: Rig) -> None:
    rig.set(safety={"duty_max": 0.3})
    rig.compass.bias_deg = lambda: 20.0 * rig.world.commanded[0]
    found = rig.calibrate(person(rig), "motors").motors
    assert rig.world.most == pytest.approx(0.3, abs=0.01)
    assert found is not None
    assert (found.shift_half_deg, found.shift_full_deg) == pytest.approx((3.0, 6.0), abs=1.0)


@pytest.mark.parametrize("at", [1, 50, 119])
def test_motors_that_fail_in_the_middle_are_stopped(rig: Rig, at: int) -> None:
    rig.motors.fails_at = at
    with pytest.raises(NotResponding):
        rig.calibrate(person(rig), "motors")


@pytest.mark.parametrize("after_s", [2.1, 3.5, 4.5])  # duty 0 for 2 s, then half, then full
def test_a_cancelled_calibration_stops_the_motors(rig: Rig, after_s: float) -> None:
    rig.cancel(calibrate(rig.config, rig.rover, rig.host, rig.kept, person(rig), ["motors"]), after_s)
    assert rig.world.most > 0.0
