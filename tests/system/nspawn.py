"""A real systemd for tests: this machine's own files under an overlay, booted as a container in about a second.

Nothing is copied and nothing of the host changes. All mounts are made in a mount namespace of their own, so they are
gone with the process that holds it, however it ends. The container gets the environment that runs the tests as
``/opt/wayfarer``, which is where docs/how-to/service.md installs it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
VENV = Path("/opt/wayfarer")
RESULTS = Path("/results")
BOUND = ("wayfarer", "tests", "systemd", "examples")  # of the checkout
BOOT_LIMIT_S = 360  # 120 s on an idle core; other tests share the cores

# $1 seed: files to lay over the host's; $2 folder for mounts; $3 how often to boot; the rest: nspawn's own arguments.
BOOT = f"""
set -eu
seed=$1 mounts=$2 boots=$3; shift 3
mount -t tmpfs -o mode=0755 tmpfs "$mounts"
mkdir "$mounts/up" "$mounts/work" "$mounts/root"
mount -t overlay -o "lowerdir=/,upperdir=$mounts/up,workdir=$mounts/work" overlay "$mounts/root"
root=$mounts/root
rm -f "$root/etc/machine-id"
rm -rf "$root{VENV}" "$root/etc/wayfarer" "$root/etc/systemd/system/wayfarer.service"*
cp -a "$seed/." "$root/"
# The tests' interpreter may be in a closed home such as root's; the service's user must reach it.
way=$root{sys.base_prefix}
while [ "$way" != "$root" ]; do chmod o+x "$way"; way=$(dirname "$way"); done
for boot in $(seq "$boots"); do
  timeout --kill-after=5 {BOOT_LIMIT_S} systemd-nspawn --quiet --directory="$root" "$@"
done
"""
# An overlay inside of a user's container may be refused; only trying tells.
TRIAL = """
set -eu
mount -t tmpfs tmpfs "$1"
mkdir "$1/up" "$1/work" "$1/root"
mount -t overlay -o "lowerdir=/,upperdir=$1/up,workdir=$1/work" overlay "$1/root"
"""
DRIVER = f"""
[Unit]
Description=Drives the test inside the container
Wants=dbus.socket
After=dbus.socket
[Service]
Type=oneshot
Environment=PYTHONPATH={VENV}/source
ExecStart={VENV}/bin/python {VENV}/source/{{scenario}}
ExecStopPost=/bin/systemctl poweroff --no-block
StandardOutput=file:{RESULTS}/driver.txt
StandardError=inherit
"""
COMMAND = f"""#!{VENV}/bin/python
import sys
sys.path.insert(0, "{VENV}/source")
from wayfarer.cli import main
main()
"""


def why_not(folder: Path) -> str | None:
    """Say why no systemd can be booted here, or None if it can be; ``folder`` is an empty one to mount on."""
    if os.geteuid() != 0:
        return "booting a systemd needs root"
    missing = [name for name in ("unshare", "timeout", "systemd-nspawn", "dbus-daemon") if shutil.which(name) is None]
    if missing:
        return f"booting a systemd needs {missing[0]}: apt-get install systemd systemd-container dbus"
    tried = subprocess.run(in_own_mounts(TRIAL, folder), capture_output=True, text=True, check=False)
    return f"no overlay can be mounted here: {tried.stderr.strip()}" if tried.returncode else None


def boot(scenario: Path, folder: Path, boots: int = 1) -> Path:
    """Boot, run the scenario (a Python file of the checkout) as a unit, power off; return the folder of its results.

    With more ``boots`` that is done again, on the same files.

    What the system said on its console is among them (``console.txt``), and what the scenario said (``driver.txt``,
    absent if the system did not come so far).
    """
    seed, mounts, results = (folder / name for name in ("seed", "mounts", "results"))
    for each in (seed, mounts, results):
        each.mkdir()
    _sow(seed, scenario.relative_to(CHECKOUT))
    done = subprocess.run(
        in_own_mounts(
            BOOT, seed, mounts, str(boots),
            f"--bind={results}:{RESULTS}",
            f"--bind-ro={sysconfig.get_path('purelib')}:{VENV / _site_packages()}",
            *(f"--bind-ro={CHECKOUT / each}:{VENV}/source/{each}" for each in BOUND),
            "--private-network", "--register=no", "--keep-unit",
            "--boot", "systemd.unit=driver.service",  # and what it needs: none of the host's own services
        ),
        env={**os.environ, **control_groups()},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False,
    )  # fmt: skip
    (results / "console.txt").write_text(done.stdout + done.stderr, encoding="utf-8")
    return results


def in_own_mounts(script: str, *arguments: str | Path) -> list[str]:
    """Return the command that runs a shell script in a mount namespace of its own."""
    return ["unshare", "--mount", "--propagation=private", "sh", "-c", script, "sh", *map(str, arguments)]


def control_groups() -> dict[str, str]:
    """Ask for control groups of version 1 if the host has those; a container cannot have others than its host."""
    return {} if Path("/sys/fs/cgroup/cgroup.controllers").exists() else {"SYSTEMD_NSPAWN_UNIFIED_HIERARCHY": "0"}


def _sow(seed: Path, scenario: Path) -> None:
    """Make the files that the container has and the host has not: an environment, and the unit that drives the test."""
    venv = seed / VENV.relative_to("/")
    (venv / _site_packages()).mkdir(parents=True)
    (venv / "source").mkdir()
    (venv / "bin").mkdir()
    (venv / "pyvenv.cfg").write_text(f"home = {Path(sys.base_prefix) / 'bin'}\n", encoding="utf-8")
    (venv / "bin/python").symlink_to(Path(sys.executable).resolve())
    (venv / "bin/wayfarer").write_text(COMMAND, encoding="utf-8")
    (venv / "bin/wayfarer").chmod(0o755)
    units = seed / "etc/systemd/system"
    units.mkdir(parents=True)
    (units / "driver.service").write_text(DRIVER.format(scenario=scenario), encoding="utf-8")


def _site_packages() -> Path:
    return Path(f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages")
