"""Device files that the user may not open, and who could give them."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from subprocess import run

from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.result import Tried
from wayfarer.fault_scenarios.scenario import Reached

NOBODY = 65534
DEVICES = {"/dev/i2c-1": "i2c", "/dev/spidev0.1": "spi", "/dev/ttyAMA0": "dialout", "/dev/gpiochip0": "gpio"}
# What `wayfarer check` asks of each device file, under another root, as another user where this one is root.
LOOK = """
import os, sys
from pathlib import Path
from wayfarer.commissioning.checks.api import Place
from wayfarer.commissioning.checks.system import diagnose
root, user, *devices = sys.argv[1:]
if os.geteuid() == 0:
    os.setgroups([])
    os.setuid(int(user))
for device in devices:
    print(diagnose(Place(Path("logs"), Path("calibration"), (), 0.0, Path(root)), device))
"""


@procedure(
    "no-permission", 53, "the user is in none of the groups that own the device files",
    asked="`check` says which group; at check", expected=Reached.FAULT, tried=Tried.COMMAND,
    remark="the check itself, as a user without rights, on device files that nobody may open",
)  # fmt: skip
def no_permission(found: Observed) -> None:
    """Forbid device files to a user, and see what the check says of each."""
    with tempfile.TemporaryDirectory(prefix="wf-") as folder:
        root = Path(folder)
        root.chmod(0o755)
        for device in DEVICES:
            file = root / device.lstrip("/")
            file.parent.mkdir(exist_ok=True)
            file.touch()
            file.chmod(0)
        done = run(
            [sys.executable, "-c", LOOK, folder, str(NOBODY), *DEVICES], capture_output=True, text=True, check=False
        )
        said = done.stdout.splitlines()
        found.demand(done.returncode == 0 and len(said) == len(DEVICES), f"the check broke: {done.stderr[-300:]}")
        for (device, group), line in zip(DEVICES.items(), said, strict=False):
            named = f"group '{group}'" in line and f"usermod -aG {group}" in line
            found.demand(named, f"{device}: {line}")
    found.changed, found.cause, found.reached = f"{len(DEVICES)} device files", "the group is named", Reached.FAULT
