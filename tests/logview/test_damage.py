"""Logs that the card has forgotten parts of: what is lost is said, and nothing here ends by an error of its own."""

from __future__ import annotations

import gzip
import re
from pathlib import Path
from typing import Any

import pytest

from tests.fuzz.on_logs import EXPORT, STORY
from tests.logview.records import (
    HEADER,
    RUN,
    SAMPLE_LOGS,
    Json,
    drive,
    event,
    line,
    numbered,
    outcome,
    read,
    tick,
    write,
)  # fmt: skip
from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import find_run
from wayfarer.fieldlog.reader import Damage, RunReader, find_header
from wayfarer.logview.listing import rows
from wayfarer.logview.summary import NO_OUTCOME, LogIntegrity, RunSummary, check_log, summarise, summary_text
from wayfarer.logview.tail import RunTail

WHOLE = numbered([HEADER, event("armed", 0.0), *drive(0.0, 1.0), outcome(1.0)])


def use_every_tool(run: Path) -> None:
    """Do what the fuzzer does: nothing may fail, and nothing be refused of a log that can be read."""
    for target in (STORY, EXPORT):
        with target.opened() as attempt:
            said = attempt((run / "run.00001.jsonl").read_bytes())
        assert check_log(run).integrity is LogIntegrity.UNREADABLE or not said.startswith("BadInput"), said


def test_log_is_whole(tmp_path: Path) -> None:
    verdict = check_log(write(tmp_path, WHOLE))
    assert (verdict.integrity.exit_code, str(verdict)) == (0, "complete: 23 records")


def test_sample_run_is_whole_and_tells_of_everything_that_was_asked() -> None:
    run = find_run("1", SAMPLE_LOGS)
    assert check_log(run).integrity is LogIntegrity.COMPLETE
    found = summarise(RunReader(run))
    assert (found.holds, found.goals, [mark.text for mark in found.marks]) == (1, 1, ["hit log"])
    assert found.episodes > 0
    use_every_tool(run)


@pytest.mark.parametrize(
    ("records", "said"),
    [
        (WHOLE[:-1], "no outcome"),
        (WHOLE[:1], f"partial: 1 readable record; {NO_OUTCOME}"),
        (WHOLE[1:], "1 header is missing"),
        ([*WHOLE[1:5], HEADER | {"part": 2}, *WHOLE[5:]], "1 header is missing"),
        ([*WHOLE[:5], *WHOLE[9:]], "4 records are missing"),
    ],
)
def test_log_that_lost_something_is_repaired_at_best(tmp_path: Path, records: list[Any], said: str) -> None:
    verdict = check_log(write(tmp_path, records))
    assert (verdict.integrity, verdict.integrity.exit_code) == (LogIntegrity.PARTIAL, 3)
    assert said in str(verdict)


def test_log_that_ends_in_the_middle_of_a_line_says_what_was_skipped(tmp_path: Path) -> None:
    file = write(tmp_path, WHOLE) / "run.00001.jsonl"
    file.write_bytes(file.read_bytes()[:-9])
    assert "1 line is torn" in str(check_log(tmp_path))


LONG = numbered([HEADER, event("armed", 0.0), *drive(0.0, 7.0), *drive(7.0, 14.0, heading_deg=90.0), outcome(14.0)])
MIDDLE = 140  # ticks on both sides of it


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> RunSummary:
    """What is told of a log that lost nothing."""
    return summarise(RunReader(write(tmp_path_factory.mktemp("whole"), LONG)))


def changed(old: Json, /, **values: Any) -> list[Json]:
    """A log in whose middle one record was written with other values."""
    return [*LONG[:MIDDLE], old | values, *LONG[MIDDLE + 1 :]]


def wrong(first: str, missing: int = 1) -> Damage:
    return Damage(wrong=1, missing=missing, first_wrong=first)


HALF = {"t_s": 1.0, "forward_m": 2.0, "quality": 1.0}


@pytest.mark.parametrize(
    ("records", "damage"),
    [
        ([*LONG[: MIDDLE + 1], *LONG[50:100], *LONG[MIDDLE + 1 :]], Damage(repeated=50)),
        ([*LONG, *LONG], Damage(repeated=len(LONG) - 1)),
        ([*LONG[:MIDDLE], LONG[MIDDLE + 1], LONG[MIDDLE], *LONG[MIDDLE + 2 :]], Damage(repeated=1, missing=1)),
        (
            changed(LONG[MIDDLE], t_s=LONG[MIDDLE]["t_s"] + 1e9),
            wrong("tick: Expected `float` <= 1000000000.0 - at `$.t_s`"),
        ),
        (changed(LONG[MIDDLE], heading_deg=1e308), wrong("tick: Expected `float` <= 360.0 - at `$.heading_deg`")),
        (
            changed(LONG[MIDDLE], travelled_m="far"),
            wrong("tick: Expected `float | null`, got `str` - at `$.travelled_m`"),
        ),
        (
            changed(LONG[MIDDLE], applied_left=True),
            wrong("tick: Expected `float | null`, got `bool` - at `$.applied_left`"),
        ),
        (changed(LONG[MIDDLE], motion=HALF), wrong("tick: Object missing required field `right_m` - at `$.motion`")),
        (changed(LONG[MIDDLE], n=None), wrong("tick: Expected `int`, got `null` - at `$.n`")),
        (changed(LONG[MIDDLE], t_wall=None), wrong("tick: Expected `float`, got `null` - at `$.t_wall`")),
        (changed(LONG[MIDDLE], record="tock"), Damage(unknown=1, missing=1)),
        (changed(LONG[MIDDLE], record=None), Damage(unknown=1, missing=1)),
        ([*LONG[:MIDDLE], b"what?\n", b"\xff\xfe\n", *LONG[MIDDLE:]], Damage(torn=2)),
        (
            [*LONG[:MIDDLE], HEADER | {"part": "2"}, *LONG[MIDDLE:]],
            wrong("run: Expected `int`, got `str` - at `$.part`", 0),
        ),
        (
            [*LONG[:MIDDLE], HEADER | {"part": 2, "schema": None}, *LONG[MIDDLE:]],
            wrong("run: Expected `int`, got `null` - at `$.schema`", 0),
        ),
        ([*LONG[:MIDDLE], HEADER | {"part": 2, "schema": 99}, *LONG[MIDDLE:]], wrong("run: schema 99", 0)),
    ],
)
def test_what_cannot_be_is_dropped_and_counted_once(
    tmp_path: Path, expected: RunSummary, records: list[Json | bytes], damage: Damage
) -> None:
    """``tests/logview/test_damaged_copies.py`` shows that every tool says the same."""
    run = write(tmp_path / RUN, records)
    verdict = check_log(run)
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


def test_one_damaged_header_costs_that_header_only(tmp_path: Path) -> None:
    run = write(tmp_path / RUN, [HEADER | {"schema": None}, *LONG[1:MIDDLE]], "run.00001.jsonl")
    write(run, [HEADER | {"part": 2, "t_s": LONG[MIDDLE]["t_s"]}, *LONG[MIDDLE:]], "run.00002.jsonl")
    verdict = check_log(run)
    assert (verdict.integrity, verdict.records) == (LogIntegrity.PARTIAL, len(LONG))
    assert "1 record holds an impossible value (the first: run: " in str(verdict)
    tail = RunTail(run)
    assert list(tail.read())
    tail.close()
    header = find_header(run)
    assert header is not None
    assert header.part == 2


def test_part_without_its_header_loses_nothing_else(tmp_path: Path) -> None:
    run = write(tmp_path / RUN, LONG[:MIDDLE])
    write(run, LONG[MIDDLE:], "run.00002.jsonl")
    reader = RunReader(run)
    assert list(reader) == list(map(read, LONG))
    assert reader.damage == Damage()


@pytest.mark.parametrize("records", [WHOLE[:1], WHOLE[:-1]])
def test_summary_calls_no_log_whole_that_check_does_not(tmp_path: Path, records: list[Json]) -> None:
    reader = RunReader(write(tmp_path / RUN, records))
    assert check_log(reader.run).integrity is LogIntegrity.PARTIAL
    said = summary_text("17", summarise(reader), reader.damage).splitlines()[-1]
    assert said == f"log        {NO_OUTCOME}"


@pytest.mark.parametrize("schema", [3, 99])
@pytest.mark.parametrize("records", [WHOLE, LONG])
def test_log_of_another_form_is_refused_in_one_line(tmp_path: Path, records: list[Json], schema: int) -> None:
    """Also a log of which following reads only the end, where its header is not."""
    run = write(tmp_path / RUN, [HEADER | {"schema": schema}, *records[1:]])
    refusal = rf"^[^\n]*run\.00001\.jsonl: this log has schema {schema}, and wayfarer .* reads 4: read it with"
    with pytest.raises(BadInput, match=refusal):
        list(RunReader(run))
    tail = RunTail(run)
    with pytest.raises(BadInput, match=f"schema {schema}"):
        list(tail.read())
    tail.close()
    verdict = check_log(run)
    assert verdict.integrity.exit_code == 1
    assert f"schema {schema}" in str(verdict)
    assert [row.outcome for row in rows(tmp_path, 0.0)] == ["unreadable"]


@pytest.mark.timeout(15)
def test_lines_without_end_that_hold_nothing_are_not_read_to_their_end(tmp_path: Path) -> None:
    """A file of a megabyte may hold a thousand million of them, packed."""
    head = b"".join(map(line, WHOLE[:9]))
    (tmp_path / "run.00001.jsonl.gz").write_bytes(gzip.compress(head) + gzip.compress(b"\n" * 10**7) * 100)
    assert str(check_log(tmp_path)) == (f"partial: 9 readable records; 1 part of the log cannot be read; {NO_OUTCOME}")


@pytest.mark.parametrize("content", [b"", b"\0" * 5000, b"what?\n"])
def test_log_of_which_nothing_is_left_is_unreadable(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "run.00001.jsonl").write_bytes(content)
    verdict = check_log(tmp_path)
    assert verdict.integrity.exit_code == 1
    assert re.match(r"unreadable: 0 readable records; .*: nothing in this log can be read \(.*\)$", str(verdict))


def test_following_has_one_order_from_its_first_look_to_its_last(tmp_path: Path) -> None:
    """Lines that come a second time with a later look are not told again, and are no gap."""
    tail = RunTail(write(tmp_path, WHOLE[:9]))
    looks = [list(tail.read())]
    for further in ([*WHOLE[5:9], *WHOLE[9:12]], WHOLE[5:9], WHOLE[12:]):
        write(tmp_path, further)
        looks.append(list(tail.read()))
    tail.close()
    assert looks == [list(map(read, part)) for part in (WHOLE[:9], WHOLE[9:12], [], WHOLE[12:])]


@pytest.mark.parametrize(
    "records",
    [
        [tick(1.0, motion={"forward_m": 1.0}), tick(2.0, motion={"forward_m": "1", "right_m": 1, "quality": 1})],
        [HEADER | {"config": None}, HEADER | {"config": {"vehicle": [1]}}, tick(1.0, applied_left="fast")],
        [event("armed", 0.0), tick(0.0), tick(1.0, level=["hold"]), tick(2.0, level={"hold": 1})],
        [tick(0.0), {"record": "event", "t_s": 1.7e308, "name": "mark"}],
        [HEADER, tick(0.0, applied_left=1e308), tick(0.5, applied_left=1e308), tick(1.0)],
        [{"record": "tick", "t_s": 1e300}, {"record": "tick", "t_s": -1e300, "t_wall": 1e300}],
    ],
)
def test_no_tool_fails_on_values_that_cannot_be(tmp_path: Path, records: list[Json]) -> None:
    """Found once by ``tests/fuzz``, which looks for more."""
    use_every_tool(write(tmp_path / RUN, records))
