"""A board without a Raspberry Pi: for parts at GPIO pins, and for the real libraries of its buses."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.drivers.private_dev import NoMounts, compiled_shim, why_not
from tests.drivers.real_site import NoRegistry, RealSite, install_oldest, real_site
from tests.system.conftest import bench

__all__ = ["bench"]


@pytest.fixture(scope="module")
def board(request: pytest.FixtureRequest) -> Iterator[Any]:
    """gpiozero's own mock of the pins; a module that needs another kind of them names it in ``PIN_CLASS``."""
    gpiozero = pytest.importorskip("gpiozero")
    mock = pytest.importorskip("gpiozero.pins.mock")
    pin_class = getattr(mock, getattr(request.module, "PIN_CLASS", "MockPin"))
    gpiozero.Device.pin_factory = factory = mock.MockFactory(pin_class=pin_class)
    yield factory
    gpiozero.Device.pin_factory = None
    factory.close()


@pytest.fixture(autouse=True)
def free_pins(request: pytest.FixtureRequest) -> Iterator[None]:
    """Each test finds all pins free, whatever the one before left open."""
    yield
    if "board" in request.fixturenames:
        # gpiozero closes lost devices when they are collected: now, for it takes the lock that claiming pins holds.
        gc.collect()
        request.getfixturevalue("board").reset()


@pytest.fixture(scope="session")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What answers ``ioctl`` in a private /dev; the test skips if there can be none."""
    if (reason := why_not()) is not None:
        pytest.skip(reason)
    return compiled_shim(tmp_path_factory.mktemp("shim"))


@pytest.fixture(scope="session")
def oldest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the libraries at the oldest versions that are allowed."""
    try:
        return install_oldest(tmp_path_factory.mktemp("oldest"))
    except NoRegistry as error:
        pytest.skip(f"the oldest libraries cannot be installed here: {error}")


@pytest.fixture(scope="session")
def libraries(version: str, request: pytest.FixtureRequest) -> Path:
    """The folder of smbus2, spidev, pyserial and gpiozero: the oldest, or those of this Python, new if it is new."""
    if version == "oldest":
        folder: Path = request.getfixturevalue("oldest")
        return folder
    spidev = pytest.importorskip("spidev", reason="pip install 'wayfarer-rover[pi]' brings the parts' libraries")
    return Path(spidev.__file__).parent  # a module by itself, beside the others


@pytest.fixture(scope="module")
def site(rover: str, shim: Path, libraries: Path, bench: Path) -> Iterator[RealSite]:
    """A site of the rover for all tests of a module; they skip if no private /dev can be mounted."""
    with ExitStack() as stack:
        try:
            made = stack.enter_context(real_site(rover, libraries, shim, bench))
        except NoMounts as error:
            pytest.skip(f"no private /dev can be mounted here: {error}")
        yield made
