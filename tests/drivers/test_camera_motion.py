"""A camera tells how far, or at least that, the rover moves; what it cannot see is unknown and never still."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import chain, repeat
from math import pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from tests.simhal.clearing import STEADY, VEHICLE, steady_world
from tests.virtual import run_virtually, virtual
from wayfarer.detector import DetectorSettings
from wayfarer.drivers.buses import Frame
from wayfarer.drivers.camera_motion import CameraMotion, CameraMotionSettings
from wayfarer.errors import BadReading, NotResponding
from wayfarer.hal import MotionReading, MotionSensor
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import TILE_PX, GroundCamera, texture
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.world import World
from wayfarer.testing import check_motion_sensor

pytest.importorskip("cv2")

Luma = NDArray[np.uint8]

M_PER_PIXEL = 0.0015
PERIOD_S = 0.05
DOWN = CameraMotionSettings(m_per_pixel=M_PER_PIXEL)
AHEAD = CameraMotionSettings(
    method="difference", difference_still=2.3, difference_moving=20.0, difference_speed_m_s=0.7
)
BELIEVED = DetectorSettings().quality_min

GROUND = texture(RandomStreams(0).generator("ground"))


def noisy(luma: NDArray[Any], rng: np.random.Generator) -> Luma:
    return np.clip(luma + rng.normal(0.0, 2.0, luma.shape), 0, 255).astype(np.uint8)


def patch(x_px: int = 0, y_px: int = 0) -> Luma:
    """Return a piece of ground whose content lies that much further right and down."""
    rng = np.random.default_rng((x_px % TILE_PX, y_px % TILE_PX))
    return noisy(np.roll(GROUND, (y_px, x_px), axis=(0, 1))[200:320, 200:360], rng)


def watching(settings: CameraMotionSettings, render: Callable[[float, int, int], Frame]) -> CameraMotion:
    buses = FakeBuses()
    buses.cameras["0"] = render
    return CameraMotion(settings, buses)


def readings(settings: CameraMotionSettings, *pictures: Luma) -> list[MotionReading]:
    """Return what is read of pictures that come one a period; the first is taken by ``open``."""
    coming = chain(pictures, repeat(pictures[-1]))
    sensor = watching(settings, lambda t_s, _width, _height: Frame(t_s, next(coming)))

    async def main() -> list[MotionReading]:
        await sensor.open()
        return [await read() for _ in pictures[1:]]

    async def read() -> MotionReading:
        await asyncio.sleep(PERIOD_S)
        return await sensor.read()

    return run_virtually(main())


def over_ground() -> tuple[World, CameraMotion, CameraMotion]:
    """Return a world, a camera that registers its ground and one that only sees it change."""
    world = steady_world()
    render = GroundCamera(world, RandomStreams(0), M_PER_PIXEL).render
    return world, watching(DOWN, render), watching(AHEAD, render)


@pytest.mark.parametrize("method", [DOWN, AHEAD])
@virtual
async def test_keeps_the_promises_of_a_motion_sensor(method: CameraMotionSettings) -> None:
    render = GroundCamera(steady_world(), RandomStreams(0), M_PER_PIXEL).render
    assert isinstance(watching(method, render), MotionSensor)
    await check_motion_sensor(lambda: watching(method, render), lambda: CameraMotion(method, FakeBuses()))


@pytest.mark.parametrize("method", [DOWN, AHEAD])
@virtual
async def test_ground_on_which_nothing_is_seen_is_quality_0(method: CameraMotionSettings) -> None:
    world = World(CLEARING, VEHICLE, replace(STEADY, blind_share=1.0, blind_quality=0.4), RandomStreams(0))
    sensor = watching(method, GroundCamera(world, RandomStreams(0), M_PER_PIXEL).render)
    world.y_m += 5.0  # off the place of the start
    await sensor.open()
    world.command(0.4, 0.4)
    for _ in range(10):
        await asyncio.sleep(PERIOD_S)
        assert (await sensor.read()).quality == 0.0


# -- displacement ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("duty", [1.0, 0.4, -0.6])
@virtual
async def test_displacement_over_ground_adds_up_to_the_odometer(duty: float) -> None:
    world, sensor, _ = over_ground()
    world.heading_rad = 0.3
    await sensor.open()
    world.command(duty, duty)
    seen = []
    for _ in range(40):
        await asyncio.sleep(PERIOD_S)
        seen.append(await sensor.read())
    true_m = world.forward_m - world.reverse_m
    assert abs(true_m) > 0.9
    assert sum(reading.forward_m for reading in seen) == pytest.approx(true_m, rel=0.02)
    assert abs(sum(reading.right_m for reading in seen)) < 0.02 * abs(true_m)
    assert min(reading.quality for reading in seen) > BELIEVED
    assert all(reading.signed for reading in seen)


@pytest.mark.parametrize(
    ("forward", "ahead_px", "right_px"),
    [  # where the content of the picture goes as the rover goes 10 pixels ahead, and to its right
        ("-y", (0, 10), (-10, 0)),
        ("+y", (0, -10), (10, 0)),
        ("+x", (-10, 0), (0, -10)),
        ("-x", (10, 0), (0, 10)),
    ],
)
def test_the_picture_moves_against_the_rover(
    forward: Any, ahead_px: tuple[int, int], right_px: tuple[int, int]
) -> None:
    settings_ = CameraMotionSettings(m_per_pixel=0.002, forward=forward)
    (ahead,) = readings(settings_, patch(), patch(*ahead_px))
    assert ahead[1:3] == pytest.approx((0.02, 0.0), abs=0.0005)
    (right,) = readings(settings_, patch(), patch(*right_px))
    assert right[1:3] == pytest.approx((0.0, 0.02), abs=0.0005)


@settings(max_examples=40)
@given(x_px=st.integers(-40, 40), y_px=st.integers(-30, 30))
def test_any_shift_up_to_a_quarter_of_the_picture_is_found(x_px: int, y_px: int) -> None:
    (reading,) = readings(DOWN, patch(), noisy(patch(x_px, y_px), np.random.default_rng(7)))
    assert reading.forward_m / M_PER_PIXEL == pytest.approx(y_px, abs=0.5)
    assert reading.right_m / M_PER_PIXEL == pytest.approx(-x_px, abs=0.5)
    assert reading.quality > BELIEVED


def test_pictures_that_share_nothing_are_not_believed() -> None:
    for seed in range(20):
        (reading,) = readings(DOWN, patch(), np.rot90(patch(seed * 3 + 150), 2).copy())
        assert reading.quality < BELIEVED


# -- difference ------------------------------------------------------------------------------------------------------


@virtual
async def test_difference_tells_driving_from_standing_without_a_direction() -> None:
    world, _, sensor = over_ground()
    await sensor.open()
    for duty, low_m_s, high_m_s in ((0.0, 0.0, 0.05), (0.5, 0.5, 0.7), (-0.5, 0.5, 0.7)):
        world.command(duty, duty)
        await asyncio.sleep(1.0)  # until the motors have their speed
        await sensor.read()
        for _ in range(10):
            await asyncio.sleep(PERIOD_S)
            reading = await sensor.read()
            assert low_m_s * PERIOD_S <= reading.forward_m <= high_m_s * PERIOD_S + 1e-9
            assert (reading.right_m, reading.signed) == (0.0, False)
            assert reading.quality == 1.0


@virtual
async def test_change_gives_the_numbers_that_the_settings_want() -> None:
    coming = iter((patch(), noisy(patch(), np.random.default_rng(7)), patch(20)))
    sensor = watching(DOWN, lambda t_s, _width, _height: Frame(t_s, next(coming)))
    with pytest.raises(NotResponding, match="not open"):
        await sensor.change()
    await sensor.open()
    assert await sensor.change() == pytest.approx(2.0 * (2 / pi) ** 0.5, rel=0.05)  # of noise with an SD of 2
    assert await sensor.change() > 15.0


def test_a_cloud_before_the_sun_is_no_motion() -> None:
    rng = np.random.default_rng(0)
    bright = GROUND[200:320, 200:360]
    (reading,) = readings(AHEAD, noisy(bright, rng), noisy(bright - 20.0, rng))
    assert reading.forward_m < 0.05 * 0.7 * PERIOD_S


# -- what says nothing -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [DOWN, AHEAD])
@pytest.mark.parametrize(
    "picture",
    [
        pytest.param(np.zeros((120, 160), np.uint8), id="black"),
        pytest.param(noisy(np.full((120, 160), 5.0), np.random.default_rng(1)), id="covered"),
        pytest.param(noisy(np.full((120, 160), 90.0), np.random.default_rng(2)), id="flat"),
    ],
)
def test_black_and_flat_pictures_are_unknown_and_it_recovers(method: CameraMotionSettings, picture: Luma) -> None:
    pictures = (patch(), patch(1), picture, picture + 1, patch(2), patch(3))
    seen = readings(method, *pictures)
    assert [reading.quality > BELIEVED for reading in seen] == [True, False, False, False, True]
    assert {reading.signed for reading in seen} == {method is DOWN}


@pytest.mark.parametrize("method", [DOWN, AHEAD])
def test_a_frozen_picture_is_unknown_and_not_still(method: CameraMotionSettings) -> None:
    seen = readings(method, patch(), patch(1), patch(1), patch(1), patch(2))
    assert [reading.quality > BELIEVED for reading in seen] == [True, False, False, True]


@virtual
async def test_two_pictures_of_one_moment_are_unknown() -> None:
    coming = iter((patch(), patch(1)))
    sensor = watching(DOWN, lambda t_s, _width, _height: Frame(t_s, next(coming)))
    await sensor.open()
    assert (await sensor.read()).quality == 0.0


# -- trouble ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("picture", "said"),
    [
        (patch()[:48, :64], "64 x 48 uint8, not 160 x 120 uint8"),
        (patch().astype("float32"), "160 x 120 float32, not 160"),
    ],
)
def test_a_picture_of_another_size_or_of_other_than_grey_bytes_is_refused(picture: Any, said: str) -> None:
    with pytest.raises(BadReading, match=said):
        readings(DOWN, patch(), picture)


@virtual
async def test_a_camera_that_stops_is_told_and_the_next_picture_counts_from_the_last_one() -> None:
    world, sensor, _ = over_ground()
    render = GroundCamera(world, RandomStreams(0), M_PER_PIXEL).render
    broken = False

    def unsteady(t_s: float, width: int, height: int) -> Frame:
        if broken:
            raise NotResponding("camera 0: no frame within 3 s")
        return render(t_s, width, height)

    sensor = watching(DOWN, unsteady)
    await sensor.open()
    world.command(0.2, 0.2)
    await asyncio.sleep(PERIOD_S)
    broken = True
    with pytest.raises(NotResponding, match="no frame"):
        await sensor.read()
    broken = False
    await asyncio.sleep(PERIOD_S)
    assert (await sensor.read()).forward_m == pytest.approx(world.forward_m, abs=M_PER_PIXEL)


@virtual
async def test_missing_opencv_and_use_before_open_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    _, sensor, _ = over_ground()
    with pytest.raises(NotResponding, match="camera 0 as motion sensor: not open"):
        await sensor.read()
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(NotResponding, match=r"pip install 'wayfarer-rover\[camera\]'"):
        await sensor.open()
    await sensor.close()


# -- settings --------------------------------------------------------------------------------------------------------

FROM_FILE = TypeAdapter(CameraMotionSettings)


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({}, "needs m_per_pixel"),
        ({"method": "difference"}, "needs difference_still and difference_moving"),
        ({"method": "difference", "difference_still": 5.0, "difference_moving": 5.0}, "must be less"),
        ({"m_per_pixel": 0.001, "width": 161}, "multiple of 2"),
        ({"m_per_pixel": float("nan")}, "less than or equal to"),
        ({"m_per_pixel": 0.001, "forward": "y"}, r"'\+y'"),
    ],
)
def test_settings_that_cannot_be_are_refused(keys: dict[str, Any], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        FROM_FILE.validate_python(keys)
