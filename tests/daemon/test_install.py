"""Installing the service: whole files, nobody's work overwritten, and refusals that say what to do."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import CompletedProcess
from tempfile import TemporaryDirectory

import pytest

from wayfarer.config.rover_file import load_rover, rover_text
from wayfarer.config.rover_path import SCHEMA
from wayfarer.daemon import install
from wayfarer.errors import BadConfig, BadInput, UnknownName

UNIT = "etc/systemd/system/wayfarer.service"
ROVER_FILE = "etc/wayfarer/rover.toml"


def environment(folder: Path) -> Path:
    """An environment that has wayfarer; returns its interpreter."""
    folder.mkdir(parents=True)
    for name in ("python", "wayfarer"):
        (folder / name).write_text("#!/bin/sh\n", encoding="utf-8")
        (folder / name).chmod(0o755)
    return folder / "python"


@pytest.fixture
def python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The interpreter of an environment that the service's user can reach, as pytest's own folders are not."""
    monkeypatch.setattr(install, "OWN_FOLDERS", ())
    return environment(tmp_path / "opt/wayfarer/bin")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A mounted card."""
    etc = tmp_path / "card/etc"
    etc.mkdir(parents=True)
    (etc / "group").write_text("root:x:0:\nspi:x:989:\ni2c:x:990:pi\nspies:x:1:\n", encoding="utf-8")
    (etc / "passwd").write_text("root:x:0:0:root:/root:/bin/bash\n", encoding="utf-8")
    return tmp_path / "card"


@pytest.fixture
def given(root: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The commands given while the card plays the running system, and no command does anything."""
    commands: list[list[str]] = []

    def give(command: tuple[str, ...], **_: object) -> CompletedProcess[str]:
        commands.append(list(command))
        return CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(install, "HERE", root)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(subprocess, "run", give)
    return commands


@pytest.fixture
def umask() -> Iterator[Callable[[int], int]]:
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


def installed(root: Path, python: Path, rover: str | None = "sim") -> list[str]:
    """Install the service, and return what was said."""
    said: list[str] = []
    install.install(rover, root, python, said.append)
    return said


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


def settings(unit: str) -> dict[str, list[str]]:
    """The settings of a unit, without sections and comments."""
    found: dict[str, list[str]] = {}
    for line in unit.splitlines():
        if line and line[0] not in "#[":
            key, value = line.split("=", 1)
            found.setdefault(key, []).append(value)
    return found


def test_unit_starts_this_installation(root: Path, python: Path) -> None:
    unit = settings(install.unit_text(root, python))
    command = python.parent / "wayfarer"
    assert unit["ExecStart"] == [
        f"{command} run --rover /etc/wayfarer/rover.toml --log-dir /var/lib/wayfarer/field_logs"
    ]
    assert unit["ExecStopPost"] == [f"-{command} stop-motors --rover /etc/wayfarer/rover.toml"]
    assert "@" not in "".join(value for key in unit if key != "SystemCallFilter" for value in unit[key])
    assert unit["SupplementaryGroups"] == ["i2c spi"], "those that exist there"
    assert "PrivateDevices" not in unit, "parts are not hidden from the service"
    assert {"char-i2c rw", "char-spi rw", "char-gpiochip rw", "char-video4linux rw"} <= set(unit["DeviceAllow"])
    assert (unit["MemoryMax"], unit["Restart"]) == (["50%"], ["on-failure"])
    without_groups = settings(install.unit_text(root / "none", python))
    assert without_groups["SupplementaryGroups"] == [""]


def test_install_writes_unit_and_rover_file_and_says_what_is_next(
    root: Path, python: Path, given: list[list[str]]
) -> None:
    said = installed(root, python)
    assert (root / UNIT).read_text(encoding="utf-8") == install.unit_text(root, python)
    assert load_rover(str(root / ROVER_FILE)) == load_rover("sim")
    assert any("systemctl enable --now wayfarer" in line for line in said)
    assert sorted(path.name for path in root.rglob("*") if path.is_file()) == [
        "group", "passwd", "rover.toml", "wayfarer.service",
    ]  # fmt: skip


def test_on_a_card_only_files_are_written_and_the_rest_is_to_be_done_there(
    root: Path, python: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("a command was given to the host"))
    said = installed(root, python)
    text, command = "\n".join(said), python.parent / "wayfarer"
    assert f"the unit starts {command}: wayfarer must be installed at that path" in text
    assert f"sudo {command} install-service" in text
    assert "systemctl" not in text
    assert not (root / "var").exists()


@pytest.mark.parametrize(
    ("groups", "joins"), [("spi:x:989:\ni2c:x:990:pi\n", ["--groups", "i2c,spi"]), ("root:x:0:\n", [])]
)
def test_user_is_made_with_the_groups_there_are(
    root: Path, python: Path, given: list[list[str]], groups: str, joins: list[str]
) -> None:
    (root / "etc/group").write_text(groups, encoding="utf-8")
    installed(root, python)
    (made,) = [command for command in given if command[0] == "useradd"]
    assert made[made.index("/usr/sbin/nologin") + 1 :] == [*joins, "wayfarer"]


@pytest.mark.parametrize(
    ("i2c", "commands"),
    [("pi", [["usermod", "--append", "--groups", "i2c", "wayfarer"]]), ("pi,wayfarer", [])],
)
def test_user_who_is_there_is_added_to_the_groups_that_he_lacks(
    root: Path, python: Path, given: list[list[str]], i2c: str, commands: list[list[str]]
) -> None:
    (root / "etc/passwd").write_text("wayfarer:x:990:990::/var/lib/wayfarer:/usr/sbin/nologin\n", encoding="utf-8")
    (root / "etc/group").write_text(f"i2c:x:990:{i2c}\nspi:x:989:wayfarer\n", encoding="utf-8")
    installed(root, python)
    assert [command for command in given if command[0].startswith("user")] == commands


def test_command_that_fails_is_told_in_one_line(
    root: Path, python: Path, given: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = CompletedProcess((), 1, "", "useradd: cannot lock /etc/passwd;\ntry again later.\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(BadInput, match=r"^useradd --system .* try again later\.$"):
        installed(root, python)


def test_files_and_folders_can_be_read_by_the_service_whatever_the_umask(
    root: Path, python: Path, given: list[list[str]], umask: Callable[[int], int]
) -> None:
    """The folder for calibration and logs is there before the first start."""
    umask(0o077)
    installed(root, python)
    folder = root / "var/lib/wayfarer"
    assert {mode(root / file) for file in (UNIT, ROVER_FILE)} == {0o644}
    assert {mode(each) for each in ((root / UNIT).parent, (root / ROVER_FILE).parent, folder)} == {0o755}
    assert given[-3] == ["chown", "--recursive", "--no-dereference", "wayfarer:wayfarer", str(folder)]


def test_rover_file_may_be_ones_own(root: Path, python: Path, tmp_path: Path) -> None:
    installed(root, python)
    own = tmp_path / "mine.toml"
    own.write_text((root / ROVER_FILE).read_text(encoding="utf-8").replace('"sim"', '"mine"'), encoding="utf-8")
    (root / ROVER_FILE).unlink()
    installed(root, python, str(own))
    assert load_rover(str(root / ROVER_FILE)).name == "mine"


def test_existing_rover_file_is_kept(root: Path, python: Path) -> None:
    installed(root, python)
    calibrated = (root / ROVER_FILE).read_text(encoding="utf-8") + "# calibrated in the yard\n"
    (root / ROVER_FILE).write_text(calibrated, encoding="utf-8")
    said = installed(root, python)
    assert (root / ROVER_FILE).read_text(encoding="utf-8") == calibrated
    assert f"kept {root / ROVER_FILE}" in said


@pytest.mark.parametrize(
    ("rover", "error", "text"),
    [(None, BadInput, "--rover"), ("simm", UnknownName, "sim"), ("/no/such.toml", BadConfig, "no such file")],
)
def test_without_a_usable_rover_nothing_is_written(
    root: Path, python: Path, rover: str | None, error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        installed(root, python, rover)
    assert not (root / UNIT).exists()
    assert not (root / ROVER_FILE).exists()


def test_rover_file_that_is_there_and_unusable_is_told_at_once(root: Path, python: Path) -> None:
    (root / ROVER_FILE).parent.mkdir()
    (root / ROVER_FILE).write_text("nonsense", encoding="utf-8")
    with pytest.raises(BadConfig, match="not valid TOML"):
        installed(root, python, None)


@pytest.mark.parametrize(("asked", "remedy"), [("test", "namei -l"), ("--version", "/opt/wayfarer")])
def test_what_the_service_s_user_could_not_do_is_told_and_nothing_is_enabled(
    root: Path, python: Path, given: list[list[str]], monkeypatch: pytest.MonkeyPatch, asked: str, remedy: str
) -> None:
    def give(command: list[str], **_: object) -> CompletedProcess[str]:
        return CompletedProcess(command, int(asked in command), "", "")

    monkeypatch.setattr(subprocess, "run", give)
    with pytest.raises(BadInput, match=f"the user 'wayfarer' could not do this: .*{asked}.*{remedy}"):
        installed(root, python)
    assert not (root / UNIT).exists()


@pytest.mark.process
@pytest.mark.skipif(os.geteuid() != 0, reason="only root can try what another user may")
@pytest.mark.parametrize(("closed", "to"), [(None, 0), ("rover.toml", 0o600), ("etc", 0o750), ("bin", 0o700)])
def test_what_the_service_s_user_may_is_tried(monkeypatch: pytest.MonkeyPatch, closed: str | None, to: int) -> None:
    monkeypatch.setattr(install, "USER", "nobody")
    with TemporaryDirectory(dir="/tmp") as folder:
        there = Path(folder)
        executable = environment(there / "bin").with_name("wayfarer")
        rover_file = there / "etc/rover.toml"
        rover_file.parent.mkdir()
        rover_file.touch(0o644)
        for each in (there, there / "etc", there / "bin"):
            each.chmod(0o755)
        if closed is None:
            install.try_as_user(rover_file, executable)
            return
        (rover_file if closed == "rover.toml" else there / closed).chmod(to)
        with pytest.raises(BadInput, match="/bin/wayfarer" if closed == "bin" else "rover.toml"):
            install.try_as_user(rover_file, executable)


def test_interrupted_writing_leaves_the_old_unit(root: Path, python: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed(root, python)
    (root / UNIT).write_text("the old unit", encoding="utf-8")

    def fail(file_number: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(BadInput, match="No space left on device"):
        installed(root, python, None)
    assert (root / UNIT).read_text(encoding="utf-8") == "the old unit"


def test_installing_into_the_running_system_needs_root(python: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(BadInput, match="run it with sudo"):
        installed(Path("/"), python)


def test_service_of_the_debian_package_is_not_hidden(root: Path, python: Path) -> None:
    packaged = root / "usr/lib/systemd/system/wayfarer.service"
    packaged.parent.mkdir(parents=True)
    packaged.touch()
    with pytest.raises(BadInput, match="the Debian package has installed the service"):
        installed(root, python)
    assert not (root / "etc/wayfarer").exists()


def test_environment_without_the_command_is_refused(root: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such command"):
        install.unit_text(root, tmp_path / "python")


@pytest.mark.parametrize("folder", ["my rover", "100%", "a$b", 'a"b', "grün"])
def test_path_that_systemd_would_read_otherwise_is_refused(tmp_path: Path, folder: str) -> None:
    with pytest.raises(BadInput, match="without spaces or signs"):
        install.unit_text(tmp_path, environment(tmp_path / folder))


def test_environment_that_the_service_cannot_see_is_refused(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(install, "OWN_FOLDERS", (tmp_path,))
    with pytest.raises(BadInput, match="install into /opt/wayfarer"):
        install.unit_text(root, environment(tmp_path / "venv/bin"))


def test_rover_file_is_read_once(root: Path, python: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file that is installed is the one that was checked, even if its owner changes it meanwhile."""
    path, read = tmp_path / "mine.toml", []

    def text(name: str) -> str:
        read.append(name)
        return rover_text("sim")

    monkeypatch.setattr(install, "rover_text", text)
    installed(root, python, str(path))
    assert read == [str(path)]
    installed_text = (root / ROVER_FILE).read_text(encoding="utf-8")
    assert installed_text == rover_text("sim").replace("./rover.schema.json", str(SCHEMA)), "where an editor finds it"
