"""Parts at GPIO pins: what is true of all of them, of a bumper, and of a light. Motors: ``test_gpio_motors.py``."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.virtual import virtual
from wayfarer.drivers.bumper import Bumper, BumperSettings
from wayfarer.drivers.encoders import Encoders, EncodersSettings
from wayfarer.drivers.gpio_light import GpioLight, GpioLightSettings
from wayfarer.drivers.gpio_motors import GpioMotors, GpioMotorsSettings
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, Colour, ContactSensor, DriveMotors, Side, StatusLight, WheelSensor
from wayfarer.testing import check_contact_sensor, check_motors, check_status_light, check_wheel_sensor

gpiozero = pytest.importorskip("gpiozero")

pytestmark = pytest.mark.usefixtures("board")
PIN_CLASS = "MockPWMPin"
BUSY = 26


def bumper(rear: int = 27) -> Bumper:
    return Bumper(BumperSettings(front=5, rear=rear), LinuxBuses())


def light(blue: int = 27) -> GpioLight:
    return GpioLight(GpioLightSettings(red=16, blue=blue), LinuxBuses())


def motors(right_backward: int = 27) -> GpioMotors:
    settings = GpioMotorsSettings(left_forward=17, left_backward=18, right_forward=22, right_backward=right_backward)
    return GpioMotors(settings, LinuxBuses())


def encoders(right_b: int = 27) -> Encoders:
    return Encoders(EncodersSettings(5, 6, 12, right_b, 3000.0), LinuxBuses())


each_part = pytest.mark.parametrize("make", [bumper, light, motors, encoders])
each_use = pytest.mark.parametrize(
    ("make", "use"),
    [
        (bumper, Bumper.read),
        (light, lambda part: part.show(Colour(1.0, 0.0, 0.0))),
        (motors, lambda part: part.drive(STOP)),
        (encoders, Encoders.read),
    ],
)


@pytest.mark.parametrize(
    ("make", "kind", "check"),
    [
        (bumper, ContactSensor, check_contact_sensor),
        (light, StatusLight, check_status_light),
        (motors, DriveMotors, check_motors),
        (encoders, WheelSensor, check_wheel_sensor),
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
    for device in part._claimed:
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
        with pytest.raises(NotResponding, match=r"pip install 'wayfarer-rover\[pi\]'"):
            await light().open()
    monkeypatch.setattr(gpiozero.Device, "pin_factory", None)
    monkeypatch.setenv("GPIOZERO_PIN_FACTORY", "none-of-these")
    with pytest.raises(NotResponding, match=r"pin factory.*; sudo apt install python3-lgpio"):
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


# -- bumper ------------------------------------------------------------------------------------------------------------

PIN_OF = {Side.FRONT: 5, Side.LEFT: 6, Side.RIGHT: 12, Side.REAR: 13}
ALL_ROUND = BumperSettings(front=5, left=6, right=12, rear=13)


async def opened_bumper(settings: BumperSettings = ALL_ROUND) -> Bumper:
    bumper = Bumper(settings, LinuxBuses())
    await bumper.open()
    return bumper


def press(board: Any, side: Side) -> None:
    board.pin(PIN_OF[side]).drive_low()


def let_go(board: Any, side: Side) -> None:
    board.pin(PIN_OF[side]).drive_high()


@given(
    touches=st.lists(
        st.tuples(
            st.sets(st.sampled_from(Side)),  # pressed and let go between two reads
            st.sets(st.sampled_from(Side)),  # held over the read
        ),
        max_size=8,
    )
)
@virtual
async def test_every_press_is_reported_once_let_go_and_as_long_as_it_is_held(
    board: Any, touches: list[tuple[set[Side], set[Side]]]
) -> None:
    held: set[Side] = set()
    bumper = await opened_bumper()
    for taps, holds in touches:
        tapped = taps - held
        for side in tapped:
            press(board, side)
            let_go(board, side)
        for side in held - holds:
            let_go(board, side)
        for side in holds - held:
            press(board, side)
        held = holds
        sides = (await bumper.read()).sides
        assert set(sides) == held | tapped
        assert len(set(sides)) == len(sides)
        assert set((await bumper.read()).sides) == held
    await bumper.close()


@virtual
async def test_a_side_that_is_pressed_already_at_opening_is_reported(
    board: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = board.pin(PIN_OF[Side.LEFT])
    monkeypatch.setattr(left, "_get_state", lambda: False)  # a mock pin follows its pull at opening; a switch wins
    bumper = await opened_bumper()
    assert (await bumper.read()).sides == (Side.LEFT,)
    assert (await bumper.read()).sides == (Side.LEFT,)


@virtual
async def test_presses_of_an_earlier_opening_are_forgotten(board: Any) -> None:
    bumper = await opened_bumper()
    press(board, Side.REAR)
    let_go(board, Side.REAR)
    await bumper.open()
    assert (await bumper.read()).sides == ()


@virtual
async def test_switches_to_3_3_volt_are_pressed_when_high(board: Any) -> None:
    bumper = await opened_bumper(BumperSettings(right=12, pull_up=False))
    assert (await bumper.read()).sides == ()
    board.pin(12).drive_high()
    assert (await bumper.read()).sides == (Side.RIGHT,)


# -- light -------------------------------------------------------------------------------------------------------------

SHARES = st.floats(0, 1)
LIGHTS = st.builds(
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
    light = GpioLight(settings, LinuxBuses())
    await light.open()
    assert shining(board, settings) == set()
    await light.show(colour)
    assert shining(board, settings) == lit


@given(colour=st.builds(Colour, SHARES, SHARES, SHARES), settings=LIGHTS)
@virtual
async def test_a_light_is_dark_only_for_the_dark_colour(
    board: Any, colour: Colour, settings: GpioLightSettings
) -> None:
    light = GpioLight(settings, LinuxBuses())
    await light.open()
    await light.show(colour)
    assert bool(shining(board, settings)) == any(colour)
    await light.show(Colour(0.0, 0.0, 0.0))
    assert shining(board, settings) == set()
    await light.close()


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ("'GPIO busy'", "gpioinfo"),  # lgpio
        ("pin GPIO16 is already in use by <gpiozero.LED object>", "to one part"),
        ("'can not open gpiochip'", "group gpio"),  # lgpio
        ("[Errno 13] Permission denied: '/dev/gpiomem'", "group gpio"),
        ("something else", "does another program"),
    ],
)
@virtual
async def test_pins_that_cannot_be_had_say_what_helps(monkeypatch: pytest.MonkeyPatch, said: str, remedy: str) -> None:
    def refuse() -> None:
        raise Exception(said)

    part = light()
    monkeypatch.setattr(part, "_make", refuse)
    with pytest.raises(NotResponding) as refused:
        await part.open()
    assert said in str(refused.value)
    assert remedy in refused.value.remedy
