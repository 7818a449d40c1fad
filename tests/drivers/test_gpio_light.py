"""A status light shows what it can, and is dark only when told to be."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.virtual import virtual
from wayfarer.drivers.gpio_light import GpioLight, GpioLightSettings
from wayfarer.hal import Colour
from wayfarer.simhal.buses import FakeBuses

pytestmark = pytest.mark.usefixtures("board")

parts = st.floats(0, 1)
settings = st.builds(
    GpioLightSettings,
    red=st.sampled_from((16, None)),
    green=st.sampled_from((20, None)),
    blue=st.just(21),
    active_high=st.booleans(),
)


def shining(board: Any, settings: GpioLightSettings) -> set[str]:
    return {part for part, pin in settings.pins.items() if board.pin(pin).state == settings.active_high}


@pytest.mark.parametrize(
    ("settings", "colour", "lit"),
    [
        (GpioLightSettings(red=16, green=20, blue=21), Colour(1.0, 0.3, 0.0), {"red", "green"}),
        (GpioLightSettings(red=16, green=20, blue=21), Colour(0.0, 0.0, 1.0), {"blue"}),
        (GpioLightSettings(red=16, blue=21), Colour(0.2, 1.0, 0.0), {"red"}),
        (GpioLightSettings(red=16, blue=21), Colour(0.0, 1.0, 0.0), {"red", "blue"}),  # a colour that it has not
    ],
)
@virtual
async def test_each_part_of_the_colour_is_a_pin(
    board: Any, settings: GpioLightSettings, colour: Colour, lit: set[str]
) -> None:
    light = GpioLight(settings, FakeBuses())
    await light.open()
    assert shining(board, settings) == set()
    await light.show(colour)
    assert shining(board, settings) == lit


@given(colour=st.builds(Colour, parts, parts, parts), settings=settings)
@virtual
async def test_a_light_is_dark_only_for_the_dark_colour(
    board: Any, colour: Colour, settings: GpioLightSettings
) -> None:
    light = GpioLight(settings, FakeBuses())
    await light.open()
    await light.show(colour)
    assert bool(shining(board, settings)) == any(colour)
    await light.show(Colour(0.0, 0.0, 0.0))
    assert shining(board, settings) == set()
    await light.close()
