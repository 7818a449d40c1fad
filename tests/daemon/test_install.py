"""Installing the service: one whole file, nobody's work overwritten, and refusals that say what to do."""

from __future__ import annotations

import grp
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from wayfarer.daemon import install
from wayfarer.errors import BadInput, NotThereYet


def environment(folder: Path) -> Path:
    """An environment that has wayfarer; returns its interpreter."""
    folder.mkdir(parents=True)
    for name in ("python", "wayfarer"):
        (folder / name).write_text("#!/bin/sh\n", encoding="utf-8")
        (folder / name).chmod(0o755)
    return folder / "python"


@pytest.fixture
def python(tmp_path: Path) -> Path:
    """The interpreter of an environment that the service's user can reach, as pytest's own folders are not."""
    return environment(tmp_path / "opt/wayfarer/bin")


@pytest.fixture(autouse=True)
def unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the unit is written; this computer has no such package, and three groups."""
    (tmp_path / "system").mkdir()
    monkeypatch.setattr(install, "UNIT", tmp_path / "system/wayfarer.service")
    monkeypatch.setattr(install, "PACKAGED_UNIT", tmp_path / "packaged.service")
    monkeypatch.setattr(install, "OWN_FOLDERS", ())
    groups = [SimpleNamespace(gr_name=name) for name in ("root", "spi", "i2c", "spies")]
    monkeypatch.setattr(grp, "getgrall", lambda: groups)
    return install.UNIT


def settings(unit: str) -> dict[str, list[str]]:
    """The settings of a unit, without sections and comments."""
    found: dict[str, list[str]] = {}
    for line in unit.splitlines():
        if line and line[0] not in "#[":
            key, value = line.split("=", 1)
            found.setdefault(key, []).append(value)
    return found


def test_unit_starts_this_installation(python: Path) -> None:
    unit = settings(install.unit_text(python))
    command = python.parent / "wayfarer"
    assert unit["ExecStart"] == [
        f"{command} run --rover /etc/wayfarer/rover.toml --log-dir /var/lib/wayfarer/field_logs"
    ]
    assert unit["ExecStopPost"] == [f"-{command} stop-motors --rover /etc/wayfarer/rover.toml"]
    assert "@" not in "".join(value for key in unit if key != "SystemCallFilter" for value in unit[key])
    assert unit["SupplementaryGroups"] == ["i2c spi"], "those that exist here"
    assert "PrivateDevices" not in unit, "parts are not hidden from the service"
    assert {"char-i2c rw", "char-spi rw", "char-gpiochip rw", "char-video4linux rw"} <= set(unit["DeviceAllow"])
    assert (unit["MemoryMax"], unit["Restart"]) == (["50%"], ["on-failure"])


def test_unit_is_started_again_for_as_long_as_a_slow_boot_takes_but_not_for_bad_input(python: Path) -> None:
    unit = settings(install.unit_text(python))
    (burst,), (pause,), (interval,) = unit["StartLimitBurst"], unit["RestartSec"], unit["StartLimitIntervalSec"]
    minutes = int(interval.removesuffix("min"))
    assert int(burst) * float(pause) >= 300.0, "also if each start fails at once"
    assert int(burst) * (float(pause) + 10.0) <= 60.0 * minutes, "it ends, also if a start and its stop take 10 s"
    assert unit["RestartPreventExitStatus"] == [str(BadInput.exit_code)]
    assert NotThereYet.exit_code != BadInput.exit_code


def test_unit_is_written_for_all_to_read_and_two_commands_are_said(python: Path, unit: Path) -> None:
    before = os.umask(0o077)
    try:
        said = install.install(python)
    finally:
        os.umask(before)
    assert unit.read_text(encoding="utf-8") == install.unit_text(python)
    assert unit.stat().st_mode & 0o777 == 0o644
    make_user, start = [line.strip() for line in said.splitlines() if line.startswith("  ")]
    assert make_user == (
        "sudo useradd --system --user-group --home-dir /var/lib/wayfarer --shell /usr/sbin/nologin --groups 'i2c,spi'"
        " wayfarer && sudo install -d -o wayfarer -g wayfarer /var/lib/wayfarer"
    )
    assert start == "sudo systemctl enable --now wayfarer"
    assert "/etc/wayfarer/rover.toml" in said


def test_interrupted_writing_leaves_the_old_unit(python: Path, unit: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unit.write_text("the old unit", encoding="utf-8")

    def fail(file_number: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(BadInput, match="No space left on device"):
        install.install(python)
    assert unit.read_text(encoding="utf-8") == "the old unit"


def test_masked_unit_stays_masked(python: Path, unit: Path) -> None:
    unit.symlink_to("/dev/null")
    with pytest.raises(BadInput, match="is left as it is"):
        install.install(python)
    assert unit.is_symlink()


def test_folder_that_only_root_may_write_is_told(python: Path, monkeypatch: pytest.MonkeyPatch, unit: Path) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(install, "write_atomically", refuse)
    with pytest.raises(BadInput, match=r"Permission denied; run this with sudo, or see the unit with --print"):
        install.install(python)


def test_service_of_the_debian_package_is_not_hidden(python: Path, unit: Path) -> None:
    install.PACKAGED_UNIT.touch()
    with pytest.raises(BadInput, match="the Debian package has installed the service"):
        install.install(python)
    assert not unit.exists()


def test_environment_without_the_command_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such command"):
        install.unit_text(tmp_path / "python")


@pytest.mark.parametrize("folder", ["my rover", "100%", "a$b", 'a"b', "grün"])
def test_path_that_systemd_would_read_otherwise_is_refused(tmp_path: Path, folder: str) -> None:
    with pytest.raises(BadInput, match="without spaces or signs"):
        install.unit_text(environment(tmp_path / folder))


def test_environment_that_the_service_cannot_see_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(install, "OWN_FOLDERS", (tmp_path,))
    with pytest.raises(BadInput, match="install into /opt/wayfarer"):
        install.unit_text(environment(tmp_path / "venv/bin"))
