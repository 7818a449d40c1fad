"""A disk that is full or gone, and files that others remove, under a rover that drives."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import os
import resource
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from wayfarer.daemon.socket.protocol import Refused
from wayfarer.fault_scenarios.process_tests.hil_setup import HilSetup, site, wait_for
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.scenario import Reached
from wayfarer.fieldlog.folders import FILE_NAME, run_folders
from wayfarer.fieldlog.reader import RunReader

DISK_MB = 160  # of it the log leaves 100 to the computer, and a mission takes 50
DETECT_S = 1.0 + 0.3  # a sync each second, and a computer that does other things
PART_MB = 1  # the smallest that a rover file may ask for: 70 s of log
AT_ONCE = 50  # requests on their way
EVENT_BYTES = 80  # of the log that a new goal takes, at least


@procedure(
    "disk-full", 40, "the disk runs full while the rover drives",
    asked="run goes on; S0; refuse NEXT arm; detect <= 1 s", expected=Reached.NOTE, within_s=DETECT_S,
)  # fmt: skip
def disk_full(found: Observed) -> None:
    """Fill the disk of the logs; without the right to mount one, have the system refuse the daemon's writes."""
    with site() as where, _small_disk(where.logs) as mounted:
        daemon = where.armed()
        fill, found.remark = (
            (_fill, "a disk of its own, filled to the last byte") if mounted else (_limit, "RLIMIT_FSIZE")
        )
        free = fill(where.logs, daemon.pid)
        found.changed = "writes to the log are refused"
        _drives_on_without_a_log(where, found)
        free()
        where.told("log_gap")
        wait_for("it can be armed again", lambda: _is_armed(where))


@procedure(
    "logs-gone", 41, "the folder of the logs vanishes, and cannot be made again",
    asked="as 40; `check` fails; <= 1 s", expected=Reached.NOTE, within_s=DETECT_S,
    remark="a read-only card refuses in the same place, with another error",
)  # fmt: skip
def logs_gone(found: Observed) -> None:
    """Take the folder away, and put a file in its place."""
    with site() as where:
        daemon = where.armed()
        where.logs.rename(where.folder / "taken away")
        where.logs.write_text("no folder", encoding="ascii")
        found.changed = "no file can be made for the log"
        _drives_on_without_a_log(where, found)
        daemon.terminate()
        daemon.wait()
        checked = where.run("check", "--config", where.config, "--logs", where.logs, "--json")
        found.demand(checked.returncode == 1, f"check ends with {checked.returncode}")
        found.demand("cannot be written" in checked.stdout, "check does not say that the folder cannot be written")


@procedure(
    "log-deleted", 43, "the log is rotated, and a file of it deleted by somebody else",
    asked="no torn line; reopen; 1 s", expected=Reached.NOTE, within_s=DETECT_S,
)  # fmt: skip
def log_deleted(found: Observed) -> None:
    """Delete the file that is being written; fill one to its end; read everything that is left."""
    with site() as where:
        where.config.write_text(f"{where.config.read_text('utf-8')}\n[log]\npart_mb = {PART_MB}\n", encoding="utf-8")
        where.armed()
        run = run_folders(where.logs)[-1]
        (run / FILE_NAME).unlink()
        began_s = time.monotonic()
        wait_for("a new file", (run / FILE_NAME).exists)
        found.detected_s = time.monotonic() - began_s
        where.ticks_beyond(began_s)
        found.demand(where.log()[0]["record"] == "run", "the new file has no header")
        found.changed, found.cause, found.reached = "the file is gone", "a new file, with its header", Reached.NOTE
        _fill_a_part(where)
        wait_for("a second file", lambda: len(list(run.iterdir())) > 1)
        reader = RunReader(run)
        parts = [record["part"] for record in reader if record["record"] == "run"]
        found.remark = f"parts {parts} are left; {reader.damage}"
        found.demand(reader.damage.lines == 0, f"damaged lines: {reader.damage}")


def _drives_on_without_a_log(where: HilSetup, found: Observed) -> None:
    """See that the daemon notices, that the rover drives on, and that it is not armed again."""
    began_s = time.monotonic()
    wait_for("the daemon says that it loses records", lambda: where.status()["log_dropped"] > 0)
    found.detected_s, found.cause, found.reached = time.monotonic() - began_s, "log_dropped", Reached.NOTE
    found.demand("the field log" in where.said(), "nothing on the terminal")
    found.demand(where.status()["mode"] == "armed" and where.drives, "it does not drive on")
    where.ask("disarm")
    try:
        where.ask("arm", heading_deg=0.0)
        found.problems.append("it was armed again")
    except Refused as refused:
        found.demand("log" in str(refused), f"the refusal says: {refused}")


def _is_armed(where: HilSetup) -> bool:
    """Try to arm, and return whether that went well."""
    try:
        where.ask("arm", heading_deg=0.0)
    except Refused:
        return False
    return True


def _fill_a_part(where: HilSetup) -> None:
    """Have the daemon write more than a part of its log may have, as fast as it takes requests."""
    request = b'{"do": "goal", "heading_deg": 0.0}\n'  # marks are limited
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(str(where.socket))
        with line.makefile("rb") as replies:
            for _ in range(int(PART_MB * 1e6 / EVENT_BYTES / AT_ONCE)):
                line.sendall(request * AT_ONCE)
                for _ in range(AT_ONCE):
                    replies.readline()


@contextmanager
def _small_disk(mount_point: Path) -> Iterator[bool]:
    """Mount a disk for the logs; give False where that is not allowed."""
    mount_point.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m,mode=755", "tmpfs", str(mount_point)]
    mounted = os.geteuid() == 0 and subprocess.run(command, capture_output=True, check=False).returncode == 0
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(mount_point)], check=True)


def _fill(logs: Path, _pid: int) -> Callable[[], None]:
    """Leave no byte on a disk; return what makes room again."""
    filler = logs / "filler"
    with filler.open("wb", buffering=0) as file:
        piece = bytes(1_000_000)
        while piece:
            try:
                file.write(piece)
            except OSError:
                piece = piece[: len(piece) // 2]
    return filler.unlink


def _limit(logs: Path, pid: int) -> Callable[[], None]:
    """Have the system refuse to let any file of a process grow; return what allows it again."""
    size, (soft, hard) = (
        (run_folders(logs)[-1] / FILE_NAME).stat().st_size,
        resource.prlimit(pid, resource.RLIMIT_FSIZE),
    )
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, hard))

    def allow() -> None:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (soft, hard))

    return allow
