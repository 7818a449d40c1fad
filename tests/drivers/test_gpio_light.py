"""A status light shows what it can, and is dark only when told to be."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.drivers.gpio_light import GpioLight, GpioLightSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import Colour, StatusLight
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

gpiozero = pytest.importorskip("gpiozero")

pytestmark = pytest.mark.usefixtures("board")

THREE = GpioLightSettings(red=16, green=20, blue=21)
DARK = Colour(0.0, 0.0, 0.0)

parts = st.floats(0, 1)
colours = st.builds(Colour, parts, parts, parts)
settings = st.builds(
    GpioLightSettings,
    red=st.sampled_from((16, None)),
    green=st.sampled_from((20, None)),
    blue=st.just(21),
    active_high=st.booleans(),
)


def light_on(settings: GpioLightSettings = THREE) -> GpioLight:
    return GpioLight(settings, FakeBuses())


def run(main: Coroutine[Any, Any, None]) -> None:
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(main)


def shining(board: Any, settings: GpioLightSettings) -> set[str]:
    return {part for part, pin in settings.pins.items() if board.pin(pin).state == settings.active_high}


def test_each_part_of_the_colour_is_a_pin(board: Any) -> None:
    async def main() -> None:
        light = light_on()
        await light.open()
        assert shining(board, THREE) == set()
        await light.show(Colour(1.0, 0.3, 0.0))
        assert shining(board, THREE) == {"red", "green"}
        await light.show(Colour(0.0, 0.0, 1.0))
        assert shining(board, THREE) == {"blue"}
        await light.close()

    run(main())


def test_a_colour_that_the_light_has_not_is_shown_by_all_it_has(board: Any) -> None:
    async def main() -> None:
        red_and_blue = GpioLightSettings(red=16, blue=21)
        light = light_on(red_and_blue)
        await light.open()
        await light.show(Colour(0.0, 1.0, 0.0))
        assert shining(board, red_and_blue) == {"red", "blue"}
        await light.show(Colour(0.2, 1.0, 0.0))
        assert shining(board, red_and_blue) == {"red"}
        await light.close()

    run(main())


@given(colour=colours, settings=settings)
def test_a_light_is_dark_only_for_the_dark_colour(board: Any, colour: Colour, settings: GpioLightSettings) -> None:
    async def main() -> None:
        light = light_on(settings)
        await light.open()
        await light.show(colour)
        assert bool(shining(board, settings)) == any(colour)
        await light.show(DARK)
        assert shining(board, settings) == set()
        await light.close()

    run(main())


def test_life_cycle() -> None:
    async def main() -> None:
        light = light_on()
        assert isinstance(light, StatusLight)
        await light.close()
        with pytest.raises(NotResponding, match="light on GPIO 16, 20, 21: not open"):
            await light.show(DARK)
        other = gpiozero.LED(21)
        with pytest.raises(NotResponding, match=r"GPIO21.*in use"):
            await light.open()
        await light.close()
        other.close()
        await light.open()
        await light.open()
        light._lamps["red"].close()
        with pytest.raises(NotResponding, match="the pins failed"):
            await light.show(Colour(1.0, 0.0, 0.0))
        await light.close()
        await light.close()

    run(main())


def test_a_light_without_a_pin_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one colour"):
        GpioLightSettings(active_high=False)
