"""Installs the systemd service: ``wayfarer install-service``.

It writes two files: the unit, from the template ``systemd/wayfarer.service``, and the rover file that the service uses,
which it never overwrites. Both appear whole or not at all, for everyone to read. On the running system (root ``/``) it
also makes the user that the service runs as, and the folder that it keeps its logs and calibration in. It starts
nothing: the next commands are printed, for a person to give.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import wayfarer
from wayfarer.config.rover_file import load_rover, parse_rover, rover_text
from wayfarer.config.rover_path import ROVER_FILE, SCHEMA_BESIDE, SCHEMA_ELSEWHERE, STATE_FOLDER
from wayfarer.errors import BadInput, one_line
from wayfarer.files import write_atomically

HERE = Path("/")
UNIT = Path("etc/systemd/system/wayfarer.service")
PACKAGED_UNIT = Path("usr/lib/systemd/system/wayfarer.service")
USER = "wayfarer"
READABLE = 0o644  # for everyone, whatever the caller's umask
# Own the device files on Raspberry Pi OS (its udev rules; dialout is Debian's for serial ports): hardware.md 7.
GROUPS = ("i2c", "spi", "gpio", "video", "dialout")
OWN_FOLDERS = (Path("/tmp"), Path("/var/tmp"))  # PrivateTmp= in the unit

NEXT_STEPS = """\
Next:
  sudo systemctl daemon-reload
  sudo systemctl enable --now wayfarer    # starts now and at each boot, always disarmed
  systemctl status wayfarer
  journalctl -u wayfarer -f"""
NEXT_STEPS_THERE = """\
the unit starts {command}: wayfarer must be installed at that path on that system
Next, on that system:
  sudo {command} install-service    # makes the user 'wayfarer' and its folder, and says what is next"""


def unit_text(root: Path = HERE, python: Path = Path(sys.executable)) -> str:
    """Return the unit for this installation, with those of the device groups that exist below ``root``.

    Args:
        root: of the system that will run the service.
        python: the interpreter of the environment that has wayfarer; its ``wayfarer`` command is what the unit starts.

    Raises:
        BadInput: there is no such command, or the service could not see it.
    """
    executable = python.parent / "wayfarer"
    if not os.access(executable, os.X_OK):
        raise BadInput(f"{executable}: no such command; install wayfarer into the environment of {python} first")
    if not re.fullmatch(r"[\w/.+@-]+", str(executable), re.ASCII):
        raise BadInput(f"{executable}: a unit file cannot hold this path unquoted; choose one without spaces or signs")
    if any(executable.is_relative_to(folder) for folder in OWN_FOLDERS):
        raise BadInput(f"{executable}: the service has its own /tmp and cannot see this; install into /opt/wayfarer")
    return _template().replace("@WAYFARER@", str(executable)).replace("@GROUPS@", " ".join(_groups(root)))


def install(
    rover: str | None = None, root: Path = HERE, python: Path = Path(sys.executable),
    say: Callable[[str], None] = print,
) -> None:  # fmt: skip
    """Install the service.

    Args:
        rover: a shipped rover or a TOML file; may be left out where there is a rover file already.
        root: of the system to install into: ``/``, or a mounted card.
        python: see ``unit_text``.
        say: takes each line for the person who installs.

    Raises:
        BadInput: something is missing or not allowed; no file was left half-written.
    """
    here = root == HERE
    if here and os.geteuid() != 0:
        raise BadInput("install-service writes below /etc and makes a user: run it with sudo, or see it with --print")
    if (root / PACKAGED_UNIT).exists():  # the one in /etc would hide it
        raise BadInput(
            f"{root / PACKAGED_UNIT}: the Debian package has installed the service: it needs {ROVER_FILE} and"
            " 'sudo systemctl enable --now wayfarer'; to have another installation, remove that package first"
        )
    unit, rover_file = unit_text(root, python), root / ROVER_FILE.relative_to("/")
    try:
        say(_place_rover_file(rover, rover_file))
        if here:
            say(_make_user(root))
            _make_state_folder(root / STATE_FOLDER.relative_to("/"))
            try_as_user(rover_file, python.parent / "wayfarer")
        _make_folder((root / UNIT).parent)
        write_atomically(root / UNIT, unit, mode=READABLE, follow_symlink=True)  # a masked unit stays masked
    except OSError as error:
        raise BadInput(f"{error.filename or root}: cannot be written: {error.strerror}") from None
    say(f"wrote {root / UNIT}")
    say(NEXT_STEPS if here else NEXT_STEPS_THERE.format(command=python.parent / "wayfarer"))


def try_as_user(rover_file: Path, executable: Path) -> None:
    """Try as the service's user what would otherwise end in a bare "Permission denied" at each start.

    Raises:
        BadInput: the user cannot read the rover file, or cannot run the command; the text says what to do.
    """
    reads = (["test", "-r", str(rover_file)], f"let others read it, and enter its folders: see namei -l {rover_file}")
    runs = (
        [str(executable), "--version"],
        "install into an environment such as /opt/wayfarer, made with the distribution's python3",
    )
    for command, remedy in (reads, runs):
        try:
            done = subprocess.run(
                ["runuser", "-u", USER, "--", *command],
                capture_output=True, check=False, cwd="/", text=True, errors="replace",
            )  # fmt: skip
        except FileNotFoundError:
            raise BadInput("runuser is missing: install util-linux, then run this again") from None
        if done.returncode != 0:
            said = f" ({one_line(done.stderr)})" if done.stderr.strip() else ""
            raise BadInput(f"the user '{USER}' could not do this: {' '.join(command)}{said}; {remedy}")


def _template() -> str:
    """Return the one true template: in the package where it is installed, beside it in a checkout."""
    shipped = files("wayfarer") / "wayfarer.service"
    if shipped.is_file():
        return shipped.read_text(encoding="utf-8")
    return (Path(wayfarer.__file__).parents[1] / "systemd" / "wayfarer.service").read_text(encoding="utf-8")


def _entries(path: Path) -> dict[str, list[str]]:
    """Return the fields of a file like /etc/group or /etc/passwd, by name."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return {fields[0]: fields[1:] for fields in (line.split(":") for line in lines)}


def _groups(root: Path) -> list[str]:
    """Return the device groups that there are."""
    known = _entries(root / "etc/group")
    return [name for name in GROUPS if name in known]


def _place_rover_file(rover: str | None, path: Path) -> str:
    """Copy the chosen rover file, unless there is one already: its settings must not be lost."""
    if path.exists():
        load_rover(str(path))  # a file that cannot be used is better told now than at the next start
        return f"kept {path}"
    if rover is None:
        raise BadInput(f"{path}: no such file yet; say which rover this is with --rover NAME|FILE")
    text = rover_text(rover)
    parse_rover(rover, text)  # the text that is installed is the one that was checked
    _make_folder(path.parent)
    text = text.replace(SCHEMA_BESIDE, SCHEMA_ELSEWHERE, 1)
    write_atomically(path, text, mode=READABLE, follow_symlink=True)
    return f"wrote {path} (from {rover})"


def _make_user(root: Path) -> str:
    """Make the user that the service runs as, or add it to the device groups that it lacks.

    The unit gives the service its groups; the user has them too, so that ``sudo -u wayfarer wayfarer check`` sees what
    the service sees.
    """
    groups = _entries(root / "etc/group")
    lacks = ",".join(name for name in _groups(root) if USER not in groups[name][-1].split(","))
    joins = ["--groups", lacks] if lacks else []
    if USER not in _entries(root / "etc/passwd"):
        _run_command("useradd", "--system", "--user-group", "--no-create-home", "--home-dir", str(STATE_FOLDER),
              "--shell", "/usr/sbin/nologin", *joins, USER)  # fmt: skip
        return f"made user '{USER}'"
    if lacks:
        _run_command("usermod", "--append", *joins, USER)
        return f"added user '{USER}' to {lacks}"
    return f"user '{USER}' exists"


def _make_state_folder(folder: Path) -> None:
    """Make the service's folder as the unit does: ``check`` and ``calibrate`` come before the service's first start.

    What root left in it becomes the user's too, because the unit sees to the folder alone.
    """
    _make_folder(folder)
    folder.chmod(0o755)
    _run_command("chown", "--recursive", "--no-dereference", f"{USER}:{USER}", str(folder))


def _run_command(*command: str) -> None:
    """Run a command; what it writes to stderr is the reason if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BadInput(f"{' '.join(command)}: {one_line(done.stderr)}")


def _make_folder(path: Path) -> None:
    """Make a folder, and those above it, for everyone to enter, independent of the caller's umask."""
    if not path.is_dir():
        _make_folder(path.parent)
        path.mkdir()
        path.chmod(0o755)
