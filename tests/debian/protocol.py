"""What is done to the Debian package inside the booted container, step by step: `protocol.py PHASE`, see PHASES below.

It runs there as root, with Debian's Python and without network. Each step prints one line: its name, what was seen, how
long it took. A step that goes wrong says why, and ends the phase.
"""

# ruff: noqa: TID251 - real time passes in a real systemd
from __future__ import annotations

import grp
import os
import pwd
import re
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.request import urlopen

from tests.debian.machine import (
    LOGS,
    SERVICE,
    STATE,
    Wrong,
    apt,
    driven_through,
    files_now,
    installed_version,
    memory_mb,
    must,
    need,
    own_lines,
    package,
    run,
    shown,
    status,
    ticks,
    wait_for,
)

ROVER_FILE = Path("/etc/wayfarer/rover.toml")
SHIPPED = Path("/usr/share/doc/wayfarer/examples/forestrover.toml")
PICAMERA2 = Path("/usr/lib/python3/dist-packages/picamera2.py")  # Raspberry Pi's archive has the real one
DROP_IN = Path("/run/systemd/system/wayfarer.service.d/simulated.conf")
MISSION_S = 90.0
Step = Callable[[], str]

BEFORE: dict[str, tuple[int, int, int, str]] = {}
GROUPS_BEFORE: set[str] = set()
ROVER_TEXT: list[bytes] = []


def remember_all_files() -> str:
    """The machine before the package came; the simulated forest needs numpy."""
    need(apt("install", "python3-numpy")[0] == 0, "numpy is not in the cache of apt-get")
    BEFORE.update(files_now())
    GROUPS_BEFORE.update(group.gr_name for group in grp.getgrall())
    return (
        f"{len(BEFORE)} files and folders; network: {' '.join(path.name for path in Path('/sys/class/net').iterdir())}"
    )


def install() -> str:
    code, said = apt("install", package(0))
    need(code == 0, said[-2000:])
    size = must("dpkg-query", "--show", "--showformat=${Installed-Size}", "wayfarer")
    return f"{installed_version()}, {int(size) / 1024:.1f} MB; said: {own_lines(said) or 'nothing'}"


def nothing_started() -> str:
    need(shown("UnitFileState") == "disabled", shown("UnitFileState"))
    need(shown("ActiveState") == "inactive", shown("ActiveState"))
    groups = must("id", "--name", "--groups", "wayfarer").strip()
    need(set(groups.split()) >= {"wayfarer", "i2c", "spi", "gpio", "video", "dialout"}, groups)
    need(pwd.getpwuid(STATE.stat().st_uid).pw_name == "wayfarer", f"{STATE} is not the service's")
    return f"disabled, inactive; user in {groups}; {STATE} is the user's, {ROVER_FILE.parent} is empty"


def sound() -> str:
    said = must("dpkg", "--verify", "wayfarer") + must("systemd-analyze", "verify", SERVICE)
    need(said == "", said)
    return f"dpkg --verify and systemd-analyze verify find nothing; {must('wayfarer', '--version').strip()}"


def live_page() -> str:
    """The package brings what the page needs."""
    with TemporaryDirectory() as logs:
        command = ("wayfarer", "run", "--sim", "--live", "--live-port", "0", "--log-dir", logs)
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as daemon:
            assert daemon.stdout is not None
            try:
                said = daemon.stdout.readline()
                address = re.findall(r"http://\S+", said)
                need(address, said)
                with urlopen(address[0], timeout=10) as answer:
                    page = answer.read()
            finally:
                daemon.terminate()
    need(b"Drive by hand" in page, page[:200])
    return f"a page of {len(page)} bytes, with the button to drive by hand"


def without_rover_file() -> str:
    code, _ = run("systemctl", "start", SERVICE)
    need(code != 0 and shown("ExecMainStatus") == "2", f"exit code {shown('ExecMainStatus')}")
    said = must("journalctl", "--no-pager", "--output=cat", "--unit", SERVICE).splitlines()
    must("systemctl", "reset-failed", SERVICE)
    return next(line for line in said if str(ROVER_FILE) in line and "systemd" not in line)


def rover_file() -> str:
    text = SHIPPED.read_text(encoding="utf-8")
    own = 'deadman_unproved_because = "its board is simulated"\nstart_delay_s = 1.0'
    text = re.sub(r"start_delay_s = [\d.]+.*", own, text)
    text = re.sub(r"mission_time_s = [\d.]+", f"mission_time_s = {MISSION_S}", text)
    ROVER_FILE.write_text('buses = "tests.debian.chips:buses"\n' + text, encoding="utf-8")
    ROVER_TEXT.append(ROVER_FILE.read_bytes())
    PICAMERA2.write_text('"""Stands in for the system\'s python3-picamera2."""\n', encoding="utf-8")
    DROP_IN.parent.mkdir(parents=True)
    DROP_IN.write_text("[Service]\nEnvironment=PYTHONPATH=/protocol\n", encoding="utf-8")
    must("systemctl", "daemon-reload")
    return "forestrover's, over simulated chips; only PYTHONPATH is added to the package's unit"


def enable_and_start() -> str:
    must("systemctl", "enable", SERVICE)
    took_s = []
    for _ in range(3):
        began_s = time.monotonic()
        must("systemctl", "restart", SERVICE)
        took_s.append(time.monotonic() - began_s)
    need(status()["mode"] == "disarmed", str(status()))
    return f"ready after {', '.join(f'{each:.2f}' for each in took_s)} s; disarmed; {memory_mb():.0f} MB"


def system_libraries() -> str:
    found = Path("/run/wayfarer/imported.txt").read_text(encoding="utf-8").split()
    need(all(path.startswith("/usr/lib/python3/dist-packages/") for path in found), str(found))
    return f"the service imported {', '.join(found)}"


def arm() -> str:
    must("wayfarer", "arm")
    wait_for("armed", lambda: status().get("mode") == "armed")
    wait_for("it drives", lambda: any(tick["applied_left"] for tick in ticks()))
    return "armed, and the wheels turn"


def upgrade_while_armed() -> str:
    def upgrade() -> str:
        version = installed_version()
        code, said = apt("install", package(1))
        need(code != 0, "the upgrade was not refused")
        need(installed_version() == version, f"dpkg has {installed_version()}")
        need(must("dpkg", "--verify", "wayfarer") == "", "files were changed")
        need(Path("/usr/lib/wayfarer/wayfarer/__pycache__").is_dir(), "the compiled files are gone")
        return f"refused, {version} is whole: {own_lines(said)}"

    return driven_through(upgrade)


def remove_while_armed() -> str:
    def remove() -> str:
        code, _ = apt("remove", "wayfarer")
        need(code != 0, "the removal was not refused")
        need(must("dpkg", "--verify", "wayfarer") == "", "files were changed")
        return f"refused, {installed_version()}"

    return driven_through(remove)


def to_the_end() -> str:
    wait_for("the end of the mission", lambda: status().get("mode") == "disarmed", MISSION_S + 20)
    now = status()
    need(now["why_disarmed"] == "mission_time", str(now))
    must("wayfarer", "stop")
    wait_for("the service ends", lambda: shown("ActiveState") == "inactive")
    need(shown("Result") == "success", shown("Result"))
    need(shown("NRestarts") == "0", f"{shown('NRestarts')} restarts")
    return f"the mission drove until its limit of {MISSION_S:g} s and was disarmed; 'stop' ends the service for good"


def upgrade_while_down() -> str:
    must("dpkg", "--install", package(1))
    need(shown("ActiveState") == "inactive", shown("ActiveState"))
    must("dpkg", "--install", package(0))
    need(shown("ActiveState") == "inactive", shown("ActiveState"))
    return "to the new version and back; the service stays down"


def upgrade_while_disarmed() -> str:
    must("systemctl", "start", SERVICE)
    pid, logs = shown("MainPID"), len(list(LOGS.glob("*/")))
    code, said = apt("install", package(1))
    need(code == 0, said)
    need(shown("ActiveState") == "active", shown("ActiveState"))
    now = status()
    need(now["mode"] == "disarmed" and shown("MainPID") != pid, str(now))
    need(ROVER_FILE.read_bytes() == ROVER_TEXT[0], "the rover file has changed")
    need(len(list(LOGS.glob("*/"))) == logs + 1, "logs are missing")
    need(not Path("/run/wayfarer.upgrade").exists(), "a mark was left")
    return f"{installed_version()}; another process, version {now['version']}, disarmed; rover file and logs are kept"


def silent_daemon() -> str:
    pid = int(shown("MainPID"))
    os.kill(pid, signal.SIGSTOP)
    code, said = run("/var/lib/dpkg/info/wayfarer.prerm", "upgrade", "99")
    with suppress(ProcessLookupError):  # the watchdog ends it after 12 s
        os.kill(pid, signal.SIGCONT)
    need(code != 0, "a daemon that does not answer was taken for disarmed")
    return f"refused: {own_lines(said)}"


def kill_while_armed() -> str:
    wait_for("the daemon answers", lambda: status().get("mode") == "disarmed", 30)
    arm()
    pid = int(shown("MainPID"))
    os.kill(pid, signal.SIGKILL)
    took_s = wait_for("a new daemon", lambda: status().get("mode") == "disarmed", 30)
    said = must("journalctl", "--no-pager", "--output=cat", "--unit", SERVICE).splitlines()
    stopped = [line for line in said[-20:] if "stop was sent" in line]
    need(stopped, "stop-motors said nothing")
    return f"ExecStopPost: {stopped[0]}; back and disarmed after {took_s:.1f} s"


def earlier_install_service() -> str:
    code, said = run("wayfarer", "install-service")
    need(code == 2 and not Path(f"/etc/systemd/system/{SERVICE}").exists(), said)
    return f"refused: {said.strip()}"


def remove() -> str:
    code, said = apt("remove", "wayfarer")
    need(code == 0, said)
    need(shown("ActiveState") == "inactive", shown("ActiveState"))
    need(ROVER_FILE.read_bytes() == ROVER_TEXT[0], "the rover file has changed")
    need(any(LOGS.iterdir()), "the logs are gone")
    need(not Path("/usr/lib/wayfarer").exists(), str(list(Path("/usr/lib/wayfarer").rglob("*"))[:5]))
    return "the service has ended; rover file and logs are kept"


def install_again() -> str:
    code, said = apt("install", package(1))
    need(code == 0, said)
    must("systemctl", "restart", SERVICE)
    need(status()["mode"] == "disarmed", str(status()))
    return f"{installed_version()}, {shown('UnitFileState')}; starts with the kept rover file, disarmed"


def purge() -> str:
    PICAMERA2.unlink()
    code, said = apt("purge", "--autoremove", "wayfarer")
    need(code == 0, said)
    return own_lines(said)


def nothing_left() -> str:
    now = files_now()
    left = [path for path in now if path not in BEFORE]
    gone = [path for path in BEFORE if path not in now]
    changed = [path for path in now if path in BEFORE and now[path] != BEFORE[path]]
    need(not left and not gone, f"left: {left}; gone: {gone}; changed: {changed}")
    users, groups = {user.pw_name for user in pwd.getpwall()}, {group.gr_name for group in grp.getgrall()}
    need("wayfarer" not in users | groups, "the user or its group is there")
    added = groups - GROUPS_BEFORE
    need(added <= {"i2c", "spi", "gpio"} and set(changed) <= {"/etc/group", "/etc/gshadow"}, f"{added}, {changed}")
    return f"files left behind: none of {len(now)}; the groups of devices stay: {' '.join(sorted(added))}"


def install_after_purge() -> str:
    said = install()
    rover_file_again()
    must("systemctl", "enable", "--now", SERVICE)
    need(status()["mode"] == "disarmed", str(status()))
    must("wayfarer", "stop")
    return said


def rover_file_again() -> None:
    """Write the rover file and the stand-in once more, and let them be found without /run, at the next boots."""
    ROVER_FILE.write_bytes(ROVER_TEXT[0])
    PICAMERA2.write_text("", encoding="utf-8")
    kept = Path("/etc/systemd/system/wayfarer.service.d/simulated.conf")
    kept.parent.mkdir()
    kept.write_text("[Service]\nEnvironment=PYTHONPATH=/protocol\n", encoding="utf-8")
    must("systemctl", "daemon-reload")


# -- on a root that nobody can write to --------------------------------------------------------------------------------


def read_only() -> str:
    said = []
    for folder in ("/etc", "/var/lib", "/var/log", str(STATE)):
        try:
            probe = Path(folder) / "probe"
            probe.write_text("", encoding="utf-8")
            probe.unlink()
            said.append(f"{folder} can be written to")
        except OSError as error:
            said.append(f"{folder}: {error.strerror}")
    return "; ".join(said)


def started_at_boot() -> str:
    run("systemctl", "start", SERVICE)
    need(shown("ActiveState") == "active", "it did not start")
    return f"active, {status()['mode']}"


def arm_and_drive(*more: str) -> str:
    must("wayfarer", "arm", *more)
    wait_for("armed", lambda: status().get("mode") == "armed")
    time.sleep(3)
    now = status()
    metres = float(str(now["travelled_m"]))
    need(metres > 0.5, str(now))
    must("wayfarer", "disarm")
    return f"drove {metres:.1f} m; {now['log_dropped']} records of its log dropped"


def arm_and_drive_without_log() -> str:
    code, said = run("wayfarer", "arm")
    need(code != 0, "it was armed without a log")
    return f"'arm' is refused: {said.strip()}; 'arm --without-log': {arm_and_drive('--without-log')}"


def journal() -> str:
    """What the daemon said."""
    return must("journalctl", "--no-pager", "--boot", "--output=cat", "--unit", SERVICE)[-3000:].strip()


PHASES: dict[str, tuple[Step, ...]] = {
    "installed": (
        remember_all_files, install, nothing_started, sound, live_page, without_rover_file, rover_file,
        enable_and_start, system_libraries, arm, upgrade_while_armed, remove_while_armed, to_the_end,
        upgrade_while_down, upgrade_while_disarmed, silent_daemon, kill_while_armed, earlier_install_service, remove,
        install_again, purge, nothing_left, install_after_purge,
    ),
    "data-partition": (read_only, started_at_boot, arm_and_drive, journal),
    "all-read-only": (read_only, started_at_boot, arm_and_drive_without_log, journal),
}  # fmt: skip


def lines(steps: tuple[Step, ...]) -> Iterator[str]:
    """Do all steps in turn, up to one that goes wrong; give what each has shown."""
    for step in steps:
        name, began_s = step.__name__.replace("_", " "), time.monotonic()
        try:
            seen = step()
        except Exception as error:  # whatever it is, the person must see it
            yield f"WRONG {name}: {error if isinstance(error, Wrong) else traceback.format_exc()}"
            yield run("journalctl", "--no-pager", "--boot", "--output=short-monotonic", "--unit", SERVICE)[1][-5000:]
            return
        yield f"{name} ({time.monotonic() - began_s:.1f} s): {seen}"
    yield "all steps went well"


if __name__ == "__main__":
    for line in lines(PHASES[sys.argv[1]]):
        print(line, flush=True)
