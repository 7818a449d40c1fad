"""``wayfarer install-service``: writes the service's unit, if no Debian package has brought it."""

from __future__ import annotations

import grp
import os
import re
import sys
from importlib.resources import files
from pathlib import Path

import wayfarer
from wayfarer.config.rover_path import ROVER_FILE, STATE_FOLDER
from wayfarer.errors import BadInput
from wayfarer.files import write_atomically

UNIT = Path("/etc/systemd/system/wayfarer.service")
PACKAGED_UNIT = Path("/usr/lib/systemd/system/wayfarer.service")
# Own the device files on Raspberry Pi OS, by its udev rules; dialout is Debian's for serial ports.
GROUPS = ("i2c", "spi", "gpio", "video", "dialout")
OWN_FOLDERS = (Path("/tmp"), Path("/var/tmp"))  # PrivateTmp= in the unit
MAKE_USER = (
    f"sudo useradd --system --user-group --home-dir {STATE_FOLDER} --shell /usr/sbin/nologin --groups '%s' wayfarer"
    f" && sudo install -d -o wayfarer -g wayfarer {STATE_FOLDER}"
)
START = "sudo systemctl enable --now wayfarer"


def unit_text(python: Path = Path(sys.executable)) -> str:
    """Return the unit for this installation, with those of the device groups that exist here.

    Args:
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
    shipped = files("wayfarer") / "wayfarer.service"  # in a checkout it is beside the package
    template = shipped if shipped.is_file() else Path(wayfarer.__file__).parents[1] / "systemd" / "wayfarer.service"
    text = template.read_text(encoding="utf-8")
    return text.replace("@WAYFARER@", str(executable)).replace("@GROUPS@", " ".join(_groups()))


def install(python: Path = Path(sys.executable)) -> str:
    """Write the unit, and return what is to be done next, by a person: this starts nothing and makes no user.

    Raises:
        BadInput: as ``unit_text``, or the unit cannot be written, or the Debian package's would be hidden by it.
    """
    if PACKAGED_UNIT.exists():
        raise BadInput(
            f"{PACKAGED_UNIT}: the Debian package has installed the service: it needs {ROVER_FILE} and '{START}';"
            " to have another installation, remove that package first"
        )
    try:
        write_atomically(UNIT, unit_text(python), mode=0o644, follow_symlink=True)  # a masked unit stays masked
    except OSError as error:
        raise BadInput(
            f"{UNIT}: cannot be written: {error.strerror}; run this with sudo, or see the unit with --print"
        ) from None
    made = MAKE_USER % ",".join(_groups())
    return f"wrote {UNIT}; the service reads {ROVER_FILE}\nNext, the first command once only:\n  {made}\n  {START}"


def _groups() -> list[str]:
    known = {group.gr_name for group in grp.getgrall()}
    return [name for name in GROUPS if name in known]
