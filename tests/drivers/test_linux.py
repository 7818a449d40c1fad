"""A Linux board's buses: what becomes of what they do, in whatever time that takes, and pyserial itself over a pty.

The libraries of I2C and SPI at work are in ``test_real_libraries.py``; here smbus2's stand-in is late or refuses.
"""

from __future__ import annotations

import asyncio
import errno
import os
import pty
import select
import sys
import threading
import tty
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.simhal.clearing import steady_world
from wayfarer.drivers.buses import CLOSE_WAIT_S, Frame
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import WheelCommand
from wayfarer.simhal.chips.sabertooth import SabertoothChip

WIDTH, HEIGHT, STRIDE = 60, 40, 64
LONG_S = 5.0  # a test that needs as long has failed


class Calls:
    """What was asked of a library."""

    def __init__(self) -> None:
        self.made: list[tuple[Any, ...]] = []

    def note(self, *what: Any) -> None:
        self.made.append(what)

    @property
    def names(self) -> list[str]:
        return [what[0] for what in self.made]


@pytest.fixture
def calls() -> Calls:
    return Calls()


@pytest.fixture
async def buses() -> AsyncIterator[LinuxBuses]:
    """A board's buses; closed at the end of the test, if not by it."""
    made = LinuxBuses()
    yield made
    await made.close()


# -- I2C through smbus2 ------------------------------------------------------------------------------------------------


@pytest.fixture
def smbus(monkeypatch: pytest.MonkeyPatch, calls: Calls) -> Calls:
    pytest.importorskip("smbus2")

    class SMBus:
        def __init__(self, path: str) -> None:
            calls.note("open", path)

        def i2c_rdwr(self, *messages: Any) -> None:
            calls.note("write")

        def close(self) -> None:
            calls.note("close")

    monkeypatch.setattr("smbus2.SMBus", SMBus)
    return calls


async def test_parts_on_one_bus_share_it(buses: LinuxBuses, smbus: Calls) -> None:
    assert buses.i2c("/dev/i2c-1") is buses.i2c("/dev/i2c-1")
    assert buses.i2c("/dev/i2c-0") is not buses.i2c("/dev/i2c-1")
    await buses.close()
    assert smbus.made == [], "nothing is touched before it is used"


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
        f"{link}: leads to /dev/null, which is no SPI device, such as /dev/spidev0.1; "
        "correct its name in the rover file"
    )
    assert await said_of_spi(buses, "/dev/spidev123456789.0") == (
        "/dev/spidev123456789.0: no SPI device, such as /dev/spidev0.1; correct its name in the rover file"
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


# -- the camera through picamera2 ------------------------------------------------------------------------------------


class FakeCamera:
    """picamera2.Picamera2, as far as it is used."""

    calls: Calls
    luma: NDArray[np.uint8]
    fails_with: Exception | None = None
    start_fails_with: Exception | None = None
    frame_fails_with: Exception | None = None

    def __init__(self, number: int) -> None:
        self.calls.note("open", number)
        if self.fails_with is not None:
            raise self.fails_with

    def create_video_configuration(self, **configuration: Any) -> dict[str, Any]:
        return configuration

    def configure(self, configuration: dict[str, Any]) -> None:
        self.calls.note("configure", configuration)

    def start(self) -> None:
        self.calls.note("start")
        if self.start_fails_with is not None:
            raise self.start_fails_with

    def capture_request(self, wait: float) -> FakeCamera:
        self.calls.note("capture")
        return self

    def make_array(self, name: str) -> NDArray[np.uint8]:
        if self.frame_fails_with is not None:
            raise self.frame_fails_with
        assert name == "lores"
        return self.luma

    def release(self) -> None:
        self.calls.note("release")

    def close(self) -> None:
        self.calls.note("close")


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch, calls: Calls) -> type[FakeCamera]:
    """A camera whose lines are padded, above the chroma planes of YUV420."""
    padded = np.full((HEIGHT * 3 // 2, STRIDE), 255, np.uint8)
    padded[:HEIGHT, :WIDTH] = np.arange(WIDTH, dtype=np.uint8)

    class Camera(FakeCamera):
        luma = padded

    Camera.calls = calls
    monkeypatch.setitem(sys.modules, "picamera2", SimpleNamespace(Picamera2=Camera))
    return Camera


async def picture(buses: LinuxBuses, number: str = "0", rate_hz: float = 10.0, exposure_us: int | None = None) -> Frame:
    camera = buses.camera(number, width=WIDTH, height=HEIGHT, rate_hz=rate_hz, exposure_us=exposure_us)
    return await camera.frame()


async def test_frame_is_the_luma_without_padding_and_chroma_and_is_our_own(
    buses: LinuxBuses, camera: type[FakeCamera]
) -> None:
    frame = await picture(buses, "1", exposure_us=8000)
    await buses.close()
    assert frame.luma.shape == (HEIGHT, WIDTH)
    assert frame.luma.max() == WIDTH - 1
    assert not np.shares_memory(frame.luma, camera.luma), "the library uses its buffer again"
    assert camera.calls.names == ["open", "configure", "start", "capture", "release", "close"]
    (_, number), (_, configuration), *_ = camera.calls.made
    assert number == 1
    assert configuration["lores"] == {"size": (WIDTH, HEIGHT), "format": "YUV420"}
    assert configuration["controls"] == {
        "FrameDurationLimits": (100_000, 100_000),
        "ExposureTime": 8000,
        "AnalogueGain": 1.0,
    }


async def test_exposure_is_left_to_the_camera_where_none_is_given(buses: LinuxBuses, camera: type[FakeCamera]) -> None:
    await picture(buses, rate_hz=20.0)
    await buses.close()
    assert camera.calls.made[1][1]["controls"] == {"FrameDurationLimits": (50_000, 50_000)}


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (IndexError("list index out of range"), "no camera is connected"),
        (RuntimeError("Camera __init__ sequence did not complete."), "another program has it open"),
    ],
)
async def test_camera_that_does_not_open_is_told_as_a_part_that_does_not_answer(
    buses: LinuxBuses, camera: type[FakeCamera], error: Exception, text: str
) -> None:
    camera.fails_with = error
    with pytest.raises(NotResponding, match=f"camera 0: .*({text})"):
        await picture(buses)


async def test_camera_that_does_not_start_is_let_go_and_can_be_tried_again(
    buses: LinuxBuses, camera: type[FakeCamera]
) -> None:
    camera.start_fails_with = RuntimeError("Camera did not start properly.")
    device = buses.camera("0", width=WIDTH, height=HEIGHT, rate_hz=10.0, exposure_us=None)
    with pytest.raises(NotResponding, match="does not start: Camera did not"):
        await device.frame()
    assert camera.calls.names[-1] == "close"
    camera.start_fails_with = None
    assert (await device.frame()).luma.shape == (HEIGHT, WIDTH)


@pytest.mark.parametrize("error", [TimeoutError(), OSError(errno.EIO, "")])
async def test_frame_is_given_back_to_the_camera_whatever_happens(
    buses: LinuxBuses, camera: type[FakeCamera], error: Exception
) -> None:
    camera.frame_fails_with = error
    with pytest.raises(NotResponding, match="camera 0"):
        await picture(buses)
    await buses.close()
    assert camera.calls.names[-3:] == ["capture", "release", "close"]


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
    said = r"/dev/[\w-]+99(\.1)?: no such device file: enable the interface with sudo raspi-config \[errno 2\]"
    with pytest.raises(NotResponding, match=said):
        await USES[library](buses)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(NotResponding, match=rf"{library}.*pip install '\.\[pi\]'"):
        await USES[library](buses)


async def test_bus_that_does_not_close_keeps_no_other_open(
    buses: LinuxBuses, smbus: Calls, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: object) -> None:
        smbus.note("close")
        raise OSError(errno.EIO, "")

    monkeypatch.setattr("smbus2.SMBus.close", refuse)
    await buses.i2c("/dev/i2c-0").write(0x15, b"\0")
    await buses.i2c("/dev/i2c-1").write(0x15, b"\0")
    await buses.close()
    assert smbus.names[-2:] == ["close", "close"]


async def test_buses_are_closed_at_once_and_none_is_waited_for_beyond_the_time_given(
    buses: LinuxBuses, camera: type[FakeCamera]
) -> None:
    all_hang, freed = threading.Barrier(9), threading.Event()

    def hang(self: FakeCamera, wait: float) -> FakeCamera:
        all_hang.wait(LONG_S)
        assert freed.wait(LONG_S)
        return self

    camera.capture_request = hang  # type: ignore[method-assign]
    pictures = [asyncio.create_task(picture(buses, number)) for number in "01234567"]
    await asyncio.to_thread(all_hang.wait, LONG_S)
    began_s = asyncio.get_running_loop().time()
    await buses.close()
    assert asyncio.get_running_loop().time() - began_s < 4 * CLOSE_WAIT_S
    freed.set()
    await asyncio.gather(*pictures)


async def test_camera_may_take_longer_to_start_than_for_a_frame(
    buses: LinuxBuses, camera: type[FakeCamera], monkeypatch: pytest.MonkeyPatch
) -> None:
    def start_late(_: FakeCamera) -> None:
        threading.Event().wait(0.2)

    monkeypatch.setattr(camera, "start", start_late)
    monkeypatch.setattr("wayfarer.drivers.linux.FRAME_DEADLINE_S", 0.1)
    await picture(buses)
    await buses.close()
    assert camera.calls.names[-2:] == ["release", "close"]
