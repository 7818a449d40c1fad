"""Simulated pins: what one end sets, the other sees."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.virtual import virtual
from wayfarer.drivers.bumper import Bumper, BumperSettings
from wayfarer.drivers.gpio_light import GpioLight, GpioLightSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import Colour, Side
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.pins import FakePins
from wayfarer.testing import check_contact_sensor, check_status_light


def test_output_is_seen_outside_and_floats_when_it_is_closed() -> None:
    pins, seen = FakePins(), []
    wire = pins.wire(17)
    wire.listeners.append(lambda: seen.append(wire.level))
    pin = pins.output(17)
    pin.value = 1.0
    pin.value = True
    pin.close()
    assert seen == [0.0, 1.0, None], "each change once"
    pins.output(17, active_high=False)
    assert wire.level == 1.0


@given(st.floats(0.0, 1.0))
def test_pwm_is_in_whole_percent_as_lgpio_has_it(value: float) -> None:
    pin = FakePins().output(17, pwm_hz=100.0)
    pin.value = value
    assert pin.value == int(value * 100) / 100
    assert value - 0.01 < pin.value <= value


@pytest.mark.parametrize("value", [-0.01, 1.01, float("nan")])
def test_output_that_cannot_be_is_refused_as_gpiozero_does(value: float) -> None:
    with pytest.raises(ValueError, match="GPIO17"):
        FakePins().output(17, pwm_hz=100.0).value = value


def test_pin_has_one_user() -> None:
    pins = FakePins()
    first = pins.input(5, pull_up=True)
    with pytest.raises(RuntimeError, match="GPIO5 is already in use"):
        pins.output(5)
    first.close()
    pins.output(5)
    with pytest.raises(RuntimeError, match="closed"):
        _ = first.is_active


@pytest.mark.parametrize("pull_up", [True, False])
def test_input_tells_its_edges_and_the_world_is_asked_before_it_is_read(pull_up: bool) -> None:
    pins, told = FakePins(), []
    wire, pin = pins.wire(5), pins.input(5, pull_up=pull_up)
    pin.when_activated, pin.when_deactivated = lambda: told.append("on"), lambda: told.append("off")
    assert not pin.is_active, "a switch that nobody presses leaves the wire to the pull"
    active = 0.0 if pull_up else 1.0
    for level in (active, active, 1.0 - active, active, None):
        wire.level = level
    assert told == ["on", "off", "on", "off"]
    pins.before_read.append(lambda: setattr(wire, "level", active))
    assert pin.is_active
    pin.close()
    wire.level = None
    assert told[-1] == "on", "nobody listens any more"


@virtual
async def test_parts_at_pins_work_on_simulated_ones() -> None:
    buses = FakeBuses()
    pins = buses.pins()
    taken = pins.output(26)
    bumper = Bumper(BumperSettings(front=5, left=6), buses)
    await check_contact_sensor(lambda: bumper, lambda: Bumper(BumperSettings(rear=26), buses))
    await check_status_light(
        lambda: GpioLight(GpioLightSettings(red=16), buses), lambda: GpioLight(GpioLightSettings(red=26), buses)
    )
    taken.close()
    await bumper.open()
    pins.wire(6).level = 0.0
    pins.wire(6).level = None
    assert (await bumper.read()).sides == (Side.LEFT,)
    assert (await bumper.read()).sides == ()
    light = GpioLight(GpioLightSettings(red=5), buses)
    with pytest.raises(NotResponding, match="in use; give each pin to one part"):
        await light.open()
    await bumper.close()
    await light.open()
    await light.show(Colour(1.0, 0.0, 0.0))
    assert pins.wire(5).level == 1.0
