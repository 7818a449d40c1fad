"""Old runs are deleted only where a person wants it, never the wrong ones, and a power cut leaves no half of one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fieldlog.disks import power_cut_at
from tests.fieldlog.lines import event, header, numbers, tick
from wayfarer.config.rover_file import LogSettings
from wayfarer.fieldlog.clock import CLOCK_SET_S
from wayfarer.fieldlog.folders import new_run_folder, run_folders, run_number
from wayfarer.fieldlog.retention import prune
from wayfarer.fieldlog.run_ages import DAY_S, StoredRun, ages_s, over_limits

NOW_S = 1_795_000_000.0  # 18 November 2026
YEAR_S = 365 * DAY_S
OLD = LogSettings(keep_days=10)


def make(logs: Path, number: int, days: float, *, parts: int = 1, marked: bool = False) -> Path:
    """Make a run that was last written so many days ago; each of its files has 200 to 300 bytes."""
    run = logs / f"{number:05d}-20261101T000000Z"
    run.mkdir(parents=True)
    for part in range(1, parts + 1):
        lines = [header(part), event(part) if marked else tick(part)]
        file = run / ("run.jsonl" if part == parts else f"run.{part:05d}.jsonl")
        file.write_bytes(b"".join(line + b"\n" for line in lines))
        os.utime(file, (NOW_S, NOW_S - days * DAY_S))
    return run


def left(logs: Path) -> list[int | None]:
    return [run_number(run) for run in run_folders(logs)]


def test_runs_that_are_too_old_go_and_the_newest_stays_however_old(tmp_path: Path) -> None:
    for number, days in ((1, 40), (2, 11), (3, 9), (4, 0.5)):
        make(tmp_path, number, days, parts=number)
    found = prune(tmp_path, OLD, NOW_S)
    assert [name[:5] for name in found.deleted] == ["00001", "00002"]
    assert (found.left, found.trouble) == (2, None)
    assert left(tmp_path) == [3, 4]
    assert prune(tmp_path, OLD, NOW_S + 100 * DAY_S).deleted[0].startswith("00003")
    assert left(tmp_path) == [4]
    assert [path.name for path in tmp_path.iterdir()] == ["00004-20261101T000000Z"], "nothing hidden is left"


def runs_of(*days_mb: tuple[float, float]) -> list[StoredRun]:
    return [
        StoredRun(f"{n:05d}-20261101T000000Z", mb, NOW_S - days * DAY_S, deletable=True)
        for n, (days, mb) in enumerate(days_mb, 1)
    ]


def test_runs_beyond_the_size_go_oldest_first_but_none_of_the_last_day() -> None:
    def over(*days_mb: tuple[float, float], keep_mb: float) -> list[int]:
        found = over_limits(runs_of(*days_mb), LogSettings(keep_mb=keep_mb), NOW_S)
        return [int(run.name[:5]) for run in found]

    assert over((9, 500), (8, 500), (7, 500), (0, 1), keep_mb=1001) == [1]
    assert over((9, 500), (8, 500), (7, 500), (0, 1), keep_mb=1000) == [1, 2]
    assert over((9, 500), (0.9, 500), (0.8, 500), (0, 1), keep_mb=10) == [1]
    assert over((9, 500), (8, 500), keep_mb=2000) == []
    runs = runs_of((9, 500), (8, 500), (0, 1))
    left = over_limits(runs, LogSettings(keep_mb=600), NOW_S, lambda name: name != runs[0].name)
    assert left == [runs[1]], "one that somebody has marked takes its space"


def test_a_rover_that_works_for_months_stays_within_its_limits() -> None:
    """Three runs of half a GB a day, and a clock that is years wrong for a week."""
    settings, stored, most_mb = LogSettings(keep_days=30, keep_mb=8000), [], 0.0
    for number in range(3 * 120):
        day = number / 3
        now_s = NOW_S + day * DAY_S + (10 * YEAR_S if 50 <= day < 57 else 0.0)
        stored.append(StoredRun(f"{number:05d}-20261101T000000Z", 500.0, now_s, deletable=True))
        over = over_limits(stored, settings, now_s)
        stored = [run for run in stored if run not in over]
        most_mb = max(most_mb, sum(run.mb for run in stored))
    assert most_mb == 8000.0
    assert len(stored) == 16


def test_without_a_setting_nothing_is_deleted(tmp_path: Path) -> None:
    for number in (1, 2):
        make(tmp_path, number, 3000)
    assert prune(tmp_path, LogSettings(), NOW_S).deleted == ()
    assert left(tmp_path) == [1, 2]
    assert prune(tmp_path / "gone", OLD, NOW_S).trouble is None


def test_dry_run_says_what_would_go_and_changes_nothing(tmp_path: Path) -> None:
    make(tmp_path, 1, 40)
    make(tmp_path, 2, 40, marked=True)
    make(tmp_path, 3, 0)
    assert [name[:5] for name in prune(tmp_path, OLD, NOW_S, dry_run=True).deleted] == ["00001"]
    assert left(tmp_path) == [1, 2, 3]
    assert not list(tmp_path.glob("*/keep"))


def test_what_a_person_marked_renamed_or_added_to_stays_and_so_does_the_open_run(tmp_path: Path) -> None:
    marked, kept, named, opened, photo = (make(tmp_path, number, 40) for number in range(1, 6))
    make(tmp_path, 6, 0)
    (marked / "run.jsonl").write_bytes(header(1) + b"\n" + event(1) + b"\n")
    os.utime(marked / "run.jsonl", (NOW_S, NOW_S - 40 * DAY_S))
    (kept / "keep").touch()
    named.rename(f"{named} hit the big log")
    (photo / "photos").mkdir()
    assert prune(tmp_path, OLD, NOW_S, opened.name).deleted == ()
    assert (marked / "keep").exists(), "its log is searched once"
    (kept / "keep").unlink()
    assert prune(tmp_path, OLD, NOW_S).deleted == (kept.name, opened.name)


def test_only_folders_of_this_user_that_are_runs_are_touched_and_no_symlink_is_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs, elsewhere = tmp_path / "logs", tmp_path / "elsewhere"
    make(logs, 9, 0)
    (logs / "00001-20261101T000000Z").symlink_to(make(elsewhere, 1, 40))
    inside = make(logs, 2, 40)
    (inside / "run.00001.jsonl").symlink_to(elsewhere / "00001-20261101T000000Z" / "run.jsonl")
    (logs / ".deleting-00003-20261101T000000Z").symlink_to(elsewhere / "00001-20261101T000000Z")
    (logs / "forest-pledge-00004").mkdir()
    (logs / "00005-20261101T000000Z").touch()
    assert prune(logs, OLD, NOW_S).deleted == ()
    assert numbers(elsewhere / "00001-20261101T000000Z") == [1]
    make(logs, 6, 40)
    uid = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: uid + 1)
    assert prune(logs, OLD, NOW_S).deleted == (), "another user's"


# -- clocks ----------------------------------------------------------------------------------------------------------


def test_clock_that_was_never_set_deletes_nothing_and_says_so(tmp_path: Path) -> None:
    make(tmp_path, 1, 400)
    make(tmp_path, 2, 300)
    found = prune(tmp_path, LogSettings(keep_days=1, keep_mb=10), 86_400.0 * 30)
    assert (found.deleted, found.trouble) == ((), "no run is deleted while the clock is not set")


@pytest.mark.parametrize("wrong_s", [-NOW_S, -10 * YEAR_S, -YEAR_S, YEAR_S, 10 * YEAR_S])
@pytest.mark.parametrize("runs_with_it", [0, 1, 3])
def test_clock_that_is_years_wrong_makes_no_run_of_today_old(wrong_s: float, runs_with_it: int) -> None:
    """Three runs of an hour ago; then the clock is wrong, perhaps for some runs, and is asked then or right again."""
    hour_s = 3600.0
    times = [NOW_S - hour_s] * 3 + [NOW_S + wrong_s + n for n in range(runs_with_it)]
    for asked_s in (NOW_S + wrong_s + 10 * hour_s, NOW_S + hour_s):
        stored = [StoredRun(str(n), 900.0, time_s, deletable=True) for n, time_s in enumerate([*times, asked_s])]
        assert over_limits(stored, LogSettings(keep_days=1, keep_mb=10), asked_s) == []


def test_runs_age_as_time_passes_in_spite_of_steps_between_them() -> None:
    """An unset clock between two runs, a year ahead at the third, right again; a day passes between the others."""
    days = [0.0, -1e5, 1.0, 366.0, 367.0, 2.0, 3.0]
    ages = ages_s([NOW_S + each * DAY_S for each in days], NOW_S + 4 * DAY_S)
    assert [each / DAY_S for each in ages] == [4.0, 4.0, 3.0, 3.0, 2.0, 2.0, 1.0]
    assert ages_s([NOW_S - 200 * DAY_S], NOW_S) == [0.0], "a winter in the shed"


@given(st.lists(st.floats(0.0, 4e9), max_size=8), st.floats(CLOCK_SET_S, 4e9))
def test_age_is_never_negative_and_falls_from_run_to_run(times_s: list[float], now_s: float) -> None:
    ages = ages_s(times_s, now_s)
    assert ages == sorted(ages, reverse=True)
    assert not ages or ages[-1] >= 0.0


# -- power cuts ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", range(24))
def test_power_cut_at_any_change_leaves_whole_runs_and_the_next_deletion_ends_it(tmp_path: Path, call: int) -> None:
    for number, days in ((1, 40), (2, 40), (3, 0)):
        make(tmp_path, number, days, parts=2)
    with power_cut_at(call):
        prune(tmp_path, OLD, NOW_S)
    for run in run_folders(tmp_path):
        assert numbers(run) == [1, 2], "half a run"
    assert run_number(new_run_folder(tmp_path)) == 4
    prune(tmp_path, OLD, NOW_S)
    assert left(tmp_path) == [3]
    assert not list(tmp_path.glob(".*"))
