"""The report of one run, from whole logs and from what a power cut leaves of one."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from bokeh.models import Scatter

from tests.views.page.outline import Outline
from tests.views.run_report.logs import (
    ARMED,
    HEADER,
    OUTCOME,
    WORLD,
    bare,
    data_of,
    drawn,
    drive,
    episode,
    fix,
    page_of,
    text_of,
    tick,
    titles,
    without,
    write_log,
)
from tests.views.text.records import event, record
from wayfarer.cli import report as command
from wayfarer.errors import BadInput
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.schema import Record
from wayfarer.views.run_report import words
from wayfarer.views.run_report.data import RunData, read_run
from wayfarer.views.run_report.events import event_marks, is_trouble
from wayfarer.views.run_report.map import map_plot
from wayfarer.views.run_report.quantities import PANELS, panels_of
from wayfarer.views.run_report.run import write_comparison, write_run_report
from wayfarer.views.run_report.series import Line
from wayfarer.views.run_report.tables import (
    anomalies_table,
    conditions_table,
    episodes_table,
    events_list,
    sensors_table,
    settings_table,
)
from wayfarer.views.run_report.track import track_of, tracks_of
from wayfarer.views.text.summary import summarise
from wayfarer.views.text.summary_text import summary_facts

HOSTILE = "</script><script>alert('&')</script>"


def line_of(name: str, data: RunData) -> Line | None:
    """A line of the time panels; None where the log does not have it."""
    (quantity,) = (each for panel in PANELS for each in panel.quantities if each.name == name)
    return quantity.line(data)


def check_page(page: str) -> None:
    assert all(re.match(r"geo:|https://www\.openstreetmap\.org/", link) for link in Outline(page).links)
    assert "@import" not in bare(page)
    assert "url(" not in bare(page)


def test_page_tells_what_the_summary_tells_with_goal_and_seed(tmp_path: Path) -> None:
    text = text_of(page_of(tmp_path, HEADER, ARMED, *drive(), tail=b'{"record":"tick","n":81,"t_s":104.0,"comp'))
    reader = RunReader(tmp_path / "00001-run")
    facts = summary_facts("00001-run", summarise(reader), reader.damage, utc=True)
    assert " ".join(" ".join([title, *lines]) for title, lines in facts) in text
    assert "from 2027-01-15 08:00:00 UTC" in text
    assert "goal 0° seed 7" in text


@pytest.fixture(scope="module")
def eventful(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunData, str]:
    """A drive with something of everything, and its page."""
    ticks = drive()
    for held in ticks[20:40]:
        held["level"] = "hold"
    ticks[60]["anomalies"] = ["nose_up"]
    ticks[70]["moon_deg"] = 1.0
    told = [
        event("health", 0.99, level="hold", cause="operator_hold"),
        event("mark", 1.0, text="hit log"),
        event("mark", 2.0, text=HOSTILE),
        event("health", 2.0, level="hold", cause="compass_stale"),
        *(record("board", at_s, battery_v=12.0 - at_s) for at_s in (1.01, 2.01)),
        *(fix(at_s, at_s, 3.0 if at_s < 3.0 else None) for at_s in (1.0, 2.0, 3.0)),
    ]
    folder = tmp_path_factory.mktemp("eventful")
    page = page_of(folder, HEADER, *sorted([ARMED, *ticks, *told], key=lambda each: float(each["t_s"])), OUTCOME)
    return read_run(folder / "00001-run"), page


def test_page_is_whole_needs_nothing_else_and_has_all_tables(eventful: tuple[RunData, str]) -> None:
    data, page = eventful
    check_page(page)
    assert HOSTILE not in page
    for table in (anomalies_table, episodes_table, conditions_table, events_list, sensors_table):
        assert table(data) in page


def test_marks_are_numbered_in_list_map_and_time_series(eventful: tuple[RunData, str]) -> None:
    _, page = eventful
    assert f"mark 1: hit log 0:00:02.0 mark 2: {HOSTILE}" in unescape(text_of(page))
    assert drawn(page).count('["mark 1: hit log","mark 2: ') == 2


def test_trouble_stands_out_and_an_operators_hold_does_not(eventful: tuple[RunData, str]) -> None:
    _, page = eventful
    (trouble,) = re.findall(r"<strong>(.*?)</strong>", page)
    assert trouble.startswith("Wheels held until this clears: the compass is silent. This ends when ")


def test_held_wheels_the_battery_and_a_new_key_are_in_the_time_series(eventful: tuple[RunData, str]) -> None:
    _, page = eventful
    assert '"Wheels held until this clears, for 1.0 s"' in drawn(page)
    assert {"battery, V", "moon_deg"} <= set(titles(page))


def test_way_is_laid_onto_the_fixes_and_its_end_opens_in_a_map(eventful: tuple[RunData, str]) -> None:
    _, page = eventful
    assert "Dead reckoning is laid onto all fixes at once: turned by 0.0°" in text_of(page)
    assert "End of the fitted path (the last fix is above, under “where”): 47.0000" in text_of(page)
    latitude, longitude = re.findall(r'href="geo:([\d.]+),([\d.]+)\?q=', page)[0]
    assert float(latitude) == pytest.approx(47.0 + 3.95 / 111_320.0, abs=2e-6)  # the end of the way, not the last fix
    assert float(longitude) == pytest.approx(8.0, abs=2e-6)
    assert f"https://www.openstreetmap.org/?mlat={latitude}&amp;mlon={longitude}#map=18/" in page


def test_same_log_gives_the_same_bytes(tmp_path: Path) -> None:
    run = write_log(tmp_path / "1-run", [HEADER, *episode(), event("hold", 1.0), fix(2.0, 1.0), OUTCOME])
    first, second = (write_run_report(run, tmp_path / each / "page.html").read_bytes() for each in "ab")
    assert first == second


@pytest.mark.long
def test_an_hour_of_noise_fits_into_three_megabytes(tmp_path: Path) -> None:
    noise = Random(1)
    changing = ("heading_deg", "goal_heading_deg", "counter_deg", "pitch_deg", "roll_deg")
    ticks = [
        tick(0.05 * at, **{name: noise.uniform(0.0, 360.0) for name in changing},
             applied_left=noise.random(), applied_right=noise.random(), phase=noise.choice(["follow", "probe"]))
        for at in range(72_000)
    ]  # fmt: skip
    for each in ticks:
        each["motion"]["forward_m"] = noise.uniform(0.0, 0.05)
    assert len(page_of(tmp_path, HEADER, *ticks, OUTCOME)) < 3e6


def test_anomalies_and_episodes_are_counted_by_cause(tmp_path: Path) -> None:
    data = data_of(tmp_path, HEADER, *episode(), OUTCOME)
    assert "stalled 1 50%" in text_of(anomalies_table(data))
    assert "nose up 1 50%" in text_of(anomalies_table(data))
    assert "1 0:00:02.0 right 1 1.6 1.6 the heading is the goal heading again" in text_of(episodes_table(data))


def test_conditions_are_told_with_their_time_and_response_while_the_rover_was_armed(tmp_path: Path) -> None:
    blind = {"level": "degrade", "cause": "motion_lost"}
    ticks = [tick(0.05 * at, **(blind if at >= 20 else {})) for at in range(61)]
    told = text_of(conditions_table(data_of(tmp_path / "armed", HEADER, ARMED, *ticks)))
    assert "The motion sensor's picture has been too poor for seconds 0:00:02.0 it drives a stride ahead" in told
    told = text_of(conditions_table(data_of(tmp_path / "disarmed", HEADER, *ticks)))
    assert told == "While it was armed, nothing was wrong with the rover itself."


def test_a_hold_interrupts_an_episode_and_arming_ends_it(tmp_path: Path) -> None:
    ticks = episode()
    for held in ticks[50:60]:
        held["phase"] = "halt"
    told = text_of(episodes_table(data_of(tmp_path / "held", HEADER, *ticks)))
    assert told.count("the heading is the goal heading again") == 1
    armed = [*ticks[:50], event("armed", 2.49, goal_heading_deg=0.0), *ticks[50:]]
    told = text_of(episodes_table(data_of(tmp_path / "armed", HEADER, *armed)))
    assert "1 0:00:02.0 right 1 0.5 0.4 armed 2 0:00:03.0" in told


def test_sensors_are_told_by_rate_gap_and_failures(tmp_path: Path) -> None:
    ticks = drive()
    for deaf in ticks[20:40]:
        deaf["compass"] = ticks[19]["compass"]
    for blind in ticks[:8]:
        blind["motion"] = {**blind["motion"], "quality": 0.1}
    failed = event("sensor_failed", 1.5, sensor="compass", error="no answer", retry_in_s=0.1)
    text = text_of(sensors_table(data_of(tmp_path, HEADER, *ticks, failed, OUTCOME)))
    assert "compass 60 14.9 20 1.05 1" in text
    assert "motion 80 20.0 20 0.05 10.0% 0" in text


def test_a_sensor_that_fell_silent_for_good_has_a_gap_up_to_the_end(tmp_path: Path) -> None:
    ticks = drive()
    for deaf in ticks[20:]:
        deaf["compass"] = ticks[19]["compass"]
    assert "compass 20 20.0 20 3.05 0" in text_of(sensors_table(data_of(tmp_path, HEADER, *ticks, OUTCOME)))


def test_simulated_run_shows_the_forest_and_how_far_dead_reckoning_drifted(tmp_path: Path) -> None:
    truth = [record("truth", 0.2 * step, x_m=25.0, y_m=12.5 + 0.3 * step, heading_deg=0.0) for step in range(20)]
    records = sorted([*drive(), *truth], key=lambda each: float(each["t_s"]))
    page = page_of(tmp_path, {**HEADER, "simulated": True, "world": WORLD}, *records, OUTCOME)
    check_page(page)
    assert "At the end dead reckoning is 1.8 m from the true path" in text_of(page)
    assert '"Rect"' in drawn(page)  # the fallen trunk


def test_simulated_run_without_a_forest_says_so(tmp_path: Path) -> None:
    truth = record("truth", 0.0, x_m=25.0, y_m=12.5)
    page = page_of(tmp_path, {**HEADER, "simulated": True, "world": None}, truth, *drive(), OUTCOME)
    assert words.NO_FOREST in text_of(page)


@pytest.mark.parametrize("world", [[], {}, {**WORLD, "trunks_m": [[1, None]]}, {**WORLD, "start_m": "here"}])
def test_world_that_cannot_be_read_is_no_forest(tmp_path: Path, world: object) -> None:
    truth = record("truth", 0.0, x_m=25.0, y_m=12.5)
    data = data_of(tmp_path, {**HEADER, "simulated": True, "world": world}, truth, *drive(), OUTCOME)
    assert track_of(data).forest is None


# -- what a log may lack -----------------------------------------------------------------------------------------


def test_log_without_ticks_says_so(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, event("opened", 0.1, parts=["compass"]), OUTCOME)
    check_page(page)
    assert words.NO_TICKS in text_of(page)
    assert words.NO_WAY in text_of(page)


def test_log_without_a_heading_still_has_time_series(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, *(tick(0.05 * step, heading_deg=None) for step in range(40)), OUTCOME)
    assert words.NO_WAY in text_of(page)
    assert {"speed, m/s", "duty"} <= set(titles(page))


def test_log_of_which_nothing_can_be_read_is_refused(tmp_path: Path) -> None:
    run = write_log(tmp_path / "1-run", [], b"hello\n")
    with pytest.raises(BadInput, match="nothing in this log can be read"):
        write_run_report(run)
    assert [path.name for path in run.iterdir()] == ["run.jsonl"]


def test_lost_beginning_is_no_start(tmp_path: Path) -> None:
    def on_map(name: str, *records: Record) -> tuple[bool, bool]:
        """Whether the map has a star at the start, and whether it says that something is lost."""
        track = track_of(data_of(tmp_path / name, *records))
        scatters: Any = map_plot([track]).select({"type": Scatter})
        return "star" in {each.marker for each in scatters}, words.GAPS in words.track_caption([track])

    assert on_map("late", {**HEADER, "part": 2}, *without(drive(), 0, 40)) == (False, False)
    assert on_map("headless", *without(drive(), 0, 40)) == (False, False)
    assert on_map("gap", HEADER, *without([ARMED, *drive()], 20, 60)) == (True, True)
    assert on_map("whole", HEADER, ARMED, *drive()) == (True, False)


def test_log_of_one_tick_makes_a_page(tmp_path: Path) -> None:
    check_page(page_of(tmp_path, HEADER, tick(0.0)))


def test_ticks_that_say_nothing_make_a_page(tmp_path: Path) -> None:
    bare = [{"record": "tick", "t_s": 100.0 + step} for step in range(3)]
    header = {"record": "run", "t_s": 100.0, "schema": 2}
    assert words.NO_TICKS in text_of(page_of(tmp_path / "even", header, *bare))
    check_page(page_of(tmp_path / "uneven", header, *bare, tick(3.01)))


def test_time_without_ticks_is_marked(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, *drive(1.0), *(tick(31.0 + 0.05 * step) for step in range(20)), OUTCOME)
    assert '"no ticks for 30.1 s"' in drawn(page)
    assert "0:00:31.0 no ticks for 30.1 s" in text_of(page)
    (event,) = (data := read_run(tmp_path / "00001-run")).events
    assert is_trouble(event)
    assert [(round(each.t_s, 6), each.layer) for each in event_marks(data)] == [(0.95, "trouble")], "it began there"


def test_way_and_lines_are_broken_where_no_ticks_came(tmp_path: Path) -> None:
    boards = [record("board", at_s, battery_v=12.0) for at_s in (0.5, 6.5)]
    ticks = [*drive(1.0), *(tick(6.0 + 0.05 * step) for step in range(20))]
    records = sorted([*ticks, *boards], key=lambda each: float(each["t_s"]))
    data = data_of(tmp_path, HEADER, *records, OUTCOME)
    assert np.flatnonzero(np.isnan(track_of(data).path.east_m)).tolist() == [20]
    assert [int(np.isnan(line[1]).sum()) for name in ("heading", "battery") if (line := line_of(name, data))] == [1, 1]


def test_battery_is_not_drawn_across_a_silence_of_the_board(tmp_path: Path) -> None:
    boards = [record("board", at_s, battery_v=12.0) for at_s in (0.0, 10.0, 20.5)]
    ticks = [tick(0.5 * step) for step in range(42)]
    records = sorted([*ticks, *boards], key=lambda each: float(each["t_s"]))
    line = line_of("battery", data_of(tmp_path, HEADER, *records))
    assert line is not None
    np.testing.assert_array_equal(line[1], [12.0, 12.0, np.nan, 12.0])


def test_goals_are_those_that_the_rover_took(tmp_path: Path) -> None:
    def goal(name: str, *records: Record) -> str:
        return dict(words.facts(data_of(tmp_path / name, HEADER, *records, OUTCOME), name))["goal"]

    ticks = drive()
    armed = [event("armed", 1.0, goal_heading_deg=20.0), event("goal", 2.0, goal_heading_deg=359.7)]
    armed += [event("goal", 2.5, goal_heading_deg=0.0), *ticks[60:]]
    assert goal("whole", *ticks[:20], *armed) == "20°, then 0°"
    assert goal("late", *ticks) == "0°"
    assert goal("never armed", *({**each, "phase": "halt", "why": "halt"} for each in ticks)) == "none"


def test_further_numbers_are_columns_of_all_ticks_and_only_so_many(tmp_path: Path) -> None:
    ticks = [tick(0.0), tick(0.05, moon_deg=1.0), tick(0.1, moon_deg="new"), tick(0.15, moon_deg=2, sun=True)]
    data = data_of(tmp_path / "few", HEADER, *ticks)
    assert list(data.further) == ["moon_deg"]
    np.testing.assert_array_equal(data.further["moon_deg"], [np.nan, 1.0, np.nan, 2.0])
    many = {f"\x1b{number}": number for number in range(1000)}
    panels = panels_of([data_of(tmp_path / "many", HEADER, *drive(1.0), tick(1.0, **many))])
    assert [panel.title for panel in panels[-2:]] == ["\\x1b10", "\\x1b11"]


def test_lost_records_are_no_late_tick(tmp_path: Path) -> None:
    late = [*drive(1.0), tick(1.5), *(tick(1.55 + 0.05 * step) for step in range(20))]
    assert line_of("period", data_of(tmp_path / "late", HEADER, *late)) is not None
    numbered = [{**each, "n": number + (6 if number > 19 else 1)} for number, each in enumerate(late)]
    data = data_of(tmp_path / "lost", HEADER, *numbered)
    assert line_of("period", data) is None
    assert "5 records are missing" in str(data.damage)


ODD: list[Record] = [
    {"heading_deg": "north", "phase": 7, "why": None, "anomalies": "touched", "level": ["hold"], "side": "left"},
    {"heading_deg": 1e300, "applied_left": None, "applied_right": "full", "counter_deg": {}, "travelled_m": None},
    {"compass": 5, "motion": [], "contact": {"t_s": None}, "anomalies": [None, "eaten", 3]},
    {"motion": {"forward_m": None}, "compass": {"t_s": "now"}, "pitch_deg": None, "roll_deg": -1e15, "phase": "dance"},
    {"motion": {"t_s": 1e12, "forward_m": 1e12, "right_m": 0.0, "quality": 1.0}, "mood": "cheerful", "cause": 4},
    {"motion": {"t_s": 101.0, "forward_m": 5e9, "right_m": 0.0, "quality": 1.0}}, {"t_s": 1e300}, {"t_s": -1e15},
]  # fmt: skip


ODD_EVENTS = [
    event("", 0.2), event("mark", 0.3), event("mark", 0.4, text="\x1b[2J\n林 $x$ " + "long " * 100),
    event("goal", 0.5, goal_heading_deg=None), event("sensor_failed", 0.6), event("clock_step", 0.7, by_s="much"),
    event("armed", 0.8, goal_heading_deg="home"), {**event("x", 0.9), "name": None},
    {**fix(1.0, 0.0), "latitude_deg": None}, {**fix(1.1, 0.0), "latitude_deg": 99.0}, fix(1.2, 0.0, None),
    record("board", 1.0, battery_v=None, faults=None), record("truth", 1.0, x_m=None), record("computer", 1.0),
]  # fmt: skip
ODD_HEADERS: list[Record] = [
    {"config": None, "rover": "\x1b[31m\x00\uffff<b>", "seed": "\x07", "t_wall": None},
    {"config": {"vehicle": None, "safety": [], "board": 3, "control_hz": "fast"}, "t_wall": 1e300},
    {"config": {"control_hz": 0.0}, "rover": None, "algorithm": 3, "version": [], "seed": {}, "simulated": "yes"},
]  # fmt: skip


@pytest.mark.parametrize("header", ODD_HEADERS, ids=str)
def test_odd_values_never_break_the_page(tmp_path: Path, header: Record) -> None:
    """Many are in one log; which value breaks which reader is tried in ``tests/fuzz/on_logs.py``."""
    odd = [{**tick(1.0 + 0.05 * at), **each} for at, each in enumerate(ODD)]
    records = [*drive(1.0), *ODD_EVENTS, *odd, *drive(3.0)[30:]]
    check_page(page_of(tmp_path, HEADER | header, *records, {**OUTCOME, "reason": None, "text": 4}))


# -- two runs ----------------------------------------------------------------------------------------------------


def test_two_runs_stand_beside_each_other_with_what_changed(tmp_path: Path) -> None:
    other = {**HEADER, "config": {**HEADER["config"], "control_hz": 10.0, "gym": {"seed": 3}}}
    first = write_log(tmp_path / "00017-20261121T061405Z", [HEADER, *episode(), OUTCOME])
    second = write_log(tmp_path / "00018-20261121T061405Z", [other, *drive(3.0), OUTCOME])
    out = write_comparison(first, second)
    assert out == second / "report-17-18.html"
    page = out.read_text(encoding="utf-8")
    check_page(page)
    text = text_of(page)
    assert "17 18 control_hz 20.0 10.0 gym.seed not there 3" in text
    assert "tilt_deg" not in text
    assert re.search(r'<tr class="differs"><th scope="row">anomalies</th><td data-column="17">[^<]*1[^<]*</td>', page)
    assert '"path-1"' in drawn(page)


def test_folder_that_only_begins_with_a_number_is_not_called_by_it(tmp_path: Path) -> None:
    """``wayfarer logs list`` and the names of runs in commands know it by the folder's name too."""
    daemons, own = tmp_path / "00017-20261121T061405Z", tmp_path / "17-foo"
    assert [words.number_of(run) for run in (daemons, own)] == ["17", "17-foo"]


def test_runs_whose_maps_nothing_joins_begin_at_one_place(tmp_path: Path) -> None:
    truth = [record("truth", 0.2 * step, x_m=25.0, y_m=12.5 + 0.3 * step, heading_deg=0.0) for step in range(20)]
    simulated = [{**HEADER, "simulated": True, "world": WORLD}, *drive(4.0), *truth]
    simulated.sort(key=lambda each: float(each["t_s"]))
    there = read_run(write_log(tmp_path / "1-run", [*simulated, OUTCOME]))
    outside = read_run(write_log(tmp_path / "2-run", [HEADER, *drive(4.0), OUTCOME]))
    apart = [(track.path.north_m[0], track.forest) for track in tracks_of([there, outside])]
    assert apart == [(0.0, None), (0.0, None)]
    assert [track.path.north_m[0] for track in tracks_of([there, there])] == [12.5, 12.5]


def test_same_rover_file_is_said_to_be_the_same(tmp_path: Path) -> None:
    runs = [data_of(tmp_path / name, HEADER, *drive(1.0), OUTCOME) for name in "ab"]
    assert words.SAME_SETTINGS in settings_table(runs, ["17", "18"])


def test_folder_without_a_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"run\.jsonl"):
        write_run_report(tmp_path)


# -- the command -------------------------------------------------------------------------------------------------


@pytest.fixture
def logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two runs; the present folder holds folders that are named as runs are called."""
    for number in (16, 17):
        write_log(tmp_path / "logs" / f"000{number}-20261121T061405Z", [HEADER, OUTCOME])
    for name in ("last", "17", "18"):
        (tmp_path / "here" / name).mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "logs"


@pytest.mark.parametrize(("what", "number"), [("16", 16), ("last", 17)])
def test_runs_number_goes_before_a_folder_of_that_name(logs: Path, what: str, number: int) -> None:
    command.report(what, logs=logs)
    assert [page.parent.name[:5] for page in logs.rglob("report.html")] == [f"000{number}"]


@pytest.mark.parametrize("what", ["18", "./17"])
def test_folder_is_a_campaign_where_no_run_has_its_name(logs: Path, what: str) -> None:
    with pytest.raises(BadInput, match="campaign"):
        command.report(what, logs=logs)
    assert not list(logs.rglob("report.html"))


def test_what_is_neither_run_nor_folder_is_refused_with_the_runs_there_are(logs: Path) -> None:
    with pytest.raises(BadInput, match="00016-20261121T061405Z to 00017-20261121T061405Z"):
        command.report("19", logs=logs)


def test_command_writes_the_page_where_it_is_told(
    logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine" / "page.html"
    command.report("17", out=out, logs=logs)
    assert capsys.readouterr().out == f"the report is {out}\n"
    assert {path.name for path in out.parent.iterdir()} == {"page.html"}
    assert {path.name for path in logs.rglob("*") if path.is_file()} == {"run.jsonl"}


def test_command_takes_two_runs(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command.report("16", "17", logs=logs)
    (page,) = logs.rglob("report-16-17.html")
    assert capsys.readouterr().out == f"the report is {page}\n"
