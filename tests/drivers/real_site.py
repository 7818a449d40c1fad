"""A site whose daemon speaks through the real libraries: Linux's own buses, device files in a private /dev, a bench."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from tests.drivers.private_dev import PrivateDev, SerialLine
from tests.system.hil_setup import Site
from tests.system.subprocesses import WAYFARER

CHECKOUT = Path(__file__).resolve().parents[2]
# The ForestRover has all three buses, and alone a serial line; the MiniRover has its motors and its compass on one.
FORESTROVER = [("oldest", "forestrover"), ("installed", "forestrover")]
SITES = [*FORESTROVER, ("installed", "minirover")]
each_site = pytest.mark.parametrize(("version", "rover"), SITES, scope="session")
each_forestrover = pytest.mark.parametrize(("version", "rover"), FORESTROVER, scope="session")
I2C, SPI, SERIAL = "/dev/i2c-1", "/dev/spidev0.1", "/dev/ttyAMA0"


class NoRegistry(Exception):
    """The libraries cannot be had."""


def oldest_versions() -> list[str]:
    """Return the libraries of a rover's parts, as pyproject.toml has them, each at its lower bound."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [each.replace(">=", "==") for each in project["optional-dependencies"]["pi"]]


def install_oldest(folder: Path) -> Path:
    """Install the oldest libraries into a folder and return it.

    Raises:
        NoRegistry: they cannot be had.
    """
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    done = subprocess.run([*pip, "--target", folder, *oldest_versions()], capture_output=True, text=True, check=False)
    if re.search("No matching distribution|No module named pip", done.stderr):
        raise NoRegistry(done.stderr.strip().splitlines()[-1])
    assert done.returncode == 0, done.stderr
    return folder


class RealSite(Site):
    """A site whose processes see a private /dev and these libraries; the bench at its other end is the usual one.

    Args:
        folder: of its own, and short.
        rover: a rover file, ``forestrover``, or ``minirover`` with a flow chip in place of its camera, which has no
            simulated chip.
        dev: where the device files are.
        libraries: the folder of the libraries.
        shim: answers ``ioctl``.
        bench: as for ``Site``.
    """

    def __init__(self, folder: Path, rover: str, dev: PrivateDev, libraries: Path, shim: Path, bench: Path) -> None:
        self.dev = dev
        super().__init__(folder, rover, bench)
        _, _, shipped = self.config.read_text(encoding="utf-8").partition("\n")  # without the bench's own buses
        # Each sensor that falls silent stops the wheels, so that a test can see when it was noticed.
        holding = shipped.replace("start_delay_s", 'on_lost_sense = "hold"\nstart_delay_s', 1)
        assert holding != shipped
        self.config.write_text(holding, encoding="utf-8")
        self.environment |= {"LD_PRELOAD": str(shim), "PYTHONPATH": str(libraries)}
        for device in (I2C, SPI):
            dev.plug(device)
        self.plug_serial()

    def plug_serial(self) -> None:
        """Plug the serial adapter in."""
        self.line = SerialLine(self.bench_socket, SERIAL)
        self.dev.link(SERIAL, self.line.path)

    def unplug_serial(self) -> None:
        """Pull the serial adapter out."""
        self.dev.unplug(SERIAL)
        self.line.unplug()

    def start(self, *command: str | Path) -> subprocess.Popen[bytes]:
        """Start a process that sees the private /dev."""
        return super().start(*self.dev.enter, *command)

    def run(
        self, *arguments: str | Path, program: Sequence[str] = WAYFARER, **options: Any
    ) -> subprocess.CompletedProcess[str]:
        """Run a wayfarer command to its end; options as ``command``."""
        return super().run(*arguments, program=(*self.dev.enter, *program), **options)

    def run_python(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """Run Python to its end."""
        return self.run(*arguments, program=(sys.executable,))

    def end(self) -> None:
        """End all processes."""
        self.unplug_serial()
        super().end()


@contextmanager
def real_site(rover: str, libraries: Path, shim: Path, bench: Path) -> Iterator[RealSite]:
    """Give a site, and clear it away.

    Raises:
        NoMounts: no private /dev can be mounted here.
    """
    with TemporaryDirectory(prefix="wf-") as folder, TemporaryDirectory(prefix="wf-dev-") as mounts:
        dev = PrivateDev(Path(mounts))
        try:
            made = RealSite(Path(folder), rover, dev, libraries, shim, bench)
            try:
                yield made
            finally:
                made.end()
        finally:
            dev.close()
