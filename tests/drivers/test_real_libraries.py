"""smbus2, spidev, pyserial and gpiozero themselves, at their oldest allowed versions and at those of this Python.

Below the first three are device files of a private /dev, and simulated chips; gpiozero has a mock of the pins itself.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.drivers.private_dev import Recorder
from tests.drivers.real_site import I2C, SPI, RealSite, each_forestrover, each_site, oldest_versions
from tests.system.hil_buses import SOCKET_VARIABLE

pytestmark = pytest.mark.process

WHICH = """
import json
from importlib import import_module
from importlib.metadata import version
modules = {"smbus2": "smbus2", "spidev": "spidev", "pyserial": "serial", "gpiozero": "gpiozero"}
print(json.dumps({name: [version(name), import_module(module).__file__] for name, module in modules.items()}))
"""
EACH_PART = """
import asyncio, json, sys
from wayfarer.config.factory import assemble
from wayfarer.config.rover_file import load_rover
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.hal import WheelCommand

async def main():
    buses = LinuxBuses()
    rover = assemble(load_rover(sys.argv[1]), buses)
    for part in rover.parts.values():
        await part.open()
    await rover.motion.read()  # the first after the opening says nothing
    heading_deg, quality = (await rover.compass.read()).heading_deg, (await rover.motion.read()).quality
    driven = await rover.motors.drive(WheelCommand(0.5, -0.25))
    await rover.motors.stop()
    await buses.close()
    print(json.dumps({"heading_deg": heading_deg, "quality": quality, "driven": [*driven]}))

asyncio.run(main())
"""
TRANSFERS = f"""
import asyncio
from wayfarer.drivers.linux import LinuxBuses

async def main():
    buses = LinuxBuses()
    bus = buses.i2c("{I2C}")
    await bus.write(0x15, b"\\x0e\\x00")
    assert await bus.write_read(0x60, b"\\0", 3) == b"\\1\\2\\3"
    assert await bus.write_then_read(0x15, b"\\x99", 2) == b"\\1\\2"
    device = buses.spi("{SPI}", mode=3, speed_hz=400_000)
    assert await device.transfer(b"\\x00\\x00", b"\\x16") == (b"\\1\\2", b"\\1")
    await buses.close()

asyncio.run(main())
"""
SPI_SETTINGS = """
import asyncio, json, sys
from spidev import SpiDev
from wayfarer.drivers.linux import LinuxBuses

async def main():
    buses = LinuxBuses()
    await buses.spi(sys.argv[1], mode=3, speed_hz=400_000).transfer(b"\\x00\\x00")
    other = SpiDev()
    other.open(0, 1)
    print(json.dumps([other.mode, other.max_speed_hz, other.bits_per_word]))
    await buses.close()

asyncio.run(main())
"""


def said_by(done: subprocess.CompletedProcess[str]) -> Any:
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@each_forestrover
def test_libraries_are_those_that_were_asked_for(site: RealSite, version: str, libraries: Path) -> None:
    found = said_by(site.run_python("-c", WHICH))
    assert all(Path(file).is_relative_to(libraries) for _, file in found.values())
    if version == "oldest":
        assert [f"{name}=={number}" for name, (number, _) in found.items()] == oldest_versions()


@each_site
def test_each_part_of_a_shipped_rover_works(site: RealSite) -> None:
    found = said_by(site.run_python("-c", EACH_PART, site.config))
    assert abs((found["heading_deg"] + 180.0) % 360.0 - 180.0) < 10.0, "the rover stands facing north"
    assert found["quality"] > 0.0
    assert found["driven"] == pytest.approx([0.5, -0.25], abs=0.01)
    assert found["driven"] in [[pytest.approx(left), pytest.approx(right)] for _, left, right in site.commands()]


@each_forestrover
def test_transfers_go_out_as_the_parts_need_them(site: RealSite) -> None:
    """A repeated start or a stop between write and read, and chip select low for each piece by itself."""
    with Recorder(site.folder / "recorder") as recorder:
        site.environment |= {SOCKET_VARIABLE: str(site.folder / "recorder")}
        done = site.run_python("-c", TRANSFERS)
    site.environment |= {SOCKET_VARIABLE: str(site.bench_socket)}
    assert done.returncode == 0, done.stderr
    i2c, spi = {"do": "i2c", "bus": I2C}, {"do": "spi", "bus": SPI}
    assert recorder.requests == [
        i2c | {"address": 0x15, "count": 0, "data": ["0e00"]},
        i2c | {"address": 0x60, "count": 3, "data": ["00"]},
        i2c | {"address": 0x15, "count": 0, "data": ["99"]},
        i2c | {"address": 0x15, "count": 2, "data": []},
        spi | {"data": ["0000"]},
        spi | {"data": ["16"]},
    ]


@each_forestrover
@pytest.mark.parametrize("device", [SPI, "/dev/flow"])
def test_spi_device_gets_its_mode_and_speed_by_its_own_name_or_that_of_a_link(site: RealSite, device: str) -> None:
    if device != SPI:
        site.dev.link(device, SPI)
    assert said_by(site.run_python("-c", SPI_SETTINGS, device)) == [3, 400_000, 8]


def test_parts_at_gpio_pins_work(oldest: Path) -> None:
    """Their own tests, which are over gpiozero's mock of the pins, run with this Python's anyway."""
    folder = Path(__file__).parent
    modules = [folder / f"test_{name}.py" for name in ("gpio", "gpio_motors")]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n0", *modules],
        env=os.environ | {"PYTHONPATH": str(oldest)}, cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert "skipped" not in done.stdout, "gpiozero is there"
