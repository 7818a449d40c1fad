"""Logs that the card has forgotten parts of: what is lost is said, and nothing here ends by an error of its own."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import orjson
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.views.text.records import HEADER, SAMPLE_LOGS, drive, event, narrated, numbered, outcome, record, tick, write
from wayfarer import cli
from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import find_run
from wayfarer.fieldlog.reader import Damage, Record, RunReader, read_header
from wayfarer.fieldlog.schema import KINDS
from wayfarer.views.export.export import export
from wayfarer.views.export.formats import ExportFormat, Output
from wayfarer.views.run_report.reading import read_run
from wayfarer.views.text.last_position import RangeBearing
from wayfarer.views.text.listing import lines, rows
from wayfarer.views.text.run_narrator import Telling
from wayfarer.views.text.run_summariser import summarise
from wayfarer.views.text.summary import RunSummary
from wayfarer.views.text.summary_text import summary_text
from wayfarer.views.text.tail import RunTail
from wayfarer.views.text.verdict import NO_OUTCOME, LogIntegrity, judge, readable

RUN = "00017-20261121T061405Z"
WHOLE = numbered([HEADER, event("armed", 0.0), *drive(0.0, 1.0), outcome(1.0)])


def use_every_tool(run: Path) -> None:
    reader = RunReader(run)
    for telling in Telling:
        assert all(str(line).isprintable() for line in narrated(RunReader(run), telling))
    found = summarise(reader)
    assert summary_text("17", found, reader.damage)
    assert json.dumps(asdict(found), allow_nan=False)
    assert judge(run)
    assert lines(rows(run.parent, 0.0), 80)
    for form in ExportFormat:
        if form.output is Output.TEXT:
            try:
                form.write(run, io.StringIO())
            except BadInput as error:
                assert "no GPS position" in str(error) or judge(run).integrity is LogIntegrity.UNREADABLE


def test_log_is_whole(tmp_path: Path) -> None:
    verdict = judge(write(tmp_path, WHOLE))
    assert (verdict.integrity, verdict.integrity.exit_code, str(verdict)) == (
        LogIntegrity.COMPLETE,
        0,
        "complete: 23 records",
    )


def test_sample_run_is_whole_and_tells_of_everything_that_was_asked() -> None:
    run = find_run("1", SAMPLE_LOGS)
    assert judge(run).integrity is LogIntegrity.COMPLETE
    found = summarise(RunReader(run))
    assert (found.holds, found.goals, [mark.text for mark in found.marks]) == (1, 1, ["hit log"])
    assert found.episodes > 0
    use_every_tool(run)


@pytest.mark.parametrize(
    ("records", "said"),
    [
        (WHOLE[:-1], "no outcome"),
        (WHOLE[1:], "does not begin with its header"),
        ([*WHOLE[1:5], HEADER | {"part": 2}, *WHOLE[5:]], "does not begin with its header"),
        ([*WHOLE[:5], *WHOLE[9:]], "4 records are missing"),
    ],
)
def test_log_that_lost_something_is_repaired_at_best(tmp_path: Path, records: list[Any], said: str) -> None:
    verdict = judge(write(tmp_path, records))
    assert (verdict.integrity, verdict.integrity.exit_code) == (LogIntegrity.PARTIAL, 3)
    assert said in str(verdict)


def test_log_that_ends_in_the_middle_of_a_line_says_what_was_skipped(tmp_path: Path) -> None:
    file = write(tmp_path, WHOLE) / "run.jsonl"
    file.write_bytes(file.read_bytes()[:-9])
    assert "1 line is torn" in str(judge(tmp_path))


LONG = numbered([HEADER, event("armed", 0.0), *drive(0.0, 7.0), *drive(7.0, 14.0, heading_deg=90.0), outcome(14.0)])
MIDDLE = 140  # ticks on both sides of it


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> RunSummary:
    """What is told of a log that lost nothing."""
    return summarise(RunReader(write(tmp_path_factory.mktemp("whole"), LONG)))


def changed(record: Record, **values: Any) -> list[Record]:
    """A log in whose middle one record has other values."""
    return [*LONG[:MIDDLE], record | values, *LONG[MIDDLE + 1 :]]


@pytest.mark.parametrize(
    ("records", "damage"),
    [
        ([*LONG[: MIDDLE + 1], *LONG[MIDDLE:]], Damage(disordered=1)),
        ([*LONG[: MIDDLE + 1], *LONG[50:100], *LONG[MIDDLE + 1 :]], Damage(disordered=50)),
        ([*LONG, *LONG], Damage(disordered=len(LONG))),
        ([LONG[0], *LONG], Damage(disordered=1)),
        (
            [*LONG[:MIDDLE], LONG[MIDDLE + 1], LONG[MIDDLE], *LONG[MIDDLE + 2 :]],
            Damage(disordered=1, missing=1),
        ),
        (changed(LONG[MIDDLE], t_s=LONG[MIDDLE]["t_s"] + 1e9), Damage(wrong=1, missing=1)),
        (changed(LONG[MIDDLE], t_s=LONG[MIDDLE]["t_s"] + 1e6), Damage(disordered=1, missing=1)),
        (changed(LONG[MIDDLE], t_s=LONG[MIDDLE]["t_s"] - 30.0), Damage(disordered=1, missing=1)),
        (changed(LONG[MIDDLE], n=9_000_000), Damage(disordered=1, missing=1)),
        (changed(LONG[MIDDLE], heading_deg=1e308), Damage(wrong=1, missing=1)),
        (changed(LONG[MIDDLE], travelled_m="far"), Damage(wrong=1, missing=1)),
        (changed(LONG[MIDDLE], applied_left=True), Damage(wrong=1, missing=1)),
        (changed(LONG[MIDDLE], motion={"t_s": 1.0, "forward_m": "2", "quality": 1.0}), Damage(wrong=1, missing=1)),
        (changed(LONG[MIDDLE], n=None), Damage(wrong=1, missing=1)),
        (changed(LONG[MIDDLE], t_wall=None), Damage(wrong=1, missing=1)),
        ([*LONG[:MIDDLE], HEADER | {"part": 2, "schema": 0}, *LONG[MIDDLE:]], Damage(wrong=1)),
        ([*LONG[:MIDDLE], HEADER | {"part": 2, "schema": 99}, *LONG[MIDDLE:]], Damage(wrong=1)),
    ],
)
def test_what_cannot_be_is_dropped_and_counted_once_for_every_tool(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], expected: RunSummary, records: list[Record], damage: Damage
) -> None:
    run = write(tmp_path / RUN, records)
    verdict = judge(run)
    assert (verdict.integrity.exit_code, verdict.records) == (3, len(records) - damage.lines)
    assert str(damage) in str(verdict)

    reader = RunReader(run)
    found = summarise(reader)
    assert reader.damage == damage
    assert str(damage) in summary_text("17", found, reader.damage)
    assert found.lasted_s == expected.lasted_s
    assert found.late_ticks == 0
    assert found.where.by_reckoning is not None
    assert expected.where.by_reckoning is not None
    assert found.where.by_reckoning.distance_m == pytest.approx(expected.where.by_reckoning.distance_m, abs=0.1)
    assert found.where.by_reckoning.bearing_deg == pytest.approx(expected.where.by_reckoning.bearing_deg, abs=0.5)

    assert read_run(run).damage == damage
    table = io.StringIO()
    assert ExportFormat.csv.write(run, table) == damage
    for form in set(ExportFormat) - {ExportFormat.gpx, ExportFormat.geojson}:  # there is no position in it
        assert export(run, form, tmp_path / f"run.{form}", overwrite=False) == damage
    capsys.readouterr()
    for command in (["export", "--out", "-"], ["follow"]):
        assert cli.run(["logs", command[0], str(run), *command[1:]]) == 0
        assert capsys.readouterr().err.splitlines()[-1] == str(damage)
    ticks = [each for each in RunReader(run) if each["record"] == "tick"]
    assert len(table.getvalue().splitlines()) == 1 + len(ticks) + 1  # titles, and what came after the last tick


@pytest.mark.parametrize("forward_m", [50.0, -50.0, 1e308])
def test_reading_that_cannot_be_sends_nobody_elsewhere(tmp_path: Path, forward_m: float) -> None:
    """A sensor may say anything, so that the log is whole."""
    still = {"t_s": 1.0, "forward_m": 0.025, "right_m": 0.0, "quality": 1.0, "signed": True}
    read = [{**each, "motion": still} if each["record"] == "tick" else each for each in LONG]
    lying = [*read[:MIDDLE], read[MIDDLE] | {"motion": {**still, "forward_m": forward_m}}, *read[MIDDLE + 1 :]]
    runs = [write(tmp_path / name, records) for name, records in (("17", read), ("18", lying))]
    expected, found = (summarise(RunReader(run)).where.by_reckoning for run in runs)
    assert judge(runs[1]).integrity is LogIntegrity.COMPLETE
    assert expected is not None
    assert found == RangeBearing(
        pytest.approx(expected.distance_m, abs=0.1),  # type: ignore[arg-type]
        pytest.approx(expected.bearing_deg, abs=0.5),  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("schema", [0, 99, None])
def test_one_damaged_header_costs_that_header_only(tmp_path: Path, schema: int | None) -> None:
    run = write(tmp_path / RUN, [HEADER | {"schema": schema}, *LONG[1:MIDDLE]], "run.00001.jsonl")
    write(run, [HEADER | {"part": 2, "t_s": LONG[MIDDLE]["t_s"]}, *LONG[MIDDLE:]])
    verdict = judge(run)
    assert (verdict.integrity, verdict.records) == (LogIntegrity.PARTIAL, len(LONG))
    assert "1 record holds a value that cannot be" in str(verdict)
    tail = RunTail(run)
    assert list(tail.take())
    tail.close()
    assert read_header(run)["part"] == 2


def test_part_without_its_header_is_counted(tmp_path: Path) -> None:
    run = write(tmp_path / RUN, LONG[:MIDDLE], "run.00001.jsonl")
    write(run, LONG[MIDDLE:])
    reader = RunReader(run)
    assert list(reader) == LONG
    assert reader.damage == Damage(headless=1)


@pytest.mark.parametrize("records", [WHOLE[:1], WHOLE[:-1]])
def test_summary_calls_no_log_whole_that_check_does_not(tmp_path: Path, records: list[Record]) -> None:
    reader = RunReader(write(tmp_path / RUN, records))
    assert judge(reader.run).integrity is LogIntegrity.PARTIAL
    said = summary_text("17", summarise(reader), reader.damage).splitlines()[-1]
    assert said == f"log        {NO_OUTCOME}"


def test_one_record_is_counted_in_the_singular(tmp_path: Path) -> None:
    assert str(judge(write(tmp_path, WHOLE[:1]))) == f"partial: 1 readable record; {NO_OUTCOME}"


def test_log_of_a_newer_wayfarer_is_refused_in_one_line(tmp_path: Path) -> None:
    run = write(tmp_path / RUN, [HEADER | {"schema": 99}, *WHOLE[1:]])
    with pytest.raises(BadInput, match=r"run\.jsonl: this log has schema 99, wayfarer .* knows up to 2: update"):
        list(RunReader(run))
    tail = RunTail(run)
    with pytest.raises(BadInput, match="schema 99"):
        list(tail.take())
    tail.close()
    verdict = judge(run)
    assert verdict.integrity.exit_code == 1
    assert "schema 99" in str(verdict)
    assert [row.outcome for row in rows(tmp_path, 0.0)] == ["unreadable"]


def test_following_leaves_out_what_is_out_of_order(tmp_path: Path) -> None:
    tail = RunTail(write(tmp_path, [*WHOLE[:9], *WHOLE[5:9]]))
    assert list(tail.take()) == WHOLE[:9]
    write(tmp_path, WHOLE[9:])
    assert list(tail.take()) == WHOLE[9:]
    tail.close()


@pytest.mark.parametrize("content", [b"", b"\0" * 5000, b"what?\n"])
def test_log_of_which_nothing_is_left_is_unreadable(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "run.jsonl").write_bytes(content)
    assert judge(tmp_path).integrity.exit_code == 1


def test_log_with_nothing_in_it_is_called_empty(tmp_path: Path) -> None:
    run = write(tmp_path, [])
    assert str(judge(run)) == "unreadable: 0 readable records; it is empty"
    with pytest.raises(BadInput, match=r"can be read \(it is empty\)"):
        list(readable(RunReader(run)))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_tool_fails_on_a_log_with_any_bytes_changed(tmp_path: Path, data: st.DataObject) -> None:
    run = tmp_path / RUN
    run.mkdir(exist_ok=True)
    content = bytearray(b"".join(orjson.dumps(each) + b"\n" for each in WHOLE))
    for place in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=40)):
        content[place] = data.draw(st.integers(0, 255))
    (run / "run.jsonl").write_bytes(content[: data.draw(st.integers(0, len(content)))])
    use_every_tool(run)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
    max_leaves=4,
)  # fmt: skip
KEYS = sorted({key for each in [*WHOLE, record("board", 0, battery_v=0, faults=0)] for key in each} | {"latitude_deg",
    "longitude_deg", "error_m", "throttled", "trial", "text", "sensor", "reason", "by_s"})  # fmt: skip
RECORDS = st.builds(
    lambda kind, t_s, fields: {**fields, "record": kind, "t_s": t_s},
    st.sampled_from(KINDS),
    st.floats(-1e300, 1e300),
    st.dictionaries(st.sampled_from([key for key in KEYS if key not in {"record", "t_s"}]), VALUES, max_size=8),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(records=st.lists(RECORDS, min_size=1, max_size=6))
@example(
    records=[tick(1.0, motion={"forward_m": 1.0}), tick(2.0, motion={"forward_m": "1", "right_m": 1, "quality": 1})]
)
@example(records=[HEADER | {"config": None}, HEADER | {"config": {"vehicle": [1]}}, tick(1.0, applied_left="fast")])
@example(records=[event("armed", 0.0), tick(0.0), tick(1.0, level=["hold"]), tick(2.0, level={"hold": 1})])
@example(records=[tick(0.0), {"record": "event", "t_s": 1.7e308, "name": "mark"}])
@example(records=[HEADER, tick(0.0, applied_left=1e308), tick(0.5, applied_left=1e308), tick(1.0)])
@example(records=[{"record": "tick", "t_s": 1e300}, {"record": "tick", "t_s": -1e300, "t_wall": 1e300}])
def test_no_tool_fails_on_values_that_cannot_be(tmp_path: Path, records: list[Any]) -> None:
    run = tmp_path / RUN
    run.mkdir(exist_ok=True)
    (run / "run.jsonl").unlink(missing_ok=True)
    use_every_tool(write(run, records))
