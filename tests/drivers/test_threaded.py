"""Blocking devices behind their threads: opened late, opened again after an error, and errors that name the cause."""

from __future__ import annotations

import asyncio
import errno
import os
import threading
from typing import Any
from unittest.mock import DEFAULT, MagicMock, call

import pytest

from wayfarer.drivers.threaded import ThreadedI2C, ThreadedSerial, ThreadedSPI, explain
from wayfarer.errors import NotResponding

LONG_S = 5.0
DEADLINE_S = 0.1
SLOW_S = 2 * DEADLINE_S  # too slow for a transfer
OPEN, CLOSE = call.open(), call.close()


def oserror(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def made() -> MagicMock:
    """A device of any kind; its opening is one of its calls."""
    device = MagicMock()
    device.open.return_value = device
    return device


def i2c() -> tuple[ThreadedI2C, MagicMock]:
    device = made()
    return ThreadedI2C("/dev/i2c-1", device.open, LONG_S), device


async def test_device_is_opened_at_its_first_transfer_and_closed_with_the_bus() -> None:
    bus, device = i2c()
    threads = set()
    device.write.side_effect = lambda *_: threads.add(threading.current_thread().name)
    await asyncio.sleep(0)
    assert device.mock_calls == []
    await bus.write(0x15, b"\x0e\x00")
    await bus.write(0x15, b"\x0e\x00")
    await bus.close()
    assert device.mock_calls == [OPEN, *[call.write(0x15, b"\x0e\x00")] * 2, CLOSE]
    assert threads == {"bus /dev/i2c-1"}


async def test_transfers_reach_the_device_whole() -> None:
    bus, device = i2c()
    assert await bus.write_read(0x60, b"\0", 31) is device.write_read.return_value
    assert await bus.write_then_read(0x15, b"\x99", 6) is device.write_then_read.return_value
    spi = ThreadedSPI("/dev/spidev0.1", device.open, LONG_S)
    assert await spi.transfer(b"\0\0", b"\x16") is device.transfer.return_value
    port = ThreadedSerial("/dev/serial0", device.open, LONG_S)
    await port.write(b"\x80\x00\x00\x00")
    for each in (bus, spi, port):
        await each.close()
    device.write_read.assert_called_once_with(0x60, b"\0", 31)
    device.write_then_read.assert_called_once_with(0x15, b"\x99", 6)
    device.transfer.assert_called_once_with((b"\0\0", b"\x16"))
    device.write.assert_called_once_with(b"\x80\x00\x00\x00")


async def test_device_is_closed_after_an_error_and_opened_again() -> None:
    bus, device = i2c()
    device.write.side_effect = [oserror(errno.EIO), None]
    with pytest.raises(NotResponding, match="/dev/i2c-1: the transfer broke off"):
        await bus.write(0x15, b"\0")
    await bus.write(0x15, b"\1")
    await bus.close()
    assert device.mock_calls == [OPEN, call.write(0x15, b"\0"), CLOSE, OPEN, call.write(0x15, b"\1"), CLOSE]


async def test_device_that_does_not_open_is_tried_again_at_each_transfer() -> None:
    bus, device = i2c()
    device.open.side_effect = [*[oserror(errno.ENOENT)] * 2, DEFAULT]
    for _ in range(2):
        with pytest.raises(NotResponding, match="no such device file"):
            await bus.write(0x15, b"\0")
    await bus.write(0x15, b"\0")
    await bus.close()
    assert device.mock_calls == [OPEN, OPEN, OPEN, call.write(0x15, b"\0"), CLOSE]


class SlowToOpen:
    """A bus whose device does not open before ``may_open``."""

    def __init__(self, open_deadline_s: float = LONG_S) -> None:
        self.opening, self.may_open = threading.Event(), threading.Event()
        self.device = made()
        self.device.open.side_effect = self._wait
        self.bus = ThreadedI2C("/dev/i2c-1", self.device.open, DEADLINE_S, open_deadline_s)

    def _wait(self) -> Any:
        self.opening.set()
        assert self.may_open.wait(LONG_S)
        return DEFAULT


async def test_first_opening_may_take_longer_than_a_transfer_for_all_parts_on_the_bus() -> None:
    slow = SlowToOpen()
    asyncio.get_running_loop().call_later(SLOW_S, slow.may_open.set)
    await asyncio.gather(slow.bus.write(0x15, b"\1"), slow.bus.write(0x60, b"\2"))
    await slow.bus.close()
    assert slow.device.mock_calls == [OPEN, call.write(0x15, b"\1"), call.write(0x60, b"\2"), CLOSE]


async def test_first_opening_that_a_posted_stop_began_is_waited_for_too() -> None:
    slow = SlowToOpen()
    slow.bus.post(0x15, b"\x0e")
    assert await asyncio.to_thread(slow.opening.wait, LONG_S)
    asyncio.get_running_loop().call_later(SLOW_S, slow.may_open.set)
    await slow.bus.write(0x15, b"\1")
    await slow.bus.close()
    assert slow.device.mock_calls == [OPEN, call.write(0x15, b"\x0e"), call.write(0x15, b"\1"), CLOSE]


async def test_first_opening_that_hangs_is_given_up_at_its_own_deadline() -> None:
    slow = SlowToOpen(SLOW_S)
    with pytest.raises(NotResponding, match=r"/dev/i2c-1: .* within 0\.2 s"):
        await slow.bus.write(0x15, b"\1")
    slow.may_open.set()
    await slow.bus.close()
    assert slow.device.mock_calls == [OPEN, CLOSE], "what was to be written is too late now"


@pytest.mark.parametrize("opened_at_first", [True, False])
async def test_reopening_in_a_run_holds_nobody_longer_than_a_transfer(opened_at_first: bool) -> None:
    slow = SlowToOpen()
    slow.may_open.set()
    if opened_at_first:
        slow.device.write.side_effect = oserror(errno.EIO)
    else:
        slow.device.open.side_effect = oserror(errno.ENOENT)
    with pytest.raises(NotResponding, match="errno"):
        await slow.bus.write(0x15, b"\0")
    slow.may_open.clear()
    slow.device.open.side_effect = slow._wait
    with pytest.raises(NotResponding, match=r"within 0\.1 s"):
        await slow.bus.write(0x15, b"\1")
    slow.may_open.set()
    await slow.bus.close()


async def test_error_that_is_no_failure_of_the_bus_leaves_the_device_open() -> None:
    bus, device = i2c()
    device.write.side_effect = [ValueError("a bug of a driver"), None]
    with pytest.raises(ValueError, match="a bug"):
        await bus.write(0x15, b"\0")
    await bus.write(0x15, b"\0")
    await bus.close()
    assert device.mock_calls == [OPEN, *[call.write(0x15, b"\0")] * 2, CLOSE]


def test_error_of_linux_names_what_to_look_for_and_one_without_a_known_cause_is_told_as_it_is() -> None:
    assert explain(oserror(errno.EREMOTEIO)) == f"no acknowledgement [errno {errno.EREMOTEIO}]"
    assert "No space" in explain(oserror(errno.ENOSPC))
    assert explain(OSError("no frame")) == "no frame"
    assert explain(TimeoutError()) == "TimeoutError"


async def test_posted_writes_open_the_device_if_need_be_may_fail_and_go_out_before_the_bus_closes() -> None:
    bus, device = i2c()
    device.write.side_effect = [oserror(errno.EREMOTEIO), None]
    bus.post(0x15, b"\x0e\x00")
    bus.post(0x15, b"\x0e\x00")
    await bus.close()
    assert device.mock_calls == [OPEN, call.write(0x15, b"\x0e\x00"), CLOSE] * 2
