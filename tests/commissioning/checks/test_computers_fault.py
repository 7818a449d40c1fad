"""A part that this computer cannot reach: which library, device file, permission or program it is, for every bus.

What each bus's library does at its opening is said here; the wires are well.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Awaitable, Callable
from dataclasses import replace
from functools import partial
from types import ModuleType
from typing import Any, NamedTuple

import pytest

from tests.kit.rover import Rig
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import CheckVerdict, Finding, parts, run_checks, system
from wayfarer.commissioning.checks.parts import part_failed
from wayfarer.config.registry import BUILT_IN_DRIVERS, find_driver
from wayfarer.drivers.linux import LinuxBuses, connected_cameras
from wayfarer.errors import NotInstalled, NotResponding
from wayfarer.hal import Colour


class Light:
    """A light that does not open."""

    def __init__(self, name: str) -> None:
        self.name = name

    async def open(self) -> None:
        raise NotResponding(f"{self.name}: no answer")

    async def close(self) -> None: ...

    async def show(self, colour: Colour) -> None: ...


class Bus(NamedTuple):
    """A bus: its library, what of that opens it, how it is used, its device file, and how these come to be there."""

    library: str
    opener: str
    use: Callable[[LinuxBuses], Awaitable[Any]]
    device: str
    install: str
    enable: str
    group: str


BUSES = {
    "i2c": Bus("smbus2", "SMBus", lambda buses: buses.i2c("/dev/i2c-1").write(0x15, b"\0"), "/dev/i2c-1",
               "pip install 'wayfarer-rover[pi]'", "do_i2c", "i2c"),
    "spi": Bus("spidev", "SpiDev", lambda buses: buses.spi("/dev/spidev0.1", mode=0, speed_hz=1).transfer(b"\0"),
               "/dev/spidev0.1", "pip install 'wayfarer-rover[pi]'", "do_spi", "spi"),
    "serial": Bus("serial", "Serial", lambda buses: buses.serial("/dev/serial0", baud=9600).write(b"\0"),
                  "/dev/serial0", "pip install 'wayfarer-rover[pi]'", "do_serial_hw", "dialout"),
    "camera": Bus("picamera2", "Picamera2",
                  lambda buses: buses.camera("0", width=32, height=32, rate_hz=10.0, exposure_us=None).frame(),
                  "", "apt install python3-picamera2", "", ""),
}  # fmt: skip
every_bus = pytest.mark.parametrize("bus", BUSES.values(), ids=BUSES)


async def failure_of(bus: Bus) -> NotResponding:
    buses = LinuxBuses()
    try:
        with pytest.raises(NotResponding) as failed:
            await bus.use(buses)
        return failed.value
    finally:
        await buses.close()


def finding(rig: Rig, bus: Bus, error: NotResponding, *, there: bool) -> Finding:
    """What ``check`` says of a compass on that bus, whose device file is there or not."""
    device = bus.device or "/dev/video0"
    rig.compass.name = f"part on {device}"
    path = rig.host.path(device)
    path.parent.mkdir(exist_ok=True)
    if there:
        path.touch()
    else:
        path.unlink(missing_ok=True)
    rig.host = replace(rig.host, devices=(device,))
    return part_failed(rig.inspection(), "compass", "compass", error)


def broken(name: str) -> ModuleType:
    return ModuleType(name)  # without what is imported from it


def refuses(bus: Bus, number: int) -> ModuleType:
    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    module = ModuleType(bus.library)
    opener: Any = fail
    if bus.library == "spidev":
        opener = type("SpiDev", (), {"open": fail})
    setattr(module, bus.opener, opener)
    module.i2c_msg = None  # type: ignore[attr-defined]
    return module


@every_bus
@pytest.mark.parametrize("there", [True, False], ids=["device file", "no device file"])
@pytest.mark.parametrize("missing", [True, False], ids=["missing", "broken"])
async def test_library_that_cannot_be_imported_is_told_first_with_how_to_install_it(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, bus: Bus, there: bool, missing: bool
) -> None:
    monkeypatch.setitem(sys.modules, bus.library, None if missing else broken(bus.library))
    error = await failure_of(bus)
    assert isinstance(error, NotInstalled)
    found = finding(rig, bus, error, there=there)
    assert found.verdict is CheckVerdict.FAIL
    told = f"the Python library {bus.library} is not installed" if missing else f"{bus.library} does not load"
    assert told in found.text
    assert bus.install in found.remedy
    assert "raspi-config" not in str(found)
    assert "wire" not in str(found)


@every_bus
@pytest.mark.parametrize(
    ("number", "told", "remedy"),
    [
        (errno.ENOENT, "no such device file", "raspi-config"),
        (errno.ENODEV, "no such device", "raspi-config"),
        (errno.EACCES, "permission denied", "group"),
        (errno.EPERM, "permission denied", "container"),
        (errno.EBUSY, "another program", "fuser"),
    ],
)
async def test_computer_that_refuses_a_device_is_told_apart_from_a_loose_wire(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, bus: Bus, number: int, told: str, remedy: str
) -> None:
    monkeypatch.setitem(sys.modules, bus.library, refuses(bus, number))
    error = await failure_of(bus)
    assert not isinstance(error, NotInstalled)
    found = finding(rig, bus, error, there=True)  # for what os.access tells, as in a container
    assert told in found.text
    assert remedy in found.remedy
    assert "wire" not in str(found)


@pytest.mark.parametrize("bus", [bus for bus in BUSES.values() if bus.device], ids=lambda bus: bus.library)
async def test_missing_device_file_and_a_missing_permission_name_this_bus_s_own_step(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, bus: Bus
) -> None:
    monkeypatch.setitem(sys.modules, bus.library, refuses(bus, errno.ENOENT))
    absent = finding(rig, bus, await failure_of(bus), there=False)
    assert f"{bus.device} is not there" in absent.text
    assert bus.enable in absent.remedy
    monkeypatch.setitem(sys.modules, bus.library, refuses(bus, errno.EACCES))
    forbidden = await failure_of(bus)
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert f"sudo usermod -aG {bus.group} " in finding(rig, bus, forbidden, there=True).remedy


@pytest.mark.parametrize("part", ["compass", "light"])
def test_device_file_that_cannot_be_used_is_told_once_and_its_part_is_skipped(rig: Rig, part: str) -> None:
    rig.rover = replace(rig.rover, light=Light(rig.compass.name)) if part == "light" else rig.rover
    rig.compass.dead = True
    (rig.host.root / "dev/i2c-1").unlink()
    rig.host = replace(rig.host, devices=("/dev/i2c-1",))
    look = getattr(parts, part)

    async def both() -> list[Finding]:
        return await run_checks(rig.inspection(), [partial(system.device, "/dev/i2c-1"), look])

    told, skipped = run_virtually(both())
    assert (told.verdict, told.remedy) == (CheckVerdict.FAIL, "sudo raspi-config nonint do_i2c 0 && sudo reboot")
    assert (skipped.verdict, skipped.text) == (CheckVerdict.SKIPPED, "/dev/i2c-1 cannot be used: see there")


@every_bus
async def test_part_that_does_not_answer_is_looked_for_at_its_wires(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, bus: Bus
) -> None:
    monkeypatch.setitem(sys.modules, bus.library, refuses(bus, errno.EREMOTEIO))
    error = await failure_of(bus)
    assert error.remedy == ""
    assert "loose wire" in finding(rig, bus, error, there=True).text


DRIVERS = {  # of each driver on a bus: its bus
    "bno055": "i2c", "cmps14": "i2c", "thunderborg": "i2c", "thunderborg_light": "i2c", "pmw3901": "spi",
    "sabertooth": "serial", "roboclaw": "serial", "roboclaw_wheels": "serial", "camera_motion": "camera",
}  # fmt: skip
OF_NO_BUS = {"bumper", "encoders", "gpio_light", "gpio_motors", "gpsd"}


def test_each_driver_is_on_a_bus_or_on_none() -> None:
    assert set(BUILT_IN_DRIVERS) == {*DRIVERS, *OF_NO_BUS}


@pytest.mark.parametrize("why", ["missing", "busy"])
@pytest.mark.parametrize("name", DRIVERS)
async def test_each_driver_hands_on_why_the_computer_cannot_reach_its_part(
    monkeypatch: pytest.MonkeyPatch, name: str, why: str
) -> None:
    bus, driver = BUSES[DRIVERS[name]], find_driver(name)
    monkeypatch.setitem(sys.modules, bus.library, None if why == "missing" else refuses(bus, errno.EBUSY))
    buses = LinuxBuses()
    try:
        with pytest.raises(NotInstalled if why == "missing" else NotResponding) as failed:
            settings = driver.Settings(**({"m_per_pixel": 0.001} if name == "camera_motion" else {}))
            await driver(settings, buses).open()
    finally:
        await buses.close()
    assert (bus.install if why == "missing" else "fuser") in failed.value.remedy


def test_cameras_are_not_listed_without_their_library_and_its_installation_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "picamera2", None)
    with pytest.raises(
        NotInstalled, match=r"cameras: .* picamera2 is not installed; sudo apt install python3-picamera2"
    ):
        connected_cameras()


def test_library_of_the_camera_s_library_is_told_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    class Finder:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "picamera2":
                raise ValueError("numpy.dtype size changed, may indicate binary incompatibility")

    monkeypatch.delitem(sys.modules, "picamera2", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Finder(), *sys.meta_path])
    with pytest.raises(NotInstalled, match=r"picamera2 does not load \(ValueError: numpy.dtype size changed"):
        connected_cameras()
