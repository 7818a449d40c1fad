"""Installing the systemd service: what ``wayfarer install-service`` does.

It writes two files: the unit, from the template ``systemd/wayfarer.service``, and the rover file that the service uses,
which it never overwrites. Both appear whole or not at all. On the running system (root ``/``) it also makes the user
that the service runs as. It starts nothing: the next commands are printed, for a person to give.
"""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path

import wayfarer
from wayfarer.config import load_rover
from wayfarer.errors import BadInput

UNIT = Path("etc/systemd/system/wayfarer.service")
ROVER_FILE = Path("etc/wayfarer/rover.toml")
USER = "wayfarer"
# Own the device files on Raspberry Pi OS (its udev rules; dialout is Debian's for serial ports): hardware.md 7.
GROUPS = ("i2c", "spi", "gpio", "video", "dialout")
OWN_FOLDERS = (Path("/tmp"), Path("/var/tmp"))  # PrivateTmp= in the unit

NEXT_STEPS = """\
next:
  sudo systemctl daemon-reload
  sudo systemctl enable --now wayfarer    # starts now and at each boot, always disarmed
  systemctl status wayfarer
  journalctl -u wayfarer -f"""


def unit_text(root: Path = Path("/"), python: Path = Path(sys.executable)) -> str:
    """Return the unit for this installation, with those of the device groups that exist below ``root``.

    Args:
        root: of the system that will run the service.
        python: the interpreter of the environment that has wayfarer; its ``wayfarer`` command is what the unit starts.

    Raises:
        BadInput: there is no such command, or the service's user could not reach it.
    """
    executable = python.parent / "wayfarer"
    if not os.access(executable, os.X_OK):
        raise BadInput(f"{executable}: no such command; install wayfarer into the environment of {python} first")
    if not re.fullmatch(r"[\w/.+@-]+", str(executable), re.ASCII):
        raise BadInput(f"{executable}: a unit file cannot name such a path plainly; choose one without blanks or signs")
    check_reachable(executable, python)
    return _template().replace("@WAYFARER@", str(executable)).replace("@GROUPS@", " ".join(_groups(root)))


def install(
    rover: str | None = None, root: Path = Path("/"), python: Path = Path(sys.executable),
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
    if root == Path("/") and os.geteuid() != 0:
        raise BadInput("install-service writes below /etc and makes a user: run it with sudo, or see it with --print")
    unit = unit_text(root, python)
    try:
        say(_place_rover_file(rover, root / ROVER_FILE))
        say(_make_user(root))
        _write_whole(root / UNIT, unit)
    except OSError as error:
        raise BadInput(f"{error.filename or root}: cannot be written: {error.strerror}") from None
    say(f"wrote {root / UNIT}")
    say(NEXT_STEPS)


def check_reachable(executable: Path, python: Path) -> None:
    """Refuse what would end in a bare "Permission denied" or "No such file" in the journal.

    Raises:
        BadInput: the service's user could not run the command, or its interpreter; the text says where instead.
    """
    if any(executable.is_relative_to(folder) for folder in OWN_FOLDERS):
        raise BadInput(f"{executable}: the service has its own /tmp and cannot see this; install into /opt/wayfarer")
    for path in (executable, python.resolve()):
        for step in (path, *path.parents):
            if not step.stat().st_mode & stat.S_IXOTH:
                raise BadInput(
                    f"{path}: the user '{USER}' could not run it, because {step} is closed to others; "
                    "install into an environment such as /opt/wayfarer, made with the distribution's python3"
                )


def _template() -> str:
    """Return the one true template: in the package where it is installed, beside it in a checkout."""
    shipped = files("wayfarer") / "wayfarer.service"
    if shipped.is_file():
        return shipped.read_text(encoding="utf-8")
    return (Path(wayfarer.__file__).parents[1] / "systemd" / "wayfarer.service").read_text(encoding="utf-8")


def _names(path: Path) -> Iterator[str]:
    """Return the names in a file like /etc/group or /etc/passwd."""
    if path.is_file():
        yield from (line.split(":", 1)[0] for line in path.read_text(encoding="utf-8").splitlines())


def _groups(root: Path) -> list[str]:
    """Return the device groups that there are."""
    known = set(_names(root / "etc/group"))
    return [name for name in GROUPS if name in known]


def _place_rover_file(rover: str | None, path: Path) -> str:
    """Copy the chosen rover file, unless there is one: calibration and thresholds in it are somebody's work."""
    if path.exists():
        load_rover(str(path))  # a file that cannot be used is better told now than at the next start
        return f"kept {path}"
    if rover is None:
        raise BadInput(f"{path}: no such file yet; say which rover this is with --rover NAME|FILE")
    load_rover(rover)
    shipped = files("wayfarer") / "rovers" / f"{rover}.toml"
    text = shipped.read_text(encoding="utf-8") if shipped.is_file() else Path(rover).read_text(encoding="utf-8")
    _write_whole(path, text)
    return f"wrote {path} (from {rover})"


def _make_user(root: Path) -> str:
    """Make the user that the service runs as; on a mounted card only say how.

    The unit gives the service its groups; the user has them too, so that ``sudo -u wayfarer wayfarer check`` sees what
    the service sees.
    """
    if USER in _names(root / "etc/passwd"):
        return f"user '{USER}' exists"
    command = ["useradd", "--system", "--user-group", "--no-create-home", "--home-dir", "/var/lib/wayfarer",
               "--shell", "/usr/sbin/nologin", "--groups", ",".join(_groups(root)), USER]  # fmt: skip
    if root != Path("/"):
        return f"user '{USER}' is missing there; on that system give: sudo {' '.join(command)}"
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    if made.returncode != 0:
        raise BadInput(f"user '{USER}' could not be made: {' '.join(made.stderr.split())}")
    return f"made user '{USER}'"


def _write_whole(path: Path, text: str) -> None:
    """Write a file so that it is there whole or not at all, even if the power fails."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(path.name + ".new")
    with draft.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
