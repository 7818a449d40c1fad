"""What protocol.py asks the booted system, and its package manager."""

# ruff: noqa: TID251 - real time passes in a real systemd
from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from stat import S_ISDIR, S_ISREG

PACKAGES = Path("/packages")
SERVICE = "wayfarer.service"
STATE = Path("/var/lib/wayfarer")
LOGS = STATE / "field_logs"
# What changes by itself, or by any package: of no interest in a comparison of all files.
NOT_COMPARED = re.compile(
    r"/(proc|sys|dev|run|tmp|root|protocol|packages|results|var/(log|cache|tmp)|var/lib/(dpkg|apt|systemd/(?!deb)|dbus))"
    r"(/|$)|/etc/(machine-id|ld\.so\.cache|resolv\.conf|localtime|(passwd|group|shadow|gshadow)-)$"
)


class Wrong(Exception):
    """A step did not show what it must."""


def need(holds: object, otherwise: str) -> None:
    """Raise ``Wrong`` unless something holds."""
    if not holds:
        raise Wrong(otherwise)


def run(*command: str) -> tuple[int, str]:
    """Run a command; return its exit code and all that it said."""
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive", "LC_ALL": "C.UTF-8"}
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        env=environment,
    )  # fmt: skip
    return done.returncode, done.stdout


def must(*command: str) -> str:
    """Run a command that has to succeed; return what it said."""
    code, said = run(*command)
    need(code == 0, f"'{' '.join(command)}' ended with {code}: {said[-1500:]}")
    return said


def shown(name: str) -> str:
    """Return a property of the service, as systemd knows it."""
    return must("systemctl", "show", "--value", "--property", name, SERVICE).strip()


def status() -> dict[str, object]:
    """Return what the daemon says of itself; empty if it does not answer."""
    code, said = run("wayfarer", "status", "--json")
    found: dict[str, object] = json.loads(said) if code == 0 else {}
    return found


def wait_for(what: str, holds: Callable[[], bool], limit_s: float = 15.0) -> float:
    """Poll until something holds; return how long that took."""
    began_s = time.monotonic()
    while not holds():
        need(time.monotonic() - began_s < limit_s, f"after {limit_s:g} s not yet: {what}")
        time.sleep(0.02)
    return time.monotonic() - began_s


def ticks() -> list[dict[str, object]]:
    """Return the ticks that the newest run has logged so far."""
    newest = max(LOGS.rglob("run*.jsonl"), key=lambda path: path.stat().st_mtime_ns)
    records = []
    for line in newest.read_text(encoding="utf-8").splitlines():
        with suppress(ValueError):  # the last line may be half written
            records.append(json.loads(line))
    return [record for record in records if record["record"] == "tick"]


def package(number: int) -> str:
    """Return the path of the older (0) or the newer (1) package."""
    return str(sorted(PACKAGES.glob("wayfarer_*.deb"))[number])


def apt(*arguments: str) -> tuple[int, str]:
    """Run apt-get, which takes dependencies from its cache, because there is no network."""
    return run("apt-get", "--yes", "-qq", "--no-install-recommends", "-o", "Dpkg::Use-Pty=0", *arguments)


def installed_version() -> str:
    """Return dpkg's state of the package, and its version."""
    return must("dpkg-query", "--show", "--showformat=${db:Status-Abbrev}${Version}", "wayfarer")


def own_lines(said: str) -> str:
    """Return what the package's own scripts told the person, on one line."""
    return " / ".join(line.removeprefix("wayfarer: ") for line in said.splitlines() if line.startswith("wayfarer: "))


def files_now() -> dict[str, tuple[int, int, int, str]]:
    """Return mode, user, group and checksum of every file that is compared."""
    found = {}
    folders = [Path("/")]
    for folder in folders:  # which grows meanwhile
        for path in (each for each in folder.iterdir() if not NOT_COMPARED.match(str(each))):
            info = path.lstat()
            digest = hashlib.sha256(path.read_bytes()).hexdigest() if S_ISREG(info.st_mode) else ""
            found[str(path)] = (info.st_mode, info.st_uid, info.st_gid, digest)
            if S_ISDIR(info.st_mode):
                folders.append(path)
    return found


def driven_through(action: Callable[[], str]) -> str:
    """Do something while the rover drives; show that the daemon neither stopped nor started anything because of it.

    Returns:
        What the action said, and how the rover drove meanwhile.
    """
    pid, before = shown("MainPID"), len(ticks())
    said = action()
    time.sleep(1.5)  # more than a second: the log is written five times per second
    meanwhile = ticks()[before:]
    need(shown("MainPID") == pid, "the daemon is another process now")
    need(status().get("mode") == "armed", f"the rover is {status().get('mode')}")
    times_s = [float(str(tick["t_s"])) for tick in meanwhile]
    longest_s = max(after - before for before, after in pairwise(times_s))
    moved = sum(1 for tick in meanwhile if tick["applied_left"] or tick["applied_right"])
    metres = float(str(meanwhile[-1]["travelled_m"])) - float(str(meanwhile[0]["travelled_m"]))
    need(metres > 0.2, f"the rover drove {metres:.2f} m only")
    return (
        f"{said}; the same process drove on: {metres:.1f} m, {len(meanwhile)} ticks, {moved} with turning wheels, the "
        f"longest from tick to tick {longest_s:.2f} s"
    )


def memory_mb() -> float:
    """Return the daemon's resident memory."""
    text = Path(f"/proc/{shown('MainPID')}/status").read_text(encoding="utf-8")
    return int(re.findall(r"VmRSS:\s+(\d+) kB", text)[0]) / 1024
