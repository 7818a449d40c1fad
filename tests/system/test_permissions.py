"""Device files that the user may not open: the check names the group that could give them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

NOBODY = 65534
DEVICES = {"/dev/i2c-1": "i2c", "/dev/spidev0.1": "spi", "/dev/ttyAMA0": "dialout", "/dev/gpiochip0": "gpio"}
# What `wayfarer check` asks of each device file, under another root, as another user where this one is root.
LOOK = """
import os, sys
from pathlib import Path
from wayfarer.commissioning.checks.api import HostEnvironment
from wayfarer.commissioning.checks.system import diagnose
root, user, *devices = sys.argv[1:]
if os.geteuid() == 0:
    os.setgroups([])
    os.setuid(int(user))
for device in devices:
    print(diagnose(HostEnvironment(Path("logs"), Path("calibration"), (), 0.0, Path(root)), device))
"""


@pytest.fixture
def root() -> Iterator[Path]:
    """A tree of device files that nobody may open; ``tmp_path`` would be closed to another user."""
    with TemporaryDirectory(prefix="wf-") as folder:
        Path(folder).chmod(0o755)
        for device in DEVICES:
            file = Path(folder) / device.lstrip("/")
            file.parent.mkdir(exist_ok=True)
            file.touch()
            file.chmod(0)
        yield Path(folder)


def test_user_without_rights_is_told_which_group_has_them(root: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOOK, root, str(NOBODY), *DEVICES], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for group, said in zip(DEVICES.values(), done.stdout.splitlines(), strict=True):
        assert f"group '{group}'" in said
        assert f"usermod -aG {group}" in said
