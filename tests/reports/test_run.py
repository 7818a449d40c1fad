"""The report of one run: what its page, its tables and its map tell."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path
from random import Random

import pytest

from tests.logview.records import event, noted, record
from tests.reports.logs import (
    ARMED,
    HEADER,
    OUTCOME,
    WORLD,
    by_time,
    check_page,
    data_of,
    drawn,
    drive,
    episode,
    fix,
    line_of,
    page_of,
    simulated_drive,
    text_of,
    tick,
    titles,
    write_log,
)
from wayfarer.fieldlog.reader import RunReader
from wayfarer.logview.summary import result_sentences, summarise, summary_facts
from wayfarer.reports.data import RunData, read_run
from wayfarer.reports.page.plots import Plots
from wayfarer.reports.panels import draw_panels
from wayfarer.reports.run import (
    NO_FOREST,
    anomalies_table,
    conditions_table,
    default_settings,
    episodes_table,
    events_list,
    own_settings_table,
    sensors_table,
    write_run_report,
)

HOSTILE = "</script><script>alert('&')</script>"


def test_page_tells_what_the_summary_tells_with_goal_and_seed(tmp_path: Path) -> None:
    text = text_of(page_of(tmp_path, HEADER, ARMED, *drive(), tail=b'{"record":"tick","n":81,"t_s":104.0,"comp'))
    reader = RunReader(tmp_path / "00001-run")
    facts = summary_facts("00001-run", summarise(reader), reader.damage, utc=True)
    assert " ".join(" ".join([title, *lines]) for title, lines in facts) in text
    assert "from 2027-01-15 08:00:00 UTC" in text
    assert "goal 0° seed 7" in text


def test_page_begins_with_how_the_run_ended_and_ends_with_its_facts_folded(tmp_path: Path) -> None:
    page = page_of(tmp_path, *by_time(HEADER, ARMED, *episode(), OUTCOME))
    assert "Requested: enough, after 0:00:05 and 4.5 m by dead reckoning, with 2 anomalies. Track" in text_of(page)
    assert page.index("<h2>Events") < page.index("<details") < page.index('<dl class="facts')


def test_result_of_a_log_that_was_cut_off_says_so_and_what_is_lost(tmp_path: Path) -> None:
    folder = write_log(tmp_path / "00001-run", [HEADER, ARMED], b"{torn\n")
    data = read_run(folder)
    assert list(result_sentences(data.summary, data.damage)) == [
        "The log ends after 0:00:00, with no anomaly; no outcome: the run was cut off, or is still running.",
        "Of its log, 1 line is torn.",
    ]


@pytest.fixture(scope="module")
def eventful(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunData, str]:
    """A drive with something of everything, and its page."""
    ticks = drive()
    for held in ticks[20:40]:
        held["level"] = "hold"
    ticks[60]["anomalies"] = ["nose_up"]
    ticks[70]["memory"]["moon_deg"] = 1.0
    told = [
        event("health", 0.99, "Held", "warning", level="hold", cause="operator_hold"),
        noted(1.0, "hit log"),
        noted(2.0, HOSTILE),
        event("health", 2.0, "Held: the compass is silent", "warning", level="hold", cause="compass_stale"),
        *(record("board", at_s, battery_v=12.0 - at_s) for at_s in (1.01, 2.01)),
        *(fix(at_s, at_s, 3.0 if at_s < 3.0 else None) for at_s in (1.0, 2.0, 3.0)),
    ]
    folder = tmp_path_factory.mktemp("eventful")
    page = page_of(folder, HEADER, *by_time(ARMED, *ticks, *told), OUTCOME)
    return read_run(folder / "00001-run"), page


def test_page_is_whole_needs_nothing_else_and_has_all_tables(eventful: tuple[RunData, str]) -> None:
    data, page = eventful
    check_page(page)
    assert HOSTILE not in page
    for table in (anomalies_table, episodes_table, conditions_table, events_list, sensors_table):
        assert table(data) in page


def test_marks_are_numbered_in_list_map_and_time_series(eventful: tuple[RunData, str]) -> None:
    _, page = eventful
    assert f"1. Mark: hit log 0:00:02.0 2. Mark: {HOSTILE}" in unescape(text_of(page))
    assert drawn(page).count('["1. Mark: hit log","2. Mark: ') == 2


def test_trouble_stands_out_and_an_operators_hold_does_not(eventful: tuple[RunData, str]) -> None:
    _, page = eventful
    (trouble,) = re.findall(r"<strong>(.*?)</strong>", page)
    assert trouble == "Held: the compass is silent"


def test_held_wheels_the_battery_and_a_new_key_are_in_the_time_series(eventful: tuple[RunData, str]) -> None:
    _, page = eventful
    assert '"Wheels held until this clears, for 1.0 s"' in drawn(page)
    assert {"battery, V", "moon_deg"} <= set(titles(page))


def test_way_is_laid_onto_the_fixes_and_its_end_opens_in_a_map(eventful: tuple[RunData, str]) -> None:
    _, page = eventful
    assert "Dead reckoning is laid onto all fixes at once: turned by 0.0°" in text_of(page)
    assert "End of the fitted path (the last fix is below, under “where”): 47.0000" in text_of(page)
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
    blind = {"level": "degrade", "cause": "motion_unknown"}
    ticks = [tick(0.05 * at, **(blind if at >= 20 else {})) for at in range(61)]
    told = text_of(conditions_table(data_of(tmp_path / "armed", HEADER, ARMED, *ticks)))
    assert "The motion sensor's picture is too poor 0:00:02.0 it drives a stride ahead" in told
    disarmed = [{**each, "mode": "disarmed"} for each in ticks]
    told = text_of(conditions_table(data_of(tmp_path / "disarmed", HEADER, *disarmed)))
    assert told == "While it was armed, nothing was wrong with the rover itself."


def test_a_hold_interrupts_an_episode_and_arming_ends_it(tmp_path: Path) -> None:
    ticks = episode()
    for held in ticks[50:60]:
        held["phase"] = "halt"
    told = text_of(episodes_table(data_of(tmp_path / "held", HEADER, *ticks)))
    assert told.count("the heading is the goal heading again") == 1
    armed = [*ticks[:50], event("armed", 2.49, goal_heading_deg=0.0), *ticks[50:]]
    told = text_of(episodes_table(data_of(tmp_path / "armed", HEADER, *armed)))
    assert "1 0:00:02.0 right 1 0.5 0.5 armed 2 0:00:03.0" in told


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


def test_settings_that_are_not_the_defaults_stand_before_those_that_have_none(tmp_path: Path) -> None:
    config = {"name": "mine", "control_hz": 10.0, "detector": {"tilt_deg": 20.0}, "vehicle": {"turn_from_duty": 0.1}}
    told = own_settings_table(data_of(tmp_path / "mine", {**HEADER, "config": config}, *drive(1.0)))
    rows = re.findall(r'<tr class="setting"><th scope="row">(.*?)</th><td.*?>(.*?)</td><td.*?>(.*?)</td>', told)
    assert rows == [("control_hz", "10.0", "20.0"), ("vehicle.turn_from_duty", "0.1", "0.0"), ("name", "mine", "")]
    assert "does not have the rover file" in own_settings_table(
        data_of(tmp_path / "none", {**HEADER, "config": None}, *drive(1.0))
    )
    assert {"escape.back_off_m", "log.part_mb"} <= default_settings().keys()


def test_wheels_heading_and_goal_are_drawn_about_zero_as_the_log_has_them(tmp_path: Path) -> None:
    told = {"heading_deg": 350.0, "goal_heading_deg": 20.0, "wanted_left": 1.0, "applied_left": 0.6}
    data = data_of(tmp_path, HEADER, *(tick(0.05 * at, **told) for at in range(20)))
    drawn_as = {name: set(line[1]) for name in ("left wanted", "left applied") if (line := line_of(name, data))}
    assert drawn_as == {"left wanted": {1.0}, "left applied": {0.6}}
    plots = Plots()
    list(draw_panels(data, plots))
    heading = json.loads(plots.to_json())["document"]["roots"][1]["attributes"]
    assert (heading["y_range"]["attributes"], heading["name"]) == (
        {"start": -190.0, "end": 190.0},
        "heading about the goal",
    )


def test_simulated_run_shows_the_forest_and_how_far_dead_reckoning_drifted(tmp_path: Path) -> None:
    page = page_of(tmp_path, *simulated_drive(), OUTCOME)
    check_page(page)
    assert "At the end dead reckoning is 1.8 m from the true path" in text_of(page)
    assert '"Rect"' in drawn(page)  # the fallen trunk


def test_legend_has_the_phases_that_were_driven_and_no_other(tmp_path: Path) -> None:
    page = page_of(tmp_path, *simulated_drive(), OUTCOME)
    boxes = re.findall(r"<label[^>]*>.*?</label>", page, re.DOTALL)
    assert any("Following the goal" in box for box in boxes)
    assert not any("Driven by hand" in box or "Turning away" in box for box in boxes)


def simulated_page(folder: Path, world: object) -> str:
    truth = record("truth", 0.0, x_m=25.0, y_m=12.5, driven_m=0.0)
    return page_of(folder, {**HEADER, "simulated": True, "world": world}, truth, *drive(), OUTCOME)


def test_simulated_run_without_its_forest_says_so(tmp_path: Path) -> None:
    assert NO_FOREST in text_of(simulated_page(tmp_path, None))


def test_forest_is_drawn_as_far_as_its_log_tells(tmp_path: Path) -> None:
    odd = {"trunks_m": [[20.0, 20.0, 30.0, 22.0, "askew"]], "trees_m": [[1.0, 2.0, 3.0]], "diameters_m": [0.2, 0.4]}
    page = simulated_page(tmp_path, WORLD | odd)
    check_page(page)
    assert '"Rect"' in drawn(page)
    assert NO_FOREST not in text_of(page)
