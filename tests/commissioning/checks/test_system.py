"""Device files, groups, power, disk and clock, over a tree of system files of their own."""

from __future__ import annotations

import errno
import os
import pwd
import shutil
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.kit.rover import Rig
from wayfarer.commissioning.checks import CheckVerdict, Finding, system
from wayfarer.config.rover_file import LogSettings, load_rover
from wayfarer.fieldlog.folders import ADVICE


def look_at_device(rig: Rig, name: str) -> Finding:
    return rig.look(partial(system.device, name))


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("/dev/i2c-7", "sudo raspi-config nonint do_i2c 0 && sudo reboot"),
        ("/dev/spidev0.0", "sudo raspi-config nonint do_spi 0 && sudo reboot"),
        ("/dev/serial0", "do_serial_hw 0"),
        ("/dev/ttyAMA0", "on a Pi 5: dtparam=uart0=on"),
        ("/dev/serial/by-id/usb-x", "plug it in"),
        ("/dev/ttyUSB0", "plug it in"),
        ("/dev/gpiochip9", "ls /dev/gpio*"),
        ("/dev/strange", "correct its name"),
    ],
)
def test_a_missing_device_file_names_the_step_that_makes_it(rig: Rig, name: str, remedy: str) -> None:
    finding = look_at_device(rig, name)
    assert finding.verdict is CheckVerdict.FAIL
    assert finding.text.startswith("is not there; ")
    assert remedy in finding.remedy


@pytest.mark.parametrize(("name", "group"), [("/dev/i2c-1", "i2c"), ("/dev/spidev0.1", "spi")])
def test_a_forbidden_device_file_names_its_group_and_the_user_who_lacks_access(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, name: str, group: str
) -> None:
    """Under sudo -u the shell's $USER is somebody else; in a container the user may have a number and no name."""
    assert look_at_device(rig, name).verdict is CheckVerdict.OK
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    monkeypatch.setattr(pwd, "getpwuid", lambda uid: SimpleNamespace(pw_name="rover"))
    finding = look_at_device(rig, name)
    assert finding.verdict is CheckVerdict.FAIL
    assert finding.remedy.startswith(f"sudo usermod -aG {group} rover, ")
    monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
    assert f"usermod -aG {group} {os.geteuid()}, " in look_at_device(rig, name).remedy


@pytest.mark.parametrize(("leads_to", "verdict"), [("ttyAMA10", CheckVerdict.WARN), ("ttyAMA0", CheckVerdict.OK)])
def test_a_port_that_is_the_debug_connector_of_a_pi_5_is_a_warning(
    rig: Rig, leads_to: str, verdict: CheckVerdict
) -> None:
    (rig.host.path("/dev") / leads_to).touch()
    rig.host.path("/dev/serial0").symlink_to(leads_to)
    finding = look_at_device(rig, "/dev/serial0")
    assert finding.verdict is verdict
    assert ("/dev/ttyAMA0 in the rover file" in finding.remedy) is (verdict is CheckVerdict.WARN)


def test_forestrovers_port_is_on_the_header_of_its_pi_5() -> None:
    assert load_rover("forestrover").parts["motors"]["port"] == "/dev/ttyAMA0"


@pytest.mark.parametrize(
    ("flags", "verdict", "found"),
    [
        ("0\n", CheckVerdict.OK, "no under-voltage"),
        ("50005", CheckVerdict.FAIL, "under-voltage now"),
        ("0x1", CheckVerdict.FAIL, "under-voltage now"),
        ("50000", CheckVerdict.WARN, "since boot"),
        ("8", CheckVerdict.WARN, "slowed down"),
        ("20000", CheckVerdict.OK, "no under-voltage"),
        ("garbage", CheckVerdict.SKIPPED, "does not report it"),
    ],
)
def test_power_is_judged_by_the_firmware_flags(rig: Rig, flags: str, verdict: CheckVerdict, found: str) -> None:
    assert rig.look(system.power).verdict is CheckVerdict.SKIPPED, "no file, no Pi"
    path = rig.host.path(system.THROTTLED)
    path.parent.mkdir(parents=True)
    path.write_text(flags, encoding="ascii")
    finding = rig.look(system.power)
    assert finding.verdict is verdict
    assert found in finding.text


def test_a_writable_log_folder_with_room_is_well_and_is_not_made(rig: Rig) -> None:
    finding = rig.look(system.disk)
    assert finding.verdict is CheckVerdict.OK
    assert "MB free" in finding.text
    assert not rig.host.log_folder.exists()


@pytest.mark.parametrize(
    ("settings", "needed_mb"),
    [(LogSettings(), 150), (LogSettings(part_mb=1, free_mb=1), 2), (LogSettings(part_mb=2, free_mb=0), 2)],
)
def test_a_part_of_a_log_must_fit_beside_what_the_log_leaves_free(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, settings: LogSettings, needed_mb: int
) -> None:
    rig.config = rig.config.model_copy(update={"log": settings})
    disk = SimpleNamespace(free=needed_mb * 1_000_000, total=1e9)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: disk)
    assert rig.look(system.disk).verdict is CheckVerdict.OK
    disk.free -= 1
    finding = rig.look(system.disk)
    assert finding.verdict is CheckVerdict.FAIL
    assert f"{needed_mb} MB are needed: free_mb ({settings.free_mb:g})" in finding.remedy


def test_a_keep_mb_that_is_larger_than_the_disk_is_a_warning(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=1e9, total=4e9))
    for keep_mb, verdict in ((3850.0, CheckVerdict.OK), (3851.0, CheckVerdict.WARN)):
        rig.config = rig.config.model_copy(update={"log": LogSettings(keep_mb=keep_mb)})
        assert rig.look(system.disk).verdict is verdict


@pytest.mark.parametrize("number", errno.errorcode, ids=errno.errorcode.get)
@pytest.mark.parametrize("call", ["open", "fsync"])
def test_a_disk_that_takes_no_file_fails_however_it_says_so_and_what_fits_it_is_told(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, call: str, number: int
) -> None:
    def fails(*_: object, **__: object) -> int:
        raise OSError(number, os.strerror(number))

    rig.host.log_folder.mkdir()
    monkeypatch.setattr(pwd, "getpwuid", lambda uid: SimpleNamespace(pw_name="rover"))
    with monkeypatch.context() as patch:
        patch.setattr(os, call, fails)
        patch.setattr(tempfile, "TMP_MAX", 10)  # names that are tried while each exists already
        finding = rig.look(system.disk)
    assert finding.verdict is CheckVerdict.FAIL
    assert f"{rig.host.log_folder} cannot be written: " in finding.text
    told = ADVICE.get(number, "sudo chown rover " if number in {errno.EACCES, errno.EPERM} else "look at the disk")
    assert finding.remedy.startswith(told)
    assert list(rig.host.log_folder.iterdir()) == []


def test_a_file_where_the_log_folder_should_be_is_told(rig: Rig) -> None:
    rig.host.log_folder.write_text("a file stands in its place", encoding="ascii")
    assert rig.look(system.disk).remedy == "a file is in the place of the folder"


def test_a_log_folder_that_may_not_be_looked_into_fails(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(path: Path) -> bool:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "exists", forbidden)
    finding = rig.look(system.disk)
    assert finding.verdict is CheckVerdict.FAIL
    assert finding.text.endswith("logs cannot be written: Permission denied")


@pytest.mark.parametrize(("t_wall", "verdict"), [(0.0, CheckVerdict.WARN), (1_795_000_000.0, CheckVerdict.OK)])
def test_a_clock_that_was_never_set_is_a_warning(rig: Rig, t_wall: float, verdict: CheckVerdict) -> None:
    rig.host = replace(rig.host, t_wall=t_wall)
    assert rig.look(system.clock).verdict is verdict
