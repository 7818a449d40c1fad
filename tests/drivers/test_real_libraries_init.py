"""``wayfarer init`` through the real smbus2, spidev and pyserial: the file that it writes passes ``check``.

A computer with nothing on it is a /dev without device files.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.drivers.private_dev import NoMounts, PrivateDev
from tests.drivers.real_site import I2C, SERIAL, SPI, RealSite
from tests.system.subprocesses import WAYFARER
from wayfarer.config.rover_file import load_rover

pytestmark = pytest.mark.process


@pytest.mark.long
@pytest.mark.parametrize(
    ("version", "rover"), [("installed", "forestrover"), ("installed", "minirover")], scope="session"
)
def test_file_of_a_rover_passes_its_check(site: RealSite) -> None:
    written = site.folder / "found.toml"
    done = site.run("init", written)
    assert done.returncode == 0, done.stderr
    board = "ThunderBorg at 0x15 on /dev/i2c-1" if site.rover == "minirover" else f"serial port {SERIAL}"
    for part in (f"CMPS14 firmware 7 at 0x60 on {I2C}", f"PMW3901 on {SPI}", board):
        assert f"found   {part}" in done.stdout
    found, shipped = load_rover(str(written)), load_rover(site.rover)
    assert found.parts["motors"].items() >= shipped.parts["motors"].items()
    assert found.parts["motion"]["driver"] == "pmw3901", "which the shipped minirover has not"
    assert found.vehicle == shipped.vehicle
    assert judged(site, written) == ([] if site.rover == "minirover" else ["deadman proved"])


def judged(site: RealSite, rover: Path) -> list[str]:
    """What ``check`` finds wrong. Nobody has seen the deadman of a board that cannot report it: that must be."""
    done = site.run("check", "--json", "--rover", rover, "--log-dir", site.logs)
    return [each["name"] for each in json.loads(done.stdout)["findings"] if each["verdict"] == "fail"]


@contextmanager
def mounts_or_skip() -> Iterator[None]:
    try:
        yield
    except NoMounts as error:
        pytest.skip(f"no private /dev can be mounted here: {error}")


def test_computer_with_nothing_on_it(shim: Path, tmp_path: Path) -> None:
    (tmp_path / "dev").mkdir()
    with mounts_or_skip():
        dev = PrivateDev(tmp_path / "dev")
    try:
        done = subprocess.run(
            [*dev.enter, *WAYFARER, "init", tmp_path / "rover.toml"],
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            env=os.environ | {"RUNTIME_DIRECTORY": str(tmp_path)},
        )
    finally:
        dev.close()
    assert done.returncode == 0, done.stderr
    for place in (
        "/dev/i2c-*",
        "/dev/spidev*",
        "serial ports: /dev/serial/by-id/*",
        "cameras: ",
    ):
        assert place in done.stdout
    assert load_rover(str(tmp_path / "rover.toml")).vehicle == load_rover("forestrover").vehicle
