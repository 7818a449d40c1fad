"""Fake buses: what is right goes through, what is missing is silent, what is wrong fails loudly."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest

from tests.virtual import virtual
from wayfarer.drivers.buses import Frame
from wayfarer.errors import NotResponding
from wayfarer.simhal.buses import ChipMisuse, FakeBuses, FakeI2C, FakeSerial, FakeSPI


class Echo:
    """A chip on any bus: gives back what it got, upside down."""

    def __init__(self) -> None:
        self.got: list[bytes] = []

    def write(self, data: bytes) -> None:
        self.got.append(data)

    def receive(self, data: bytes) -> bytes:
        self.got.append(data)
        return data[::-1]

    def read(self, count: int) -> bytes:
        return self.got[-1][::-1].ljust(count, b"\0")

    def exchange(self, data: bytes) -> bytes:
        self.got.append(data)
        return data[::-1]


# -- I2C ---------------------------------------------------------------------------------------------------------


async def test_chips_of_one_bus_hear_only_what_is_for_them() -> None:
    bus, first, second = FakeI2C("i2c"), Echo(), Echo()
    bus.attach(0x10, first)
    bus.attach(0x11, second)
    await bus.write(0x10, b"\x01")
    assert await bus.write_read(0x11, b"\x02\x03", 3) == b"\x03\x02\0"
    assert await bus.write_then_read(0x11, b"\x04", 1) == b"\x04"
    bus.post(0x10, b"\x05")
    assert (first.got, second.got) == ([b"\x01", b"\x05"], [b"\x02\x03", b"\x04"])


def test_two_chips_at_one_address_are_a_mistake_of_the_rig() -> None:
    bus = FakeI2C("/dev/i2c-1")
    bus.attach(0x60, Echo())
    with pytest.raises(ChipMisuse, match="/dev/i2c-1: two chips at 0x60"):
        bus.attach(0x60, Echo())


async def test_nobody_at_an_address_does_not_answer() -> None:
    bus = FakeI2C("/dev/i2c-1")
    bus.attach(0x60, Echo())
    for transfer in (bus.write(0x61, b"\0"), bus.write_read(0x61, b"\0", 1), bus.write_then_read(0x61, b"\0", 1)):
        with pytest.raises(NotResponding, match="/dev/i2c-1: no answer at address 0x61"):
            await transfer
    bus.post(0x61, b"\0")  # it never raises


# -- SPI and serial ----------------------------------------------------------------------------------------------


async def test_pieces_go_to_the_chip_one_by_one() -> None:
    device, chip = FakeSPI("spi"), Echo()
    device.attach(chip)
    assert await device.transfer(b"\x01\x02", b"\x03") == (b"\x02\x01", b"\x03")
    assert chip.got == [b"\x01\x02", b"\x03"]


@pytest.mark.parametrize("line", [FakeSPI("/dev/spidev0.1"), FakeSerial("/dev/serial0")])
def test_a_second_chip_on_one_line_is_a_mistake_of_the_rig(line: FakeSPI | FakeSerial) -> None:
    line.attach(Echo())
    with pytest.raises(ChipMisuse, match=f"{line.name}: two chips"):
        line.attach(Echo())


async def test_spi_line_without_a_chip_floats_high() -> None:
    assert await FakeSPI("spi").transfer(b"\x00\x00\x00", b"\x01") == (b"\xff\xff\xff", b"\xff")


async def test_serial_line_without_a_listener_takes_everything_and_tells_nothing() -> None:
    port = FakeSerial("serial")
    await port.write(b"\x80")
    chip = Echo()
    port.attach(chip)
    await port.write(b"\x81")
    port.post(b"\x82")
    assert chip.got == [b"\x81", b"\x82"]


@virtual
async def test_answer_of_a_chip_comes_at_once_and_one_that_is_not_whole_is_waited_for() -> None:
    port, loop = FakeSerial("serial"), asyncio.get_running_loop()
    with pytest.raises(NotResponding, match=r"serial: no complete answer within 0\.05 s, nothing came"):
        await port.exchange(b"\x80", lambda came: 2 - len(came))
    port.attach(Echo())
    assert await port.exchange(b"\x80\x81", lambda came: 2 - len(came)) == b"\x81\x80"
    assert loop.time() == pytest.approx(0.05)
    with pytest.raises(NotResponding, match=r"within 0\.02 s, only 80 came"):
        await port.exchange(b"\x80", lambda came: 2 - len(came), within_s=0.02)
    assert loop.time() == pytest.approx(0.07)


# -- the whole bench ---------------------------------------------------------------------------------------------


def test_one_name_is_one_bus() -> None:
    buses = FakeBuses()
    assert buses.i2c("a") is buses.i2c("a")
    assert buses.i2c("a") is not buses.i2c("b")
    assert buses.spi("a", mode=0, speed_hz=400_000) is buses.spi("a", mode=3, speed_hz=1)
    assert buses.serial("a", baud=9600) is buses.serial("a")
    names = [bus.name for bus in (buses.i2c("a"), buses.spi("b"), buses.serial("c"))]
    assert names == ["a", "b", "c"]


async def test_camera_shows_its_picture_at_the_time_and_in_the_size_that_was_asked_for() -> None:
    buses = FakeBuses()
    asked = []

    def render(t_s: float, width: int, height: int) -> Frame:
        asked.append((width, height))
        return Frame(t_s, np.zeros((height, width), np.uint8))

    buses.cameras["0"] = render
    there = buses.camera("0", width=64, height=48, rate_hz=10.0, exposure_us=None)
    assert (await there.frame()).luma.shape == (48, 64)
    assert asked == [(64, 48)]
    with pytest.raises(NotResponding, match="camera 1: no camera"):
        await buses.camera("1", width=64, height=48, rate_hz=10.0, exposure_us=None).frame()
    await buses.close()
