"""Logs as tables, read back as a spreadsheet would."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from tests.logview.records import HEADER, Json, drive, event, noted, outcome, record, tick, write
from wayfarer.export import ExportFormat
from wayfarer.export.tables import COLUMNS, without_formulas

COMPASS = {"t_s": 101.0, "heading_deg": 3.0, "pitch_deg": 1.0, "roll_deg": -1.0, "calibration": None}
CONTACT = {"t_s": 101.0, "sides": ["front", "left"], "obstacle_bearing_deg": 80.0}


def table(folder: Path, *records: Json) -> str:
    text = io.StringIO()
    ExportFormat.csv.write(write(folder / "run", [HEADER, *records]), text)
    return text.getvalue()


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_each_tick_is_a_row_with_flat_columns(tmp_path: Path) -> None:
    felt = tick(1.0, compass=COMPASS, contact=CONTACT, anomalies=["nose_up", "touched"], cause=None)
    (row,) = rows(table(tmp_path, felt))
    told = {column: row[column] for column in ("t_s", "heading_deg", "compass_heading_deg", "anomalies", "cause")}
    assert told == {
        "t_s": "101.0", "heading_deg": "0.0", "compass_heading_deg": "3.0", "anomalies": "nose_up; touched",
        "cause": "",
    }  # fmt: skip
    assert row["t_wall"] == "2027-01-15T08:00:01.000000Z"
    assert (row["contact_sides"], row["compass_calibration"], row["motion_quality"]) == ("front; left", "", "")


def test_every_table_has_the_same_columns_and_another_memory_is_added(tmp_path: Path) -> None:
    assert tuple(rows(table(tmp_path, *drive(0.0, 1.0)))[0]) == tuple(COLUMNS)
    assert tuple(rows(table(tmp_path / "2", tick(0.0), tick(1.0, mood="good")))[0]) == (*COLUMNS, "mood")


def test_what_others_say_stands_in_the_row_of_the_next_tick_and_only_there(tmp_path: Path) -> None:
    first, second = rows(
        table(
            tmp_path,
            record("board", 0.5, battery_v=12.1, faults=[]),
            event("armed", 0.6, "Armed: drives towards 20 degrees"),
            noted(0.7, "hit\nlog"),
            record("truth", 0.8, x_m=1.5, y_m=0.0, driven_m=0.0, slipping=True),
            tick(1.0),
            tick(2.0),
        )
    )
    assert (first["board_battery_v"], first["truth_x_m"], first["truth_slipping"]) == ("12.1", "1.5", "1")
    assert first["event"] == r"Armed: drives towards 20 degrees; Mark: hit\nlog"
    assert (second["board_battery_v"], second["truth_x_m"], second["event"]) == ("", "", "")


FORMULA = "=HYPERLINK(1)"


@pytest.mark.parametrize("key", ["phase", "why", "level", "cause", "mood"])
def test_text_of_a_log_is_no_formula(tmp_path: Path, key: str) -> None:
    (row,) = rows(table(tmp_path, tick(1.0, **{key: FORMULA})))
    assert row[key] == f"'{FORMULA}"


def test_neither_titles_lists_nor_events_are_formulas_and_numbers_stay(tmp_path: Path) -> None:
    felt = tick(1.0, anomalies=[FORMULA], wanted_left=-0.5, moods=[-1.5], **{FORMULA: -1.5, "+x": {"y": "-2"}})
    (row,) = rows(table(tmp_path, noted(0.5, f"x;{FORMULA}"), event(FORMULA, 0.6), felt))
    assert (row["anomalies"], row["wanted_left"], row["moods"]) == (f"'{FORMULA}", "-0.5", "-1.5")
    assert (row[f"'{FORMULA}"], row["'+x_y"]) == ("-1.5", "-2")
    assert row["event"] == f"Mark: x;'{FORMULA};' {FORMULA}"


def test_what_comes_after_the_last_tick_has_a_row_of_its_own(tmp_path: Path) -> None:
    *_, last = rows(table(tmp_path, tick(1.0), event("disarmed", 2.0, "Disarmed: enough"), outcome(3.0)))
    assert last["event"] == "Disarmed: enough; The run has ended: enough"
    assert (last["t_s"], last["heading_deg"]) == ("103.0", "")


def test_time_since_the_first_record_is_in_the_table(tmp_path: Path) -> None:
    times = [row["elapsed_s"] for row in rows(table(tmp_path, tick(1.0), tick(2.5), outcome(3.0)))]
    assert times == ["1.0", "2.5", "3.0"]


def test_path_is_in_the_table(tmp_path: Path) -> None:
    last = rows(table(tmp_path, *drive(0.0, 4.05, north_m=0.0, east_m=2.0)))[-1]
    assert (last["north_m"], last["east_m"]) == ("0.0", "2.0")
    (lost,) = rows(table(tmp_path / "2", tick(0.0, heading_deg=None, north_m=None, east_m=None)))
    assert (lost["north_m"], lost["east_m"]) == ("", "")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ('=HYPERLINK("http://x")', '\'=HYPERLINK("http://x")'),
        ("+1+1", "'+1+1"),
        ("-1+1", "'-1+1"),
        ("@SUM(1)", "'@SUM(1)"),
        ("\uff1d1", "'\uff1d1"),
        (" =1", "' =1"),
        ("\t=1", "'\t'=1"),  # some begin a cell after a tab
        ("a\t=1", "a\t'=1"),
        ("\ttext", "'\ttext"),
        ("\rtext", "'\r" + "text"),
        ("blocked;=1", "blocked;'=1"),
        ("blocked; @x; -y", "blocked;' @x;' -y"),
        ("blocked\n=1", "blocked\n'=1"),
        ("-1.5\n=1", "'-1.5\n'=1"),
    ],
)
def test_what_a_spreadsheet_would_run_is_quoted(text: str, shown: str) -> None:
    assert without_formulas(text) == shown


@pytest.mark.parametrize(
    "text",
    ["", "blocked", "nose_up; touched", "a=b", "Mark: =1", "-1.5", "+2", "-1e-05", "-inf", "-1.5; -2", "wheels; -0.5"],
)
def test_other_texts_and_numbers_stay(text: str) -> None:
    assert without_formulas(text) == text
