"""Runs are numbered in their order, whatever else lies among their folders, and two daemons never share a number."""

from __future__ import annotations

import errno
import fcntl
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

import pytest

from tests.fieldlog.disks import FailingCall
from wayfarer.errors import BadInput
from wayfarer.fieldlog import folders
from wayfarer.fieldlog.folders import find_run, new_run_folder, run_folders, run_number, short_name
from wayfarer.fieldlog.reader import log_segments

TIME = "20261121T061405Z"


def make(logs: Path, name: str) -> Path:
    run = logs / name
    run.mkdir(parents=True)
    (run / "run.00001.jsonl").touch()
    return run


def test_next_number_follows_the_highest_and_the_folder_is_made(tmp_path: Path) -> None:
    logs = tmp_path / "var" / "log"
    first = new_run_folder(logs)
    assert first.is_dir()
    assert first.name.startswith("00001-2")
    make(logs, f"00017-{TIME}")
    assert new_run_folder(logs).name.startswith("00018-2")


def test_read_only_disk_gives_a_log_that_is_not_needed_the_next_name_without_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make(tmp_path, f"00017-{TIME}")
    making = FailingCall(monkeypatch, "mkdir", errno.EROFS)
    making.failures = 5  # a folder that is there is asked for, too
    with pytest.raises(BadInput, match="Read-only file system"):
        new_run_folder(tmp_path)
    run = new_run_folder(tmp_path, needed=False)
    assert (run_number(run), run.exists()) == (18, False)
    assert run_number(new_run_folder(tmp_path / "none", needed=False)) == 1


def test_counter_goes_on_past_five_digits_in_order(tmp_path: Path) -> None:
    runs = [make(tmp_path, f"{number}-{TIME}") for number in ("00002", "99999", "100000")]
    assert run_folders(tmp_path) == runs
    assert new_run_folder(tmp_path).name.startswith("100001-")


def test_foreign_names_are_runs_without_a_number_and_come_first(tmp_path: Path) -> None:
    run = make(tmp_path, f"00003-{TIME} hit the big log")
    others = [make(tmp_path, name) for name in ("-5", "2026", "20261121-photos", "forest-pledge-00017", f"٣-{TIME}")]
    (tmp_path / "lost+found").touch()
    (tmp_path / "notes").mkdir()
    assert run_folders(tmp_path) == [*others, run]
    assert new_run_folder(tmp_path).name.startswith("00004-")


@pytest.mark.parametrize("number", ["999999999", "9" * 238])
def test_number_that_nobody_counted_to_keeps_no_daemon_from_starting(tmp_path: Path, number: str) -> None:
    """A name has 255 bytes at most."""
    make(tmp_path, f"{number}-{TIME}")
    runs = {new_run_folder(tmp_path) for _ in range(3)}
    assert len(runs) == 3
    assert {run_number(run) for run in runs} in ({999_999_999}, {1, 2, 3})


def test_file_system_without_locks_keeps_no_daemon_from_starting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", flock)
    assert run_number(new_run_folder(tmp_path)) == 1


def test_disk_that_hangs_keeps_no_daemon_from_starting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    well = Event()
    monkeypatch.setattr(folders, "LOOK_S", 0.01)
    monkeypatch.setattr(os, "mkdir", lambda *_: well.wait(20.0))
    run = new_run_folder(tmp_path / "logs", needed=False)
    assert (run_number(run), run.exists()) == (1, False)
    well.set()


def test_lock_that_another_user_holds_keeps_no_daemon_from_starting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(folders, "LOCK_TRIES", 2)
    held = os.open(tmp_path, os.O_RDONLY)
    try:
        fcntl.flock(held, fcntl.LOCK_SH)
        assert run_number(new_run_folder(tmp_path)) == 1
    finally:
        os.close(held)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may look everywhere")
def test_symlink_to_where_nobody_may_look_is_no_run(tmp_path: Path) -> None:
    private = tmp_path / "private"
    run = make(tmp_path / "logs", f"00001-{TIME}")
    (tmp_path / "logs" / f"00002-{TIME}").symlink_to(make(private, "run"))
    private.chmod(0)
    try:
        assert run_folders(tmp_path / "logs") == [run]
        assert find_run("last", tmp_path / "logs") == run
    finally:
        private.chmod(0o700)


def test_folder_without_a_log_keeps_its_number_but_is_no_run(tmp_path: Path) -> None:
    run = make(tmp_path, f"00001-{TIME}")
    new_run_folder(tmp_path)
    assert find_run("last", tmp_path) == run
    assert new_run_folder(tmp_path).name.startswith("00003-")


def test_daemons_that_start_at_once_get_numbers_of_their_own(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        runs = list(pool.map(lambda _: new_run_folder(tmp_path), range(40)))
    assert sorted(int(run.name.partition("-")[0]) for run in runs) == list(range(1, 41))


def test_run_is_found_by_number_name_or_path(tmp_path: Path) -> None:
    run, late = make(tmp_path, f"00003-{TIME}"), make(tmp_path, f"00004-{TIME}")
    late.joinpath("run.00001.jsonl").rename(late / "run.00002.jsonl")
    assert find_run(None, tmp_path) == late
    names = ("3", "00003", run.name, str(run), str(run / "run.00001.jsonl"))
    assert {find_run(name, tmp_path) for name in names} == {run}
    with pytest.raises(BadInput, match=rf"no run and no folder '5': .* holds {run.name} to {late.name}"):
        find_run("5", tmp_path)
    with pytest.raises(BadInput, match="holds no run"):
        find_run(None, tmp_path / "none")


def test_log_of_an_older_wayfarer_is_refused_in_one_line(tmp_path: Path) -> None:
    old = tmp_path / f"00003-{TIME}"
    old.mkdir()
    (old / "run.jsonl").touch()
    for attempt in (lambda: find_run(str(old), tmp_path), lambda: log_segments(old)):
        with pytest.raises(BadInput, match=r"its log is of an older wayfarer \(run\.jsonl\): read it with that one"):
            attempt()


def test_folder_that_only_begins_with_a_number_is_not_called_by_it() -> None:
    assert [short_name(Path(name)) for name in ("00017-20261121T061405Z", "17-foo")] == ["17", "17-foo"]


def test_number_that_two_runs_have_names_both(tmp_path: Path) -> None:
    make(tmp_path, f"00001-{TIME}")
    make(tmp_path, "00001-20261122T061405Z")
    with pytest.raises(BadInput, match=rf"several runs 1: 00001-{TIME}, 00001-20261122T061405Z; give"):
        find_run("1", tmp_path)


def test_other_file_beside_a_log_is_no_log(tmp_path: Path) -> None:
    other = make(tmp_path, f"00001-{TIME}") / "notes.jsonl"
    other.touch()
    with pytest.raises(BadInput, match="is not a field log"):
        find_run(str(other), tmp_path)


def test_name_that_no_file_can_have_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="File name too long"):
        find_run("a" * 300, tmp_path)


def test_folder_that_cannot_be_made_is_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "logs").touch()
    with pytest.raises(BadInput, match=r"logs: no folder can be made for the field log: (File exists|Not a dir)"):
        new_run_folder(tmp_path / "logs")
    with pytest.raises(BadInput, match="Not a directory: a file is in the place of the folder"):
        new_run_folder(tmp_path / "logs" / "runs")
    with pytest.raises(BadInput, match="the logs' folder cannot be read: Not a directory"):
        run_folders(tmp_path / "logs")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_read_only_folder_is_told_with_the_user_who_may_not(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(BadInput, match=rf"Permission denied: user {os.geteuid()} needs the right to write"):
        new_run_folder(tmp_path)
