"""A disk that is full or gone, files that others remove, and a log whose end the power cut off."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from tests.fieldlog.disks import small_disk
from tests.system.hil_setup import Site, wait_for
from wayfarer.daemon.socket.protocol import Refused
from wayfarer.fieldlog.folders import FILE_NAME, run_folders
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.schema import Record

DISK_KB = 160_000  # of them the log leaves 100,000 to the computer, and a mission takes 50,000
DAMAGED = 3  # exit code of `wayfarer logs check` for a log of which something is lost
NUL_BYTES = 4096
TOLD_WITHIN_S = 1.3
TAIL = b"\xff\xfe no text \x80\n" + bytes(NUL_BYTES) + b'\n{"record":"tick","n":99999,"t_s":1'


def test_rover_drives_on_while_the_disk_is_full(site: Site) -> None:
    with small_disk(site.logs, DISK_KB) as mounted:
        daemon = site.armed()
        free = (fill if mounted else limit)(site.logs, daemon.pid)
        drives_on_without_a_log(site)
        free()
        site.told("log_gap")
        wait_for("it can be armed again", lambda: can_be_armed(site))


def test_rover_drives_on_without_its_folder_of_logs_and_check_fails(site: Site) -> None:
    """A file in the folder's place; a card that is read-only refuses in the same place, with another error."""
    daemon = site.armed()
    site.logs.rename(site.folder / "taken away")
    site.logs.write_text("no folder", encoding="ascii")
    drives_on_without_a_log(site)
    daemon.terminate()
    daemon.wait()
    checked = site.run("check", "--rover", site.config, "--log-dir", site.logs, "--json")
    assert checked.returncode == 1
    assert "cannot be written" in checked.stdout


def test_log_that_somebody_deletes_goes_on_in_a_new_file(site: Site) -> None:
    site.armed()
    run = run_folders(site.logs)[-1]
    (run / FILE_NAME).unlink()
    began_s = time.monotonic()
    wait_for("a new file", (run / FILE_NAME).exists)
    assert time.monotonic() - began_s <= TOLD_WITHIN_S
    site.ticks_beyond(began_s)
    site.drives_on()
    reader = RunReader(run)
    header, *_ = reader
    assert (header["record"], header["part"]) == ("run", 2)
    assert reader.damage.lines == 0


def test_torn_end_of_a_log_costs_nothing_before_it(site: Site) -> None:
    daemon = site.armed()
    daemon.kill()
    daemon.wait()
    run = run_folders(site.logs)[-1]
    whole = list(RunReader(run))
    with (run / FILE_NAME).open("ab") as file:
        file.write(TAIL)
    reader = RunReader(run)
    assert list(reader) == whole, "records before the damage are lost"
    assert (reader.damage.garbled, reader.damage.nul, reader.damage.torn) == (1, 1, 1)
    assert site.run("logs", "check", "--log-dir", site.logs).returncode == DAMAGED
    before = run_folders(site.logs)
    site.daemon()
    later = run_folders(site.logs)[len(before) :]  # on a busy computer it may take two starts
    event = wait_for("the event 'unclean_shutdown'", lambda: first(later, "unclean_shutdown"))
    assert event["run"] == run.name


def drives_on_without_a_log(site: Site) -> None:
    """The daemon notices, the rover drives on, and it is not armed again."""
    began_s = time.monotonic()
    wait_for("the daemon says that it loses records", lambda: site.status()["log_dropped"] > 0)
    assert time.monotonic() - began_s <= TOLD_WITHIN_S
    assert "the field log" in site.said(), "nothing on the terminal"
    site.drives_on()
    site.ask("disarm")
    with pytest.raises(Refused, match="log"):
        site.ask("arm", heading_deg=0.0)


def can_be_armed(site: Site) -> bool:
    try:
        site.ask("arm", heading_deg=0.0)
    except Refused:
        return False
    return True


def first(runs: Iterable[Path], name: str) -> Record | None:
    """The first event of this name in any of these runs."""
    return next((record for run in runs for record in RunReader(run) if record.get("name") == name), None)


def fill(logs: Path, _pid: int) -> Callable[[], None]:
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


def limit(logs: Path, pid: int) -> Callable[[], None]:
    """Have the system refuse to let any file of a process grow; return what allows it again."""
    size = (run_folders(logs)[-1] / FILE_NAME).stat().st_size
    soft, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, hard))

    def allow() -> None:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (soft, hard))

    return allow
