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

from tests.commissioning.init.rigs import BODY
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
TYPED = "yes\nsabertooth\notter\nnone\n\n\nbumper\n5\n" + 20 * "\n"  # then every default
ANSWERS = """
name = "found"
[parts.motion]
driver = "pmw3901"
[safety]
deadman_unproved_because = "its board is simulated"
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("version", "rover"), [("installed", "forestrover"), ("installed", "minirover")], scope="session"
)
def test_file_of_a_rover_passes_its_check(site: RealSite) -> None:
    answers, written = site.folder / "answers.toml", site.folder / "found.toml"
    answers.write_text(ANSWERS, encoding="utf-8")
    done = site.run("init", "--yes", "--answers", answers, written)
    assert done.returncode == 0, done.stderr
    board = "ThunderBorg at 0x15 on /dev/i2c-1" if site.rover == "minirover" else f"serial port {SERIAL}"
    for part in (f"CMPS14 firmware 7 at 0x60 on {I2C}", f"PMW3901 on {SPI}", board):
        assert f"found   {part}" in done.stderr
    found, shipped = load_rover(str(written)), load_rover(site.rover)
    assert found.parts["motors"].items() >= shipped.parts["motors"].items()
    assert found.vehicle == shipped.vehicle
    done = site.run("check", "--json", "--rover", written, "--log-dir", site.logs)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["passed"]


@pytest.mark.long
@pytest.mark.parametrize("version", ["installed"], scope="session")
def test_rover_of_neither_kind(shim: Path, libraries: Path, bench: Path, tmp_path: Path) -> None:
    """A compass at another address, a motor board at an adapter, switches, and a person who types."""
    own = tmp_path / "neither.toml"
    own.write_text(NEITHER, encoding="utf-8")
    with mounts_or_skip(), real_site(str(own), libraries, shim, bench) as site:
        site.dev.link(BY_ID, site.line.path)  # another name of the same port, which comes first
        done = site.run("init", site.folder / "found.toml", input=TYPED)
        assert done.returncode == 0, done.stderr
        found = load_rover(str(site.folder / "found.toml"))
        assert (found.name, found.anomaly_source, set(found.parts)) == (
            "otter",
            "contact",
            {"compass", "contact", "motors"},
        )
        assert (found.parts["compass"]["address"], found.parts["motors"]["port"]) == (0x62, BY_ID)
        site.environment["GPIOZERO_PIN_FACTORY"] = "mock"
        done = site.run("check", "--json", "--rover", site.folder / "found.toml", "--log-dir", site.logs)
    failed = [each["name"] for each in json.loads(done.stdout)["findings"] if each["verdict"] == "fail"]
    assert failed == ["deadman proved"], "which a person must see"


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
            input="yes\nno\n",
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            env=os.environ | {"RUNTIME_DIRECTORY": str(tmp_path)},
        )
    finally:
        dev.close()
    assert done.returncode == 1, done.stderr
    for place in (
        "/dev/i2c-*",
        "/dev/spidev*",
        "serial ports: /dev/serial/by-id/*",
        "cameras: ",
        "pins: no /dev/gpiochip*",
    ):
        assert place in done.stderr
    assert not (tmp_path / "rover.toml").exists()
