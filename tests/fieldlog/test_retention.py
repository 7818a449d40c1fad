"""Old runs are deleted only if a person wants it, never the wrong ones, and a power cut leaves no half of one."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.fieldlog.disks import power_cut_at
from tests.fieldlog.lines import Log, header, numbers, tick
from wayfarer.fieldlog import retention
from wayfarer.fieldlog.folders import MB, new_run_folder, run_folders, run_number
from wayfarer.fieldlog.retention import keep_run, prune
from wayfarer.reports.page.html import PAGE

NONE_MB = 0.0  # nothing but what always stays


def make(logs: Path, number: int, *, parts: int = 1, date: str = "20261101T000000Z") -> Path:
    """Make a run; each of its files has 100 to 300 bytes."""
    run = logs / f"{number:05d}-{date}"
    run.mkdir(parents=True)
    for part in range(1, parts + 1):
        (run / f"run.{part:05d}.jsonl").write_bytes(header(part) + b"\n" + tick(part) + b"\n")
    return run


def left(logs: Path) -> list[int | None]:
    return [run_number(run) for run in run_folders(logs)]


def size_mb(*runs: Path) -> float:
    return sum(file.stat().st_size for run in runs for file in run.iterdir()) / MB


def deleted(logs: Path, keep_mb: float = NONE_MB) -> list[int]:
    return [int(name[:5]) for name in prune(logs, keep_mb).deleted]


def test_lowest_counters_go_until_the_rest_fits_and_the_newest_stays_however_large(tmp_path: Path) -> None:
    """Whatever a clock said: the third began before the first."""
    runs = [make(tmp_path, number, parts=number, date=f"20{30 - number}1101T000000Z") for number in range(1, 5)]
    assert deleted(tmp_path, size_mb(*runs) + 1e-9) == []
    assert deleted(tmp_path, size_mb(*runs) - 1e-6) == [1]
    found = prune(tmp_path, size_mb(runs[3]) + 1e-9)
    assert [name[:5] for name in found.deleted] == ["00002", "00003"]
    assert found.trouble is None
    assert prune(tmp_path, NONE_MB).trouble is not None
    assert left(tmp_path) == [4]
    assert [path.name for path in tmp_path.iterdir()] == [runs[3].name], "nothing hidden is left"


def test_folder_of_logs_that_is_not_there_is_no_trouble(tmp_path: Path) -> None:
    assert prune(tmp_path / "gone", NONE_MB) == ((), 0.0, 0.0, None)


def test_dry_run_says_what_would_go_and_changes_nothing(tmp_path: Path) -> None:
    for number in (1, 2, 3):
        make(tmp_path, number)
    keep_run(tmp_path / "00002-20261101T000000Z")
    assert [name[:5] for name in prune(tmp_path, NONE_MB, dry_run=True).deleted] == ["00001"]
    assert left(tmp_path) == [1, 2, 3]


def test_what_a_person_kept_renamed_or_added_to_stays_and_so_does_a_run_that_somebody_writes(tmp_path: Path) -> None:
    kept, named, photo = (make(tmp_path, number) for number in range(1, 4))
    opened = Log(tmp_path / "00004-20261101T000000Z")
    make(tmp_path, 5)
    keep_run(kept)
    keep_run(kept)
    named.rename(f"{named} hit the big log")
    (photo / "photos").mkdir()
    found = prune(tmp_path, NONE_MB)
    assert found.deleted == ()
    assert "kept ones" in str(found.trouble)
    (kept / "keep").unlink()
    opened.sink.close()
    assert deleted(tmp_path) == [1, 4]


def test_report_of_a_run_goes_with_it_and_keeps_it_no_longer(tmp_path: Path) -> None:
    reported, another, linked = (make(tmp_path, number) for number in range(1, 4))
    make(tmp_path, 4)
    (reported / PAGE).write_text("<html>")
    if os.geteuid() == 0:
        os.chown(reported / PAGE, 65534, 65534)  # it was written with sudo, or by a person of the service's group
    (another / "notes.html").write_text("of a person")
    (linked / PAGE).symlink_to(another / "notes.html")
    assert deleted(tmp_path) == [1]
    assert left(tmp_path) == [2, 3, 4]


def test_run_that_is_kept_at_the_last_moment_gets_its_name_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody whose shell stands in its folder makes the file while the folder is renamed."""
    runs = [make(tmp_path, number) for number in (1, 2, 3)]
    real: Callable[..., Any] = os.rename

    def rename(old: str, new: str, **keys: Any) -> None:
        real(old, new, **keys)
        if "00001" in old and not old.startswith("."):
            keep_run(tmp_path / new)

    monkeypatch.setattr(os, "rename", rename)
    assert deleted(tmp_path) == [2]
    assert left(tmp_path) == [1, 3]
    assert numbers(runs[0]) == [1]


def test_rover_that_is_armed_meanwhile_keeps_the_runs_that_are_left(tmp_path: Path) -> None:
    for number in range(1, 6):
        make(tmp_path, number)
    asked = iter([True, True, False, False])
    found = prune(tmp_path, NONE_MB, lambda: next(asked))
    assert (len(found.deleted), found.trouble) == (2, None)


def test_only_folders_of_this_user_that_are_runs_are_touched_and_no_symlink_is_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs, elsewhere = tmp_path / "logs", tmp_path / "elsewhere"
    make(logs, 9)
    (logs / "00001-20261101T000000Z").symlink_to(make(elsewhere, 1))
    inside = make(logs, 2)
    (inside / "run.00002.jsonl").symlink_to(elsewhere / "00001-20261101T000000Z" / "run.00001.jsonl")
    (logs / ".deleting-00003-20261101T000000Z").symlink_to(elsewhere / "00001-20261101T000000Z")
    (logs / "forest-pledge-00004").mkdir()
    (logs / "00005-20261101T000000Z").touch()
    assert deleted(logs) == []
    assert numbers(elsewhere / "00001-20261101T000000Z") == [1]
    make(logs, 6)
    hidden = make(logs, 7).rename(logs / ".deleting-00007-20261101T000000Z")
    uid = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: uid + 1)
    assert deleted(logs) == [], "another user's"
    assert hidden.exists()


def test_run_whose_folder_cannot_be_renamed_is_told_and_the_next_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in (1, 2, 3):
        make(tmp_path, number)
    real = retention._delete

    def delete(logs: int, name: str) -> bool:
        if name.startswith("00001"):
            raise PermissionError(13, "Permission denied")
        return real(logs, name)

    monkeypatch.setattr(retention, "_delete", delete)
    found = prune(tmp_path, NONE_MB)
    assert [name[:5] for name in found.deleted] == ["00002"]
    assert "00001-20261101T000000Z: Permission denied" in str(found.trouble)


def test_what_a_power_cut_left_takes_no_run_with_it_that_a_person_has_put_back(tmp_path: Path) -> None:
    (tmp_path / ".deleting-00001-20261101T000000Z").mkdir()
    runs = [make(tmp_path, number) for number in (1, 2)]
    assert deleted(tmp_path, size_mb(*runs)) == []
    assert left(tmp_path) == [1, 2]
    assert not list(tmp_path.glob(".*"))


# -- power cuts ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", range(24))
def test_power_cut_at_any_change_leaves_whole_runs_and_the_next_deletion_ends_it(tmp_path: Path, call: int) -> None:
    for number in (1, 2, 3):
        make(tmp_path, number, parts=2)
    with power_cut_at(call):
        prune(tmp_path, NONE_MB)
    for run in run_folders(tmp_path):
        assert numbers(run) == [1, 2], "half a run"
    assert run_number(new_run_folder(tmp_path)) == 4
    prune(tmp_path, NONE_MB)
    assert left(tmp_path) == [], "the newest has no log yet"
    assert not list(tmp_path.glob(".*"))
