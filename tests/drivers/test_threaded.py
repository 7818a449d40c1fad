"""Blocking devices behind their threads: opened late, opened again after an error, and errors that name the cause."""

from __future__ import annotations

import asyncio
import errno
import os
import threading
from typing import Self

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfarer.drivers.threaded import ThreadedCamera, ThreadedI2C, ThreadedSerial, ThreadedSPI, explain
from wayfarer.errors import NotResponding

LONG_S = 5.0
DEADLINE_S = 0.1
SLOW_S = 2 * DEADLINE_S  # too slow for a transfer


class Device:
    """A device of any kind, which writes down what is done to it, and fails as told."""

    def __init__(self) -> None:
        self.done: list[tuple[object, ...]] = []
        self.fails: list[Exception] = []
        self.opens_with: Exception | None = None
        self.opens_slowly = False
        self.opening = threading.Event()
        self.may_open = threading.Event()
        self.threads: set[str] = set()

    @property
    def names(self) -> list[object]:
        return [what[0] for what in self.done]

    def open(self) -> Self:
        self.note("open")
        if self.opens_slowly:
            self.opening.set()
            assert self.may_open.wait(LONG_S)
        if self.opens_with is not None:
            raise self.opens_with
        return self

    def note(self, *what: object) -> None:
        self.done.append(what)
        self.threads.add(threading.current_thread().name)
        if self.fails and what[0] not in {"open", "close"}:
            raise self.fails.pop(0)

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        self.note("write_read", address, data, count)
        return bytes(count)

    def write_then_read(self, address: int, data: bytes, count: int) -> bytes:
        self.note("write_then_read", address, data, count)
        return bytes(count)

    def transfer(self, pieces: tuple[bytes, ...]) -> tuple[bytes, ...]:
        self.note("transfer", *pieces)
        return pieces

    def luma(self) -> NDArray[np.uint8]:
        self.note("luma")
        return np.zeros((48, 64), np.uint8)

    def close(self) -> None:
        self.note("close")


class I2CDevice(Device):
    def write(self, address: int, data: bytes) -> None:
        self.note("write", address, data)


class SerialDevice(Device):
    def write(self, data: bytes) -> None:
        self.note("write", data)


def oserror(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def i2c() -> tuple[ThreadedI2C, I2CDevice]:
    device = I2CDevice()
    return ThreadedI2C("/dev/i2c-1", device.open, LONG_S), device


async def test_device_is_opened_at_its_first_transfer_and_closed_with_the_bus() -> None:
    bus, device = i2c()
    await asyncio.sleep(0)
    assert device.done == []
    await bus.write(0x15, b"\x0e\x00")
    await bus.write(0x15, b"\x0e\x00")
    await bus.close()
    assert device.done == [("open",), *[("write", 0x15, b"\x0e\x00")] * 2, ("close",)]
    assert device.threads == {"bus /dev/i2c-1"}


async def test_transfers_reach_the_device_whole() -> None:
    bus, device = i2c()
    assert await bus.write_read(0x60, b"\0", 31) == bytes(31)
    assert await bus.write_then_read(0x15, b"\x99", 6) == bytes(6)
    spi = ThreadedSPI("/dev/spidev0.1", device.open, LONG_S)
    assert await spi.transfer(b"\0\0", b"\x16") == (b"\0\0", b"\x16")
    port_device = SerialDevice()
    port = ThreadedSerial("/dev/serial0", port_device.open, LONG_S)
    await port.write(b"\x80\x00\x00\x00")
    for each in (bus, spi, port):
        await each.close()
    assert ("write_read", 0x60, b"\0", 31) in device.done
    assert ("write_then_read", 0x15, b"\x99", 6) in device.done
    assert ("transfer", b"\0\0", b"\x16") in device.done
    assert ("write", b"\x80\x00\x00\x00") in port_device.done


async def test_device_is_closed_after_an_error_and_opened_again() -> None:
    bus, device = i2c()
    device.fails = [oserror(errno.EIO)]
    with pytest.raises(NotResponding, match="/dev/i2c-1: the transfer broke off"):
        await bus.write(0x15, b"\0")
    await bus.write(0x15, b"\1")
    await bus.close()
    assert device.names == ["open", "write", "close", "open", "write", "close"]


async def test_device_that_does_not_open_is_tried_anew_at_each_transfer() -> None:
    bus, device = i2c()
    device.opens_with = oserror(errno.ENOENT)
    for _ in range(2):
        with pytest.raises(NotResponding, match="no such device file"):
            await bus.write(0x15, b"\0")
    device.opens_with = None
    await bus.write(0x15, b"\0")
    await bus.close()
    assert device.names == ["open", "open", "open", "write", "close"]


def slow_to_open() -> tuple[ThreadedI2C, I2CDevice]:
    device = I2CDevice()
    device.opens_slowly = True
    return ThreadedI2C("/dev/i2c-1", device.open, DEADLINE_S, LONG_S), device


async def test_first_opening_may_take_longer_than_a_transfer_for_all_parts_on_the_bus() -> None:
    bus, device = slow_to_open()
    asyncio.get_running_loop().call_later(SLOW_S, device.may_open.set)
    await asyncio.gather(bus.write(0x15, b"\1"), bus.write(0x60, b"\2"))
    await bus.close()
    assert device.done == [("open",), ("write", 0x15, b"\1"), ("write", 0x60, b"\2"), ("close",)]


async def test_first_opening_that_a_posted_stop_began_is_waited_for_too() -> None:
    bus, device = slow_to_open()
    bus.post(0x15, b"\x0e")
    assert await asyncio.to_thread(device.opening.wait, LONG_S)
    asyncio.get_running_loop().call_later(SLOW_S, device.may_open.set)
    await bus.write(0x15, b"\1")
    await bus.close()
    assert device.done == [("open",), ("write", 0x15, b"\x0e"), ("write", 0x15, b"\1"), ("close",)]


async def test_first_opening_that_hangs_is_given_up_at_its_own_deadline() -> None:
    device = I2CDevice()
    device.opens_slowly = True
    bus = ThreadedI2C("/dev/i2c-1", device.open, DEADLINE_S, SLOW_S)
    with pytest.raises(NotResponding, match=r"/dev/i2c-1: .* within 0\.2 s"):
        await bus.write(0x15, b"\1")
    device.may_open.set()
    await bus.close()
    assert device.done == [("open",), ("close",)], "what was to be written is too late now"


@pytest.mark.parametrize("opened_at_first", [True, False])
async def test_reopening_in_a_run_holds_nobody_longer_than_a_transfer(opened_at_first: bool) -> None:
    bus, device = slow_to_open()
    device.may_open.set()
    if opened_at_first:
        device.fails = [oserror(errno.EIO)]
    else:
        device.opens_with = oserror(errno.ENOENT)
    with pytest.raises(NotResponding, match="errno"):
        await bus.write(0x15, b"\0")
    device.may_open.clear()
    with pytest.raises(NotResponding, match=r"within 0\.1 s"):
        await bus.write(0x15, b"\1")
    device.may_open.set()
    await bus.close()


async def test_error_that_is_no_failure_of_the_bus_leaves_the_device_open() -> None:
    bus, device = i2c()
    device.fails = [ValueError("a bug of a driver")]
    with pytest.raises(ValueError, match="a bug"):
        await bus.write(0x15, b"\0")
    await bus.write(0x15, b"\0")
    await bus.close()
    assert device.names == ["open", "write", "write", "close"]


def test_error_of_linux_names_what_to_look_for_and_one_without_a_known_cause_is_told_as_it_is() -> None:
    assert explain(oserror(errno.EREMOTEIO)) == f"no acknowledgement [errno {errno.EREMOTEIO}]"
    assert "No space" in explain(oserror(errno.ENOSPC))
    assert explain(OSError("no frame")) == "no frame"
    assert explain(TimeoutError()) == "TimeoutError"


async def test_posted_write_opens_the_device_if_need_be_and_goes_out_before_the_bus_closes() -> None:
    bus, device = i2c()
    bus.post(0x15, b"\x0e\x00")
    await bus.close()
    assert device.done == [("open",), ("write", 0x15, b"\x0e\x00"), ("close",)]


async def test_posted_write_that_fails_says_nothing_and_the_next_one_opens_again() -> None:
    bus, device = i2c()
    device.fails = [oserror(errno.EREMOTEIO)]
    bus.post(0x15, b"\x0e\x00")
    bus.post(0x15, b"\x0e\x00")
    await bus.close()
    assert device.names == ["open", "write", "close", "open", "write", "close"]


async def test_frame_carries_the_time_of_the_loop() -> None:
    device = Device()
    camera = ThreadedCamera("camera 0", device.open, LONG_S)
    loop = asyncio.get_running_loop()
    before_s = loop.time()
    frame = await camera.frame()
    assert before_s <= frame.t_s <= loop.time()
    assert frame.luma.shape == (48, 64)
    await camera.close()
