"""The buses of a Raspberry Pi or another Linux board: smbus2, spidev, pyserial, picamera2 and gpiozero.

Each library is imported when a bus of its kind is used for the first time.
"""

from __future__ import annotations

import asyncio
import errno
import re
import select
import warnings
from collections.abc import Callable
from functools import partial
from importlib import import_module
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from wayfarer.drivers.buses import CLOSE_WAIT_S, Frame
from wayfarer.drivers.threaded import LIBRARIES, Threaded, ThreadedI2C, ThreadedSerial, ThreadedSPI
from wayfarer.errors import NotInstalled, kind_and_text

if TYPE_CHECKING:
    import numpy
    from numpy.typing import NDArray

# Long enough for a restart of libcamera and for a long exposure; the detector responds to a frame's age much earlier.
FRAME_DEADLINE_S = 3.0
CAMERA_OPEN_DEADLINE_S = 10.0  # picamera2 imports much, and libcamera first looks for all cameras
MAIN_SIZE = (640, 480)  # lores may not exceed the main stream (picamera2)
_INPUT_BYTES = 4096  # Linux keeps 4095 at most for a terminal
_SPI_FILE = re.compile(r"/dev/spidev(\d{1,4})\.(\d{1,4})")  # of bus and chip select, as spidev opens it

B = TypeVar("B", bound=Threaded[Any])


class LinuxBuses:
    """Implements ``buses.Buses``; names are device files."""

    def __init__(self) -> None:
        self._open: dict[str, Threaded[Any]] = {}

    def i2c(self, name: str) -> ThreadedI2C:
        """Return an I2C bus, such as ``/dev/i2c-1``."""
        return self._once(name, lambda: ThreadedI2C(name, partial(SMBusDevice, name)))

    def spi(self, name: str, *, mode: int, speed_hz: int) -> ThreadedSPI:
        """Return a device on an SPI bus, such as ``/dev/spidev0.1``."""
        return self._once(name, lambda: ThreadedSPI(name, partial(SpiDevice, name, mode, speed_hz)))

    def serial(self, name: str, *, baud: int) -> ThreadedSerial:
        """Return a serial port, such as ``/dev/serial0``; two names of one device give the same port."""
        return self._once(realpath(name), lambda: ThreadedSerial(name, partial(SerialDevice, name, baud)))

    def camera(self, name: str, *, width: int, height: int, rate_hz: float, exposure_us: int | None) -> ThreadedCamera:
        """Return a camera of libcamera, by number."""
        opener = partial(LibCamera, int(name), (width, height), rate_hz, exposure_us)
        deadlines_s = FRAME_DEADLINE_S, CAMERA_OPEN_DEADLINE_S
        return self._once(f"camera {name}", lambda: ThreadedCamera(f"camera {name}", opener, *deadlines_s))

    def pins(self) -> GpiozeroPins:
        """Return the pins, through gpiozero."""
        return GpiozeroPins()

    async def close(self, wait_s: float = CLOSE_WAIT_S) -> None:
        """Release all buses at once; a thread that has not ended after ``wait_s`` ends later, or with the process."""
        await asyncio.gather(*(bus.close(wait_s) for bus in self._open.values()))
        self._open.clear()

    def _once(self, name: str, make: Callable[[], B]) -> B:
        """Return the bus of that name, made at the first call: parts on one bus share its thread."""
        if name not in self._open:
            self._open[name] = make()
        bus: B = self._open[name]  # type: ignore[assignment]
        return bus


class SMBusDevice:
    """An I2C bus through smbus2; implements ``threaded.BlockingI2C``."""

    def __init__(self, path: str) -> None:
        from smbus2 import SMBus, i2c_msg

        self._bus = SMBus(path)
        self._message = i2c_msg

    def write(self, address: int, data: bytes) -> None:
        """Write bytes."""
        self._bus.i2c_rdwr(self._message.write(address, data))

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, repeated start, read, as one combined transfer."""
        answer = self._message.read(address, count)
        self._bus.i2c_rdwr(self._message.write(address, data), answer)
        return bytes(answer)

    def write_then_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, stop, read: two transfers."""
        self.write(address, data)
        answer = self._message.read(address, count)
        self._bus.i2c_rdwr(answer)
        return bytes(answer)

    def close(self) -> None:
        """Close the device file."""
        self._bus.close()


class SpiDevice:
    """An SPI device through spidev; implements ``threaded.BlockingSPI``."""

    def __init__(self, path: str, mode: int, speed_hz: int) -> None:
        from spidev import SpiDev

        self._device = SpiDev()
        self._device.open(*_spi_numbers(path))  # its open_path came with 3.8; Debian 12 has 3.6
        self._device.mode = mode
        self._device.max_speed_hz = speed_hz

    def transfer(self, pieces: tuple[bytes, ...]) -> tuple[bytes, ...]:
        """Exchange pieces; ``xfer2`` keeps chip select low for the whole of each and releases the GIL."""
        return tuple(bytes(self._device.xfer2(list(piece))) for piece in pieces)

    def close(self) -> None:
        """Close the device file."""
        self._device.close()


def _spi_numbers(path: str) -> tuple[int, int]:
    """Return bus and chip select of an SPI device file; links are followed.

    Raises:
        OSError: it is not an SPI device file.
    """
    file = str(Path(path).resolve())
    if not (numbers := _SPI_FILE.fullmatch(file)):
        what = "not an SPI device" if file == path else f"leads to {file}, which is not an SPI device"
        raise OSError(f"{what}, such as /dev/spidev0.1; correct its name in the rover file")
    return int(numbers[1]), int(numbers[2])


class SerialDevice:
    """A serial port through pyserial; implements ``threaded.BlockingSerial``."""

    def __init__(self, path: str, baud: int) -> None:
        from serial import Serial

        self._port = Serial(path, baud, timeout=0, write_timeout=1.0)

    def write(self, data: bytes) -> None:
        """Write bytes."""
        self._port.write(data)

    def forget_input(self) -> None:
        """Throw away what has come."""
        self._port.read(_INPUT_BYTES)  # ``reset_input_buffer`` raises termios.error, which is not an OSError

    def read(self, count: int, wait_s: float) -> bytes:
        """Return what has come, at most ``count`` bytes, as soon as there is any; a port that is gone raises."""
        came: bytes = self._port.read(count) if select.select([self._port], [], [], wait_s)[0] else b""
        return came

    def close(self) -> None:
        """Close the device file."""
        self._port.close()


class GpiozeroPins:
    """The GPIO pins through gpiozero, whose devices these are; its pin library (lgpio) comes from the distribution."""

    def output(self, pin: int, *, pwm_hz: float | None = None, active_high: bool = True) -> Any:
        """Claim an output."""
        if pwm_hz is None:
            return self._device("DigitalOutputDevice", pin, active_high=active_high)
        return self._device("PWMOutputDevice", pin, active_high=active_high, frequency=pwm_hz)

    def input(self, pin: int, *, pull_up: bool) -> Any:
        """Claim an input."""
        return self._device("DigitalInputDevice", pin, pull_up=pull_up)

    def _device(self, name: str, pin: int, **details: Any) -> Any:
        gpiozero = import_module("gpiozero")
        with warnings.catch_warnings():
            # gpiozero warns in two lines of each missing pin library; if all are missing, its error says so.
            for expected in (gpiozero.PinFactoryFallback, gpiozero.NativePinFactoryFallback):
                warnings.simplefilter("ignore", expected)
            return getattr(gpiozero, name)(pin, **details)


def _picamera2() -> Any:
    try:
        from picamera2 import Picamera2
    except ImportError:
        raise
    except Exception as error:  # its own libraries raise others if they do not fit each other
        raise ImportError(kind_and_text(error), name="picamera2") from None
    return Picamera2


def connected_cameras() -> list[str]:
    """Return the models of the connected cameras, by number, as libcamera lists them; none is opened.

    Raises:
        NotInstalled: picamera2 cannot be imported.
    """
    try:
        return [str(each.get("Model", "camera")) for each in _picamera2().global_camera_info()]
    except ImportError as error:
        raise NotInstalled("cameras", error, LIBRARIES) from None


class LibCamera:
    """A camera through picamera2, running.

    The small second ("lores") stream is YUV420, whose first rows are the luma; lines are padded to a stride.
    """

    def __init__(self, number: int, size: tuple[int, int], rate_hz: float, exposure_us: int | None) -> None:
        Picamera2 = _picamera2()  # noqa: N806 - a class
        self._width, self._height = size
        try:
            self._camera = Picamera2(number)
        except IndexError:  # how picamera2 says that there is none (its issue 1081)
            raise OSError("no camera is connected, or its ribbon cable is loose") from None
        except RuntimeError as error:
            raise OSError(errno.EBUSY, str(error)) from None
        frame_us = round(1e6 / rate_hz)
        controls: dict[str, Any] = {"FrameDurationLimits": (frame_us, frame_us)}
        if exposure_us is not None:
            controls |= {"ExposureTime": exposure_us, "AnalogueGain": 1.0}
        try:
            self._camera.configure(
                self._camera.create_video_configuration(
                    main={"size": MAIN_SIZE}, lores={"size": size, "format": "YUV420"}, controls=controls
                )
            )
            self._camera.start()
        except RuntimeError as error:
            self.close()  # otherwise it would be busy at the next try
            raise OSError(f"the camera does not start: {error}") from None

    def luma(self) -> NDArray[numpy.uint8]:
        """Wait for the next frame and return its luma, shape (height, width)."""
        request = self._camera.capture_request(wait=FRAME_DEADLINE_S)
        try:
            luma: NDArray[numpy.uint8] = request.make_array("lores")[: self._height, : self._width].copy()
        finally:
            request.release()
        return luma

    def close(self) -> None:
        """Stop the camera."""
        self._camera.close()


class ThreadedCamera(Threaded[LibCamera]):
    """Implements ``buses.Camera``."""

    async def frame(self) -> Frame:
        """Return the next frame; its time is when it was handed over, at most a frame after it was taken."""
        luma = await self.call(LibCamera.luma)
        return Frame(asyncio.get_running_loop().time(), luma)
