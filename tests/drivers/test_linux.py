"""A Linux board's buses: what becomes of what they do, in whatever time that takes, and pyserial itself over a pty.

The libraries of I2C and SPI at work are in ``test_real_libraries.py``; here smbus2's stand-in is late or refuses.
"""

from __future__ import annotations

import asyncio
import errno
import os
import pty
import re
import select
import sys
import threading
import tty
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Self
from unittest.mock import DEFAULT, MagicMock

import numpy as np
import pytest

from tests.simhal.clearing import steady_world
from wayfarer.drivers.buses import CLOSE_WAIT_S, Frame
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.drivers.threaded import TRANSFER_DEADLINE_S
from wayfarer.errors import NotResponding
from wayfarer.hal import WheelCommand
from wayfarer.simhal.chips.motor_boards import SabertoothChip

WIDTH, HEIGHT, STRIDE = 60, 40, 64
LONG_S = 5.0  # a test that needs as long has failed


def asked(library: MagicMock) -> list[str]:
    """What a library was asked to do, in its order; making an object of it has no name."""
    return [name for name, _, _ in library.mock_calls]


@pytest.fixture
async def buses() -> AsyncIterator[LinuxBuses]:
    """A board's buses; closed at the end of the test, if not by it."""
    made = LinuxBuses()
    yield made
    await made.close()


# -- I2C through smbus2 ------------------------------------------------------------------------------------------------


@pytest.fixture
def smbus(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    pytest.importorskip("smbus2")
    library = MagicMock()
    monkeypatch.setattr("smbus2.SMBus", library)
    return library


async def test_parts_on_one_bus_share_it(buses: LinuxBuses, smbus: MagicMock) -> None:
    assert buses.i2c("/dev/i2c-1") is buses.i2c("/dev/i2c-1")
    assert buses.i2c("/dev/i2c-0") is not buses.i2c("/dev/i2c-1")
    await buses.close()
    assert asked(smbus) == [], "nothing is touched before it is used"


# -- SPI through spidev ------------------------------------------------------------------------------------------------


async def said_of_spi(buses: LinuxBuses, name: str) -> str:
    """What spidev, or what precedes it, says of a device that cannot be opened."""
    pytest.importorskip("spidev")
    with pytest.raises(NotResponding) as error:
        await buses.spi(name, mode=0, speed_hz=400_000).transfer(b"\0")
    await buses.close()
    return str(error.value)


async def test_link_to_an_spi_device_is_followed_and_another_file_is_refused(buses: LinuxBuses, tmp_path: Path) -> None:
    link = tmp_path / "flow"
    link.symlink_to("/dev/spidev99.1")
    assert "no such device file" in await said_of_spi(buses, str(link))
    link.unlink()
    link.symlink_to("/dev/null")
    assert await said_of_spi(buses, str(link)) == (
        f"{link}: leads to /dev/null, which is not an SPI device, such as /dev/spidev0.1; "
        "correct its name in the rover file"
    )
    assert await said_of_spi(buses, "/dev/spidev123456789.0") == (
        "/dev/spidev123456789.0: not an SPI device, such as /dev/spidev0.1; correct its name in the rover file"
    )


# -- serial through pyserial, over a pty -----------------------------------------------------------------------------


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """The far end of a serial line, and the name of its near end."""
    pytest.importorskip("serial")
    far, near = pty.openpty()
    tty.setraw(near)
    yield far, os.ttyname(near)
    for end in (far, near):
        os.close(end)


def received(far: int) -> bytes:
    """All that has arrived."""
    data = b""
    while select.select([far], [], [], 0.02)[0]:
        data += os.read(far, 1024)
    return data


async def test_real_serial_port_brings_packets_to_the_board_whole(buses: LinuxBuses, terminal: tuple[int, str]) -> None:
    far, near = terminal
    world = steady_world()
    chip = SabertoothChip(world, lambda: 0.0)
    motors = Sabertooth(SabertoothSettings(port=near), buses)
    await motors.open()
    for duty in (1.0, -1.0, 0.25, -0.5):
        applied = await motors.drive(WheelCommand(duty, -duty))
        chip.receive(received(far))
        assert world.commanded == pytest.approx(applied)
        assert applied.left == pytest.approx(duty, abs=0.01)
    motors.halt()
    await buses.close()
    chip.receive(received(far))
    assert world.commanded == (0.0, 0.0)
    assert chip.dropped == 0
    assert chip.settings == {14: 3}, "the deadman's packet came too"


def whole_line(came: bytes) -> int:
    """What is missing of an answer that ends with a newline."""
    return 0 if came.endswith(b"\n") else 1


class Device(threading.Thread):
    """While it is entered, what is at the far end: to each line it answers ``pieces``, with a pause before each."""

    def __init__(self, far: int, *pieces: bytes, pause_s: float = 0.0) -> None:
        super().__init__()
        self.far, self.pieces, self.pause_s, self.heard = far, pieces, pause_s, b""
        self.over = threading.Event()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.over.set()
        self.join()

    def run(self) -> None:
        while not self.over.is_set():
            if select.select([self.far], [], [], 0.01)[0]:
                self.heard += (heard := os.read(self.far, 1024))
                for piece in self.pieces if heard.endswith(b"\n") else ():
                    self.over.wait(self.pause_s)
                    os.write(self.far, piece)


async def test_answer_is_read_until_it_is_whole_and_not_beyond(buses: LinuxBuses, terminal: tuple[int, str]) -> None:
    far, near = terminal
    port = buses.serial(near, baud=9600)
    with Device(far, b"12.", b"6 V", b"\n", pause_s=0.005):
        assert await port.exchange(b"volts\n", whole_line) == b"12.6 V\n"
        assert await port.exchange(b"volts\n", lambda came: 3 - len(came)) == b"12."


async def test_what_came_unasked_is_no_answer(buses: LinuxBuses, terminal: tuple[int, str]) -> None:
    far, near = terminal
    port = buses.serial(near, baud=9600)
    await port.write(b"")  # opens it
    os.write(far, b"late answer to an earlier question\n")
    with Device(far, b"ok\n"):
        assert await port.exchange(b"?\n", whole_line) == b"ok\n"


async def test_part_that_does_not_answer_is_told_in_time_and_is_no_bus_that_hangs(
    buses: LinuxBuses, terminal: tuple[int, str]
) -> None:
    far, near = terminal
    port, time = buses.serial(near, baud=9600), asyncio.get_running_loop().time
    await port.write(b"")
    with Device(far) as device:
        began_s = time()
        with pytest.raises(NotResponding, match=f"^{near}: no complete answer within 0.03 s, nothing came$"):
            await port.exchange(b"?\n", whole_line, within_s=0.03)
        assert 0.03 <= time() - began_s < TRANSFER_DEADLINE_S
        device.pieces = (b"o",)
        with pytest.raises(NotResponding, match="only 6F came"):
            await port.exchange(b"?\n", whole_line)
        device.pieces = (b"ok\n",)
        assert await port.exchange(b"?\n", whole_line) == b"ok\n"
    assert device.heard == b"?\n" * 3


async def test_parts_on_one_port_ask_in_turn_and_silence_costs_each_its_own_time(
    buses: LinuxBuses, terminal: tuple[int, str]
) -> None:
    far, near = terminal
    port = buses.serial(near, baud=9600)
    await port.write(b"")
    with Device(far) as device:
        asking = (port.exchange(b"?\n", whole_line, within_s=60.0) for _ in range(3))
        said = await asyncio.gather(*asking, return_exceptions=True)
        assert all(re.search("no complete answer|was dropped", str(each)) for each in said), said
        device.pieces = (b"ok\n",)
        assert await asyncio.gather(*(port.exchange(b"?\n", whole_line) for _ in range(3))) == [b"ok\n"] * 3


async def test_port_that_goes_while_its_answer_is_awaited_is_told(buses: LinuxBuses) -> None:
    pytest.importorskip("serial")
    far, near = pty.openpty()
    tty.setraw(near)
    name = os.ttyname(near)
    port = buses.serial(name, baud=9600)
    await port.write(b"")
    os.close(near)
    asyncio.get_running_loop().call_later(0.02, os.close, far)
    with pytest.raises(NotResponding, match=f"^{name}: (?!no complete answer)"):
        await port.exchange(b"?\n", whole_line)


async def test_names_of_one_serial_port_give_the_same(buses: LinuxBuses, tmp_path: Path) -> None:
    (by_id := tmp_path / "usb-board").symlink_to("/dev/ttyACM0")
    port = buses.serial("/dev/ttyACM0", baud=38400)
    assert buses.serial(str(by_id), baud=38400) is port
    assert buses.serial("/dev/ttyACM1", baud=38400) is not port


async def test_port_that_is_gone_is_told_at_each_use_and_opened_once_it_is_back(
    buses: LinuxBuses, tmp_path: Path
) -> None:
    pytest.importorskip("serial")
    name = tmp_path / "by-id"
    port = buses.serial(str(name), baud=9600)
    for _ in range(2):
        far, near = pty.openpty()
        tty.setraw(near)
        name.symlink_to(os.ttyname(near))
        with Device(far, b"ok\n"):
            assert await port.exchange(b"?\n", whole_line) == b"ok\n"
        os.close(near)
        os.close(far)
        name.unlink()
        for _ in range(2):
            with pytest.raises(NotResponding, match=f"^{name}: (?!no complete answer)"):
                await port.exchange(b"?\n", whole_line)


# -- the camera through picamera2 ------------------------------------------------------------------------------------


@pytest.fixture
def picamera(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    """picamera2.Picamera2, of a camera whose lines are padded, above the chroma planes of YUV420."""
    padded = np.full((HEIGHT * 3 // 2, STRIDE), 255, np.uint8)
    padded[:HEIGHT, :WIDTH] = np.arange(WIDTH, dtype=np.uint8)
    library = MagicMock()
    library.return_value.capture_request.return_value.make_array.return_value = padded
    monkeypatch.setitem(sys.modules, "picamera2", SimpleNamespace(Picamera2=library))
    return library


async def picture(buses: LinuxBuses, number: str = "0", rate_hz: float = 10.0, exposure_us: int | None = None) -> Frame:
    camera = buses.camera(number, width=WIDTH, height=HEIGHT, rate_hz=rate_hz, exposure_us=exposure_us)
    return await camera.frame()


async def test_frame_is_the_luma_without_padding_and_chroma_and_is_our_own(
    buses: LinuxBuses, picamera: MagicMock
) -> None:
    time = asyncio.get_running_loop().time
    began_s = time()
    frame = await picture(buses, "1")
    await buses.close()
    assert began_s <= frame.t_s <= time()
    assert frame.luma.shape == (HEIGHT, WIDTH)
    assert frame.luma.max() == WIDTH - 1
    camera, request = picamera.return_value, picamera.return_value.capture_request.return_value
    assert not np.shares_memory(frame.luma, request.make_array.return_value), "the library uses its buffer again"
    picamera.assert_called_once_with(1)
    request.make_array.assert_called_once_with("lores")
    assert asked(camera)[-5:] == [
        "start", "capture_request", "capture_request().make_array", "capture_request().release", "close",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("exposure_us", "fixed"), [(8000, {"ExposureTime": 8000, "AnalogueGain": 1.0}), (None, {})], ids=["fixed", "left"]
)
async def test_camera_is_told_size_rate_and_exposure(
    buses: LinuxBuses, picamera: MagicMock, exposure_us: int | None, fixed: dict[str, object]
) -> None:
    await picture(buses, rate_hz=10.0, exposure_us=exposure_us)
    await buses.close()
    configuration = picamera.return_value.create_video_configuration.call_args.kwargs
    assert configuration["lores"] == {"size": (WIDTH, HEIGHT), "format": "YUV420"}
    assert configuration["controls"] == {"FrameDurationLimits": (100_000, 100_000)} | fixed


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (IndexError("list index out of range"), "no camera is connected"),
        (
            RuntimeError("Camera __init__ sequence did not complete."),
            "another program, or a driver of the kernel, has it",
        ),
    ],
)
async def test_camera_that_does_not_open_is_told_as_a_part_that_does_not_answer(
    buses: LinuxBuses, picamera: MagicMock, error: Exception, text: str
) -> None:
    picamera.side_effect = error
    with pytest.raises(NotResponding, match=f"camera 0: .*({text})"):
        await picture(buses)


async def test_camera_that_does_not_start_is_let_go_and_can_be_tried_again(
    buses: LinuxBuses, picamera: MagicMock
) -> None:
    picamera.return_value.start.side_effect = RuntimeError("Camera did not start properly.")
    device = buses.camera("0", width=WIDTH, height=HEIGHT, rate_hz=10.0, exposure_us=None)
    with pytest.raises(NotResponding, match="does not start: Camera did not"):
        await device.frame()
    assert asked(picamera)[-1] == "().close"
    picamera.return_value.start.side_effect = None
    assert (await device.frame()).luma.shape == (HEIGHT, WIDTH)


@pytest.mark.parametrize("error", [TimeoutError(), OSError(errno.EIO, "")])
async def test_frame_is_given_back_to_the_camera_whatever_happens(
    buses: LinuxBuses, picamera: MagicMock, error: Exception
) -> None:
    request = picamera.return_value.capture_request.return_value
    request.make_array.side_effect = error
    with pytest.raises(NotResponding, match="camera 0"):
        await picture(buses)
    await buses.close()
    request.release.assert_called_once()


async def test_missing_camera_library_is_told_with_its_package(
    buses: LinuxBuses, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "picamera2", None)
    with pytest.raises(NotResponding, match="apt install python3-picamera2"):
        await picture(buses)


USES: dict[str, Callable[[LinuxBuses], Awaitable[object]]] = {
    "smbus2": lambda buses: buses.i2c("/dev/i2c-99").write(0x15, b"\0"),
    "spidev": lambda buses: buses.spi("/dev/spidev99.1", mode=0, speed_hz=400_000).transfer(b"\0"),
    "serial": lambda buses: buses.serial("/dev/ttyUSB99", baud=9600).write(b"\0"),
}


@pytest.mark.parametrize("library", USES)
async def test_missing_device_and_missing_library_say_what_to_do(
    buses: LinuxBuses, monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    pytest.importorskip(library)
    said = r"/dev/[\w-]+99(\.1)?: no such device file \[errno 2\]; enable the interface with sudo raspi-config"
    with pytest.raises(NotResponding, match=said):
        await USES[library](buses)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(NotResponding, match=rf"{library}.*pip install 'wayfarer-rover\[pi\]'"):
        await USES[library](buses)


async def test_bus_that_does_not_close_keeps_no_other_open(buses: LinuxBuses, smbus: MagicMock) -> None:
    smbus.return_value.close.side_effect = OSError(errno.EIO, "")
    await buses.i2c("/dev/i2c-0").write(0x15, b"\0")
    await buses.i2c("/dev/i2c-1").write(0x15, b"\0")
    await buses.close()
    assert asked(smbus)[-2:] == ["().close", "().close"]


async def test_buses_are_closed_at_once_and_none_is_waited_for_beyond_the_time_given(
    buses: LinuxBuses, picamera: MagicMock
) -> None:
    all_hang, freed = threading.Barrier(9), threading.Event()

    def hang(wait: float) -> object:
        all_hang.wait(LONG_S)
        assert freed.wait(LONG_S)
        return DEFAULT

    picamera.return_value.capture_request.side_effect = hang
    pictures = [asyncio.create_task(picture(buses, number)) for number in "01234567"]
    await asyncio.to_thread(all_hang.wait, LONG_S)
    began_s = asyncio.get_running_loop().time()
    await buses.close()
    assert asyncio.get_running_loop().time() - began_s < 4 * CLOSE_WAIT_S
    freed.set()
    await asyncio.gather(*pictures)


async def test_posted_stop_has_as_long_as_close_is_given(buses: LinuxBuses, smbus: MagicMock) -> None:
    freed = threading.Event()
    smbus.return_value.i2c_rdwr.side_effect = lambda *_: freed.wait(LONG_S)
    buses.i2c("/dev/i2c-1").post(0x15, b"\x0e\0")
    asyncio.get_running_loop().call_later(2 * CLOSE_WAIT_S, freed.set)
    await buses.close(LONG_S)
    assert asked(smbus) == ["", "().i2c_rdwr", "().close"]


async def test_camera_may_take_longer_to_start_than_for_a_frame(
    buses: LinuxBuses, picamera: MagicMock, monkeypatch: pytest.MonkeyPatch
) -> None:
    picamera.return_value.start.side_effect = lambda: threading.Event().wait(0.2)
    monkeypatch.setattr("wayfarer.drivers.linux.FRAME_DEADLINE_S", 0.1)
    await picture(buses)
    await buses.close()
    assert asked(picamera)[-1] == "().close"
