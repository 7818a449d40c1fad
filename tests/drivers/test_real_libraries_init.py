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

from tests.commissioning.computers import BODY
from tests.drivers.private_dev import NoMounts, PrivateDev
from tests.drivers.real_site import I2C, SERIAL, SPI, RealSite, real_site
from tests.system.subprocesses import WAYFARER
from wayfarer.config.rover_file import load_rover

pytestmark = pytest.mark.process

BY_ID = "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0"
NEITHER = f"""{BODY}
[safety]
start_delay_s = 10.0
[parts.compass]
driver = "cmps14"
address = 0x62
[parts.motors]
driver = "sabertooth"
port = "/dev/ttyAMA0"
"""


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


@pytest.mark.long
@pytest.mark.parametrize("version", ["installed"], scope="session")
def test_rover_of_neither_kind(shim: Path, libraries: Path, bench: Path, tmp_path: Path) -> None:
    """A compass at another address, a motor board at an adapter, and a person who fills in the rest."""
    own = tmp_path / "neither.toml"
    own.write_text(NEITHER, encoding="utf-8")
    with mounts_or_skip(), real_site(str(own), libraries, shim, bench) as site:
        site.dev.link(BY_ID, site.line.path)  # another name of the same port, which comes first
        written = site.folder / "otter.toml"
        done = site.run("init", written)
        assert done.returncode == 0, done.stderr
        found = load_rover(str(written))
        assert (found.name, found.parts["compass"]["address"]) == ("otter", 0x62)
        assert found.parts["motors"]["port"] == BY_ID
        assert judged(site, written) == ["motion", "deadman proved"], "it has a flow sensor in its file only"
        text = written.read_text(encoding="utf-8")
        motion = text[text.index("[parts.motion]") : text.index("[parts.motors]")]
        text = text.replace(motion, '[parts.contact]\ndriver = "bumper"\nfront = 5\n\n')
        written.write_text('anomaly_source = "contact"\n' + text, encoding="utf-8")
        site.environment["GPIOZERO_PIN_FACTORY"] = "mock"
        assert judged(site, written) == ["deadman proved"]


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
