"""The summary of a run: every figure from a log that was made for it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from tests.logview.records import (
    BEGAN_WALL_S,
    HEADER,
    RUN,
    Json,
    drive,
    event,
    narrated,
    noted,
    numbered,
    outcome,
    read,
    record,
    tick,
    unarmed,
    write,
)  # fmt: skip
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.run_fold import LowBattery
from wayfarer.logview.listing import CELLS, rows
from wayfarer.logview.narrator import Verbosity
from wayfarer.logview.summary import NO_OUTCOME, Mark, RunSummary, distance_line, summarise, summary_text


def summarised(records: Iterable[Json]) -> RunSummary:
    return summarise(map(read, records))


def summary(*records: Json) -> RunSummary:
    return summarised(numbered([HEADER, *records]))


def text(*records: Json) -> dict[str, list[str]]:
    """The lines for people, by their titles."""
    found: dict[str, list[str]] = {}
    title = ""
    for line in summary_text("00017", summary(*records), Damage()).splitlines():
        title = line[:11].strip() or title
        found.setdefault(title, []).append(line[11:])
    return found


def test_it_says_what_ran_and_how_it_ended() -> None:
    found = summary(outcome(3.0))
    assert (found.rover, found.algorithm, found.version, found.seed) == ("minirover", "forest-pledge", "9.9", 7)
    assert (found.reason, found.text, found.dropped) == ("requested", "enough", 0)
    assert text(outcome(3.0))["outcome"] == ["requested: enough"]


def test_time_is_total_armed_and_held_by_cause() -> None:
    found = summary(
        *unarmed(0.0, 2.0),
        *drive(2.0, 5.0),
        *drive(5.0, 6.0, level="hold", cause="operator_hold"),
        *drive(6.0, 7.0, level="degrade", cause="battery_low"),
        *unarmed(7.0, 10.0, level="hold", cause="compass_stale"),
    )
    assert found.lasted_s == pytest.approx(9.95)
    assert found.armed_s == pytest.approx(5.0)
    assert found.held_s == {"operator_hold": pytest.approx(1.0)}
    assert found.limited_s == {"battery_low": pytest.approx(1.0)}


def test_run_began_when_the_clock_that_was_right_at_its_end_says() -> None:
    wrong = {"t_wall": 100.0}
    assert summarised([HEADER | wrong, tick(1.0) | wrong, outcome(3.0)]).began_wall_s == pytest.approx(BEGAN_WALL_S)
    assert summarised([HEADER | wrong, tick(1.0) | wrong]).began_wall_s is None
    assert "clock was not set" in summary_text("1", summarised([HEADER | wrong]), Damage())


def test_way_is_commanded_and_reckoned() -> None:
    found = summary(*drive(0.0, 10.05))
    assert found.commanded_m == pytest.approx(5.0)
    assert found.reckoned_m == pytest.approx(5.0)
    assert found.driven_m is None


def test_way_of_a_simulated_rover_is_the_true_one_in_summary_list_and_lines(tmp_path: Path) -> None:
    truth = record("truth", 1.0, x_m=25.0, y_m=13.0, driven_m=3.26)
    records = [HEADER, *drive(0.0, 1.0), truth, tick(1.0, phase="probe", travelled_m=7.0), outcome(1.05)]
    found = summarised(records)
    assert found.driven_m == 3.26
    assert distance_line(found).startswith("3.3 m driven, 7.0 m commanded, ")
    write(tmp_path / RUN, numbered(records))
    assert [CELLS["m"](row) for row in rows(tmp_path, 0.0)] == ["3"]
    lines = [line.text for line in narrated(records, Verbosity.CHANGES)]
    assert any(line.startswith("Probing") and "3.3 m" in line for line in lines)


def test_escapes_are_counted_over_all_missions() -> None:
    phases = ["follow", "back_off", "back_off", "turn_away", "back_off", "turn_away", "probe", "follow"]
    whys = ["follow", "follow.anomaly", "back_off", "back_off.done", "turn_away.anomaly", "back_off.exhausted",
            "turn_away.exhausted", "probe.realigned"]  # fmt: skip
    mission = [
        tick(count / 20, phase=phase, why=why) for count, (phase, why) in enumerate(zip(phases, whys, strict=True))
    ]
    found = summary(*mission, *mission)
    assert (found.episodes, found.recoveries) == (2, 4)
    assert found.exhausted == {"back_off": 2, "turn_away": 2}


def test_battery_is_told_with_the_duty_at_that_moment() -> None:
    records = [
        record("board", 0.0, battery_v=12.0, faults=[]),
        tick(1.0, applied_left=-0.9, applied_right=0.2),
        record("board", 1.0, battery_v=11.1, faults=[]),
        tick(2.0),
        record("board", 2.0, battery_v=11.4, faults=[]),
        record("board", 3.0, battery_v=None, faults=[]),
    ]
    assert summary(*records).low_battery == LowBattery(11.1, 1.0, 0.9)
    assert text(*records)["battery"] == ["lowest 11.1 V, at 0:00:01, with the wheels at 90%"]


def test_periods_are_measured_and_late_ticks_counted() -> None:
    found = summary(*drive(0.0, 5.0), *drive(5.25, 10.0), tick(10.5))
    assert found.period is not None
    assert found.period.p50_s == pytest.approx(0.05)
    assert found.period.max_s == pytest.approx(0.55)
    assert (found.ticks, found.late_ticks) == (196, 2)


@pytest.mark.parametrize("between", [[], [HEADER | {"part": 2}]])
def test_ticks_that_were_lost_are_no_late_ones(between: list[Json]) -> None:
    records = numbered([HEADER, *drive(0.0, 5.0)])
    found = summarised([*records[:20], *between, *records[60:]])
    assert found.late_ticks == 0
    assert found.period is not None
    assert found.period.max_s == pytest.approx(0.05)


def test_failures_and_interventions_are_counted() -> None:
    found = summary(
        *(event("sensor_failed", 1.0, sensor=sensor, error="no answer") for sensor in ("compass", "motion", "compass")),
        event("motors_failed", 2.0, error="no answer"),
        event("clock_step", 3.0, by_s=-3600.0),
        event("hold", 4.0),
        event("resume", 5.0),
        event("goal", 6.0, goal_heading_deg=20.0),
        noted(7.0, "hit log"),
    )
    assert found.sensor_failures == {"compass": 2, "motion": 1}
    assert found.failures == {"motors_failed": 1}
    assert found.clock_steps_s == (-3600.0,)
    assert (found.holds, found.goals, found.marks) == (1, 1, (Mark(7.0, "hit log"),))


def test_times_that_a_person_drove_are_counted() -> None:
    records = [event("manual", 1.0, driver="keys"), event("manual_ended", 2.0, mode="armed", reason="so")]
    assert text(*records, event("manual", 3.0, driver="page"))["operator"] == ["drives by hand 2"]


def test_lost_rover_is_searched_from_where_it_was_armed() -> None:
    found = summary(
        *unarmed(0.0, 4.0),  # carried about before it is armed
        *(tick(4.0 + step, mission_s=step, north_m=2.0, east_m=0.5 * step, heading_deg=90.0) for step in range(41)),
    )
    assert found.where.by_reckoning is not None
    assert found.where.by_reckoning.distance_m == pytest.approx(20.0, abs=0.1)
    assert found.where.by_reckoning.bearing_deg == pytest.approx(90.0, abs=0.5)
    assert found.where.last_fix is None


def place_text(records: Iterable[Json], missing: int = 0) -> list[str]:
    """What is said of where to search."""
    lines = summary_text("1", summarised(records), Damage(missing=missing)).splitlines()
    return lines[[line.startswith("where") for line in lines].index(True) :][: 2 if missing else 1]


def test_place_is_called_partly_known_where_records_are_missing() -> None:
    records = [HEADER, *drive(0.0, 10.05)]
    assert place_text(records, missing=40) == [
        "where      5 m at bearing 0 degrees magnetic from the start (dead reckoning)",
        "           40 records are missing, so the path is only partly known",
    ]
    assert "missing" not in summary_text("1", summarised(records), Damage())


@pytest.mark.parametrize(
    "before",
    [
        [HEADER],  # it was armed in what is gone
        [],
        [HEADER | {"part": 2}],
        [HEADER | {"part": 2}, *unarmed(-8.0, 0.0), tick(0.0)],  # not for the first time
    ],
)
def test_place_counts_from_where_the_log_begins_if_that_is_not_the_start(before: list[Json]) -> None:
    records = [*before, *(tick(0.05 * step, mission_s=60.0 + 0.05 * step) for step in range(1, 201))]
    at = summarised(records).where
    assert at.by_reckoning is not None
    assert not at.from_start
    (line,) = place_text(records)
    assert "magnetic from where the log begins (dead reckoning)" in line


def test_rover_armed_before_it_knew_its_heading_is_searched_from_its_first_place() -> None:
    found = summary(
        tick(0.0, heading_deg=None, north_m=None, east_m=None),
        *drive(0.05, 20.0),
        *unarmed(20.0, 21.0),
        *drive(21.0, 30.05, mission_s=0.0),
    )
    assert found.where.from_start
    assert found.where.by_reckoning is not None
    assert found.where.by_reckoning.distance_m == pytest.approx(15.0, abs=0.2)


def test_receiver_says_where_and_how_long_ago() -> None:
    first = record("position", 0.0, latitude_deg=50.0, longitude_deg=179.9999, error_m=3.0)
    last = record("position", 5.0, latitude_deg=50.001, longitude_deg=-179.9999, error_m=None)
    found = summary(first, last, tick(9.0, mission_s=0.0))
    assert found.where.by_receiver is not None
    assert found.where.by_receiver.distance_m == pytest.approx(112.2, abs=0.1)
    assert found.where.by_receiver.bearing_deg == pytest.approx(7.3, abs=0.1)
    assert found.where.fix_age_s == pytest.approx(4.0)
    assert text(first, last, tick(9.0, mission_s=0.0))["where"] == [
        "50.001000, -179.999900, 4 s before the end",
        "112 m at bearing 7 degrees true from the first position",
        "0 m at bearing 0 degrees magnetic from the start (dead reckoning)",
    ]


def test_log_tells_how_many_of_the_missing_records_could_not_be_written() -> None:
    found = summarised([HEADER, *(record("computer", at_s, log_dropped=20 * at_s) for at_s in (1, 2)), tick(3.0)])
    assert found.dropped == 40
    log = summary_text("1", found, Damage(missing=150)).splitlines()[-1]
    assert log == f"log        150 records are missing, 40 of them could not be written; {NO_OUTCOME}"


def test_text_tells_only_what_there_is_to_tell() -> None:
    assert text(outcome(1.0)).keys() == {"run", "outcome", "time", "log"}


def test_every_line_fits_a_terminal() -> None:
    records = [
        event("armed", 0.0), *drive(0.0, 30.0, anomalies=["immobilised"]), *drive(30.0, 40.0, level="hold", cause="x"),
        record("board", 40.0, battery_v=12.0, faults=[]), noted(41.0, "hit log"), outcome(42.0),
    ]  # fmt: skip
    assert max(len(line) for lines in text(*records).values() for line in lines) <= 80 - 11


def test_nothing_at_all_is_a_summary_too() -> None:
    assert summary_text("1", summarised([]), Damage()).startswith(
        "run        1\n           unknown rover: the log has no header\n"
    )
