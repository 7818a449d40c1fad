"""The wall time of a log: right wherever the receiver knows it, and neither order nor durations depend on it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.fieldlog.lines import read, standing
from wayfarer.fieldlog.clock import began_wall_s
from wayfarer.fieldlog.folders import new_run_folder, newest_run
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.log_clock import ROLL_OVER_S, LogClock, believed_utc_s
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.writer import RunFiles
from wayfarer.hal import PositionFix

NOON_S = 1_795_003_200.0  # 2026-11-18T12:00Z; the true time at which the loop's clock is 0
YEAR_S = 365.25 * 86_400.0
LATE_S = 0.4  # a report comes after its moment


def fix(t_s: float, wrong_by_s: float = 0.0) -> PositionFix:
    return PositionFix(t_s, 50.9, -1.4, 3.0, NOON_S + t_s - LATE_S + wrong_by_s)


def driven(folder: Path, computer: Callable[[float], float], receiver_wrong_by_s: float = 0.0) -> list[Record]:
    """A log of six seconds, two ticks in each; from the second one on the receiver has a fix."""
    log = FieldLog(RunFiles(folder), {}, wall=computer)
    for second in range(6):
        log.tick(standing(float(second)))
        if second >= 2:
            log.position(fix(second + 0.2, receiver_wrong_by_s))
        log.tick(standing(second + 0.5))
    log.close("requested", "enough")
    found, its = read(folder)
    assert its.damage.lines == its.damage.missing == 0
    return found


def clock_events(records: list[Record]) -> list[tuple[str, Any]]:
    return [(each["name"], each.get("by_s")) for each in records if each["record"] == "event"]


@pytest.mark.parametrize(
    "by_s", [10 * YEAR_S, -10 * YEAR_S, -NOON_S, -3600.0, 6.5], ids=["later", "earlier", "1970", "hour", "seconds"]
)
def test_log_of_a_computer_without_the_time_follows_the_receiver(tmp_path: Path, by_s: float) -> None:
    found = driven(tmp_path, lambda t_s: NOON_S + t_s + by_s)
    assert clock_events(found) == [("clock_wrong", pytest.approx(by_s + LATE_S))]
    told = next(index for index, each in enumerate(found) if each.get("name") == "clock_wrong")
    assert all(abs(each["t_wall"] - NOON_S - each["t_s"] - by_s) < 0.01 for each in found[:told])
    assert all(abs(each["t_wall"] - NOON_S - each["t_s"]) < 1.0 for each in found[told:])
    assert began_wall_s(found[0], found[-1]) == pytest.approx(NOON_S, abs=1.0)
    ticks = [each["t_s"] for each in found if each["record"] == "tick"]
    assert ticks == [0.5 * count for count in range(12)], "neither order nor durations change"


@pytest.mark.parametrize("by_s", [0.0, 2.0, -2.0])
def test_computer_that_has_the_time_is_followed(tmp_path: Path, by_s: float) -> None:
    found = driven(tmp_path, lambda t_s: NOON_S + t_s + by_s)
    assert clock_events(found) == []
    assert {each["t_wall"] - each["t_s"] for each in found} == {NOON_S + by_s}


def test_receiver_that_is_older_than_the_roll_over_of_its_weeks_is_put_right(tmp_path: Path) -> None:
    found = driven(tmp_path, lambda t_s: t_s, -ROLL_OVER_S)
    assert found[-1]["t_wall"] - NOON_S - found[-1]["t_s"] == pytest.approx(-LATE_S)
    assert {each["utc_s"] < 1.2e9 for each in found if each["record"] == "position"} == {True}, "as it came"


@pytest.mark.parametrize("utc_s", [None, 0.0, 315_964_800.0, 935_280_000.0, 2.4e9, -1e11, 1e12])
def test_date_that_cannot_be_is_not_believed(utc_s: float | None) -> None:
    """Not 1980 or 1999 either, with which receivers begin that know no week yet."""
    assert believed_utc_s(utc_s) is None


def test_one_wild_report_and_a_repeated_one_change_nothing() -> None:
    clock = LogClock(lambda t_s: NOON_S + t_s)
    wild = fix(2.0, wrong_by_s=86_400.0)
    assert [clock.take(each) for each in (fix(1.0), wild, wild, wild, fix(3.0), fix(4.0))] == [None] * 6
    assert clock.wall_s(5.0) == NOON_S + 5.0


def test_clock_that_is_set_from_the_receiver_takes_over_without_a_jump(tmp_path: Path) -> None:
    """As chrony does, some time after the first fix."""
    found = driven(tmp_path, lambda t_s: NOON_S + t_s - (YEAR_S if t_s < 4.3 else 0.0))
    assert clock_events(found) == [
        ("clock_wrong", pytest.approx(LATE_S - YEAR_S)),
        ("clock_step", pytest.approx(YEAR_S)),
        ("clock_right", None),
    ]
    told = next(index for index, each in enumerate(found) if each.get("name") == "clock_wrong")
    assert all(abs(each["t_wall"] - NOON_S - each["t_s"]) < 1.0 for each in found[told:])


def test_run_that_begins_ten_years_before_the_last_one_is_still_the_newest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for wall_s in (NOON_S, NOON_S - 10 * YEAR_S, 0.0):
        monkeypatch.setattr("wayfarer.fieldlog.folders.wall_clock", lambda _, wall_s=wall_s: wall_s)
        begun = new_run_folder(tmp_path)
        FieldLog(RunFiles(begun), {}).close("requested", "enough")
        assert newest_run(tmp_path) == begun
    assert begun.name == "00003-19700101T000000Z"
