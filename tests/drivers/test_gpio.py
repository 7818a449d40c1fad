"""What is true of every part at GPIO pins: bumper, light and motors."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from tests.virtual import virtual
from wayfarer.drivers.bumper import Bumper, BumperSettings
from wayfarer.drivers.gpio_light import GpioLight, GpioLightSettings
from wayfarer.drivers.gpio_motors import GpioMotors, GpioMotorsSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, Colour, ContactSensor, DriveMotors, StatusLight
from wayfarer.simhal.buses import FakeBuses
from wayfarer.testing import check_contact_sensor, check_motors, check_status_light

gpiozero = pytest.importorskip("gpiozero")

pytestmark = pytest.mark.usefixtures("board")
PIN_CLASS = "MockPWMPin"
BUSY = 26


def bumper(rear: int = 27) -> Bumper:
    return Bumper(BumperSettings(front=5, rear=rear), FakeBuses())


def light(blue: int = 27) -> GpioLight:
    return GpioLight(GpioLightSettings(red=16, blue=blue), FakeBuses())


def motors(right_backward: int = 27) -> GpioMotors:
    return GpioMotors(GpioMotorsSettings(17, 18, 22, right_backward), FakeBuses())


each_part = pytest.mark.parametrize("make", [bumper, light, motors])
each_use = pytest.mark.parametrize(
    ("make", "use"),
    [
        (bumper, Bumper.read),
        (light, lambda part: part.show(Colour(1.0, 0.0, 0.0))),
        (motors, lambda part: part.drive(STOP)),
        (motors, GpioMotors.read_back),
    ],
)


@pytest.mark.parametrize(
    ("make", "kind", "check"),
    [
        (bumper, ContactSensor, check_contact_sensor),
        (light, StatusLight, check_status_light),
        (motors, DriveMotors, check_motors),
    ],
)
@virtual
async def test_keeps_the_promises_of_its_kind(make: Callable[..., Any], kind: type, check: Callable[..., Any]) -> None:
    assert isinstance(make(), kind)
    other = gpiozero.LED(BUSY)
    await check(make, lambda: make(BUSY))
    other.close()


@each_part
@virtual
async def test_pin_of_another_program_is_named_and_those_claimed_before_it_are_let_go(make: Callable[..., Any]) -> None:
    other = gpiozero.LED(BUSY)
    part = make(BUSY)
    with pytest.raises(NotResponding, match=rf"{part.name}: .*GPIO{BUSY}.*in use") as kept:
        await part.open()
    assert kept.value.__context__ is None, "a traceback would keep the pins"
    other.close()
    await make(BUSY).open()


@each_use
@virtual
async def test_use_before_open_and_pins_that_fail_are_told(
    make: Callable[[], Any], use: Callable[[Any], Awaitable[object]]
) -> None:
    part = make()
    with pytest.raises(NotResponding, match=rf"{part.name}: not open"):
        await use(part)
    await part.open()
    for device in part._devices.values():
        device.close()
    with pytest.raises(NotResponding, match=rf"{part.name}: the pins failed"):
        await use(part)
    await part.close()


@pytest.mark.parametrize(
    ("settings", "said"), [(BumperSettings, "at least one side"), (GpioLightSettings, "at least one colour")]
)
def test_part_without_a_pin_is_refused(settings: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        settings()


@virtual
async def test_missing_library_and_missing_board_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as bare:
        bare.setitem(sys.modules, "gpiozero", None)
        with pytest.raises(NotResponding, match=r"pip install '\.\[pi\]'"):
            await light().open()
    monkeypatch.setattr(gpiozero.Device, "pin_factory", None)
    monkeypatch.setenv("GPIOZERO_PIN_FACTORY", "none-of-these")
    with pytest.raises(NotResponding, match=r"group gpio.*python3-lgpio"):
        await light().open()


@virtual
async def test_no_pin_library_at_all_is_one_error_and_no_warnings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpiozero.Device, "pin_factory", None)
    monkeypatch.delenv("GPIOZERO_PIN_FACTORY", raising=False)
    for library in ("lgpio", "rpigpio", "pigpio", "native"):
        monkeypatch.setitem(sys.modules, f"gpiozero.pins.{library}", None)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        with pytest.raises(NotResponding, match="Unable to load any default pin factory"):
            await light().open()
    assert told == []


@virtual
async def test_other_warnings_about_pins_are_let_through(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = gpiozero.PWMSoftwareFallback("slow")
    monkeypatch.setattr(GpioLight, "_make", lambda *_: warnings.warn(slow, stacklevel=1) or {})
    with pytest.warns(gpiozero.PWMSoftwareFallback, match="slow"):
        await light().open()
