"""Two programs never drive one rover's motors, whatever sockets they serve; a lock that cannot be had is nobody's."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.daemon.socket.fake_daemon import held_elsewhere, open_files
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.daemon.driven import (
    MotorsTaken,
    device_of,
    motors_device,
    motors_lock,
    other_commander,
    refuse_taken,
)
from wayfarer.daemon.socket.paths import AlreadyRunning
from wayfarer.drivers.gpio_motors import GpioMotorsSettings
from wayfarer.drivers.thunderborg import ThunderBorgSettings


@pytest.fixture
def device() -> Iterator[str]:
    """A serial port of the test's own."""
    ends = os.openpty()
    yield os.ttyname(ends[1])
    for end in ends:
        os.close(end)


def rover(motors: dict[str, object] | None, buses: str = "linux") -> RoverConfig:
    return load_rover("sim").model_copy(update={"buses": buses, "parts": {} if motors is None else {"motors": motors}})


@pytest.mark.process
def test_second_program_is_told_who_drives_and_gets_the_motors_when_that_one_was_killed(device: str) -> None:
    with held_elsewhere(motors_lock, device) as first:
        assert other_commander(device) == f"another wayfarer (process {first})"
        with pytest.raises(AlreadyRunning, match=rf"process {first}\) drives these motors \({device}\): end it"):
            motors_lock(device).__enter__()
    with motors_lock(device):
        pass


def test_lock_ends_with_its_context_and_leaves_no_file_open(device: str) -> None:
    before = open_files()
    with motors_lock(device):
        assert other_commander(device) == f"another wayfarer (process {os.getpid()})"
        with pytest.raises(MotorsTaken):
            motors_lock(device).__enter__()
        with pytest.raises(MotorsTaken, match=f"process {os.getpid()}"):
            refuse_taken(device)  # without opening it
        assert open_files() == before + 1
    refuse_taken(device)
    assert other_commander(device) is None
    assert open_files() == before


def test_kernel_that_does_not_tell_leaves_the_holder_unnamed(
    device: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("wayfarer.daemon.driven.LOCKS", tmp_path / "none")
    with motors_lock(device):
        assert other_commander(device) == "another wayfarer"


@pytest.mark.parametrize("name", [None, "/dev/no-such-device"])
def test_motors_without_a_file_have_no_lock(name: str | None) -> None:
    with motors_lock(name), motors_lock(name):
        assert other_commander(name) is None


def test_file_that_may_not_be_opened_is_the_drivers_to_tell(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError

    monkeypatch.setattr(os, "open", refuse)
    with motors_lock(device), motors_lock(device):
        assert other_commander(device) is None


def test_motors_are_locked_by_their_bus_or_port_also_where_the_file_leaves_that_to_the_driver(
    device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert motors_device(rover({"driver": "thunderborg", "bus": device})) == device
    assert motors_device(rover({"driver": "sabertooth", "port": device})) == device
    monkeypatch.setattr("pathlib.Path.is_char_device", lambda path: str(path) == "/dev/i2c-1")
    assert motors_device(rover({"driver": "thunderborg"})) == "/dev/i2c-1"


def test_no_device_no_lock(device: str) -> None:
    assert motors_device(rover(None)) is None
    assert motors_device(rover({"driver": "thunderborg", "bus": device}, buses="some:buses")) is None
    assert device_of("linux", ThunderBorgSettings(bus="/dev/no-such-bus")) is None
    assert device_of("linux", ThunderBorgSettings(bus="/proc/version")) is None
    pins = GpioMotorsSettings(left_pwm=17, left_direction=18, right_pwm=22, right_direction=23)
    assert device_of("linux", pins) is None
