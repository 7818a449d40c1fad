"""The end of the run before: told from its last records, whatever has become of the file."""

from __future__ import annotations

import os
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.views.text.records import BEGAN_WALL_S, HEADER, RUN, drive, event, numbered, outcome, record, tick, write
from wayfarer.control.status_light import LastEnd
from wayfarer.fieldlog import last_run as last_run_module
from wayfarer.fieldlog.folders import FILE_NAME, new_run_folder
from wayfarer.fieldlog.last_run import LONG_TAIL_BYTES, LastRun, last_run
from wayfarer.fieldlog.lines import LogLines
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.wording import last_run_text

STANDING: dict[str, Any] = {"phase": "halt", "why": "halt"}


def left(logs: Path, *records: Record) -> LastRun | None:
    write(logs / RUN, numbered([HEADER, *records]))
    return last_run(logs)


def test_first_run_of_all_has_none_before_it(tmp_path: Path) -> None:
    assert last_run(tmp_path / "not there") is None
    assert last_run(tmp_path) is None


def test_run_with_an_outcome_was_ended_in_order(tmp_path: Path) -> None:
    found = left(tmp_path, event("armed", 1.0), tick(2.0), outcome(3.0) | {"dropped": 4})
    assert found is not None
    assert (found.ended, found.text, found.dropped) == ("requested", "enough", 4)


@pytest.mark.parametrize(
    ("records", "mode"),
    [
        ([tick(1.0)], "armed"),
        ([event("armed", 1.0), tick(2.0)], "armed"),
        ([event("armed", 1.0), event("disarmed", 2.0), tick(3.0, **STANDING)], "disarmed"),
        ([event("disarmed", 1.0), event("arming", 2.0), tick(3.0, **STANDING)], "arming"),
        ([event("armed", 1.0), tick(2.0, level="hold", **STANDING)], "armed"),
        ([tick(1.0, **STANDING)], None),
        ([], None),
    ],
)
def test_run_that_was_cut_off_tells_when_and_what_it_was_doing(
    tmp_path: Path, records: list[Record], mode: str | None
) -> None:
    at_s = 0.0 if not records else records[-1]["t_s"] - 100.0
    assert left(tmp_path, *records) == LastRun(RUN, last_t_s=100.0 + at_s, last_t_wall=BEGAN_WALL_S + at_s, mode=mode)


def test_only_the_newest_run_counts(tmp_path: Path) -> None:
    write(tmp_path / "00016-20261120T061405Z", numbered([HEADER, tick(1.0)]))
    found = left(tmp_path, tick(3.0), outcome(3.0))
    assert found is not None
    assert (found.run, found.ended) == (RUN, "requested")


def over(t_s: float, why: str, of: str = "event") -> Record:
    """A mission that is over, as its event says it, or a computer's record later."""
    totals: dict[str, Any] = {"mission_s": 61.0, "mission_m": 12.5, "mission_anomalies": 3, "mission_ended": why}
    return event("mission_ended", t_s, **totals) if of == "event" else record("computer", t_s, **totals)


ARMED, STANDS = [event("armed", 0.0), tick(1.0)], tick(9.0, **STANDING)


@pytest.mark.parametrize(
    ("records", "end"),
    [
        ([STANDS], None),
        ([STANDS, outcome(9.0)], None),
        ([STANDS, outcome(9.0, "failed")], LastEnd.FAILED),
        ([*ARMED, over(2.0, "mission_radius"), event("disarmed", 2.0), STANDS], LastEnd.OUT),
        ([over(2.0, "mission_radius", "computer"), STANDS], LastEnd.OUT),
        ([over(2.0, "mission_time", "computer"), STANDS, outcome(9.0, "signal")], LastEnd.STOPPED),
        ([over(2.0, "requested by a person", "computer"), STANDS], LastEnd.STOPPED),
        ([over(2.0, "fault: overturned", "computer"), STANDS, outcome(9.0)], LastEnd.FAILED),
        ([*ARMED, outcome(9.0, "escaped")], LastEnd.OUT),
        ([*ARMED, outcome(9.0)], LastEnd.STOPPED),
        (ARMED, LastEnd.UNFINISHED),
        ([over(0.0, "mission_radius", "computer"), *ARMED], LastEnd.UNFINISHED),
        ([record("computer", 0.0, mission_s=61.0, mission_m=9.0), STANDS], LastEnd.UNFINISHED),
        ([event("arming", 0.0), STANDS], LastEnd.UNFINISHED),
    ],
)
def test_light_tells_how_the_last_mission_ended(tmp_path: Path, records: list[Record], end: LastEnd | None) -> None:
    found = left(tmp_path, *records)
    assert found is not None
    assert found.end is end


@pytest.mark.parametrize("of", ["event", "computer"])
def test_totals_of_the_last_mission_are_told(tmp_path: Path, of: str) -> None:
    found = left(tmp_path, over(2.0, "mission_radius", of), STANDS, outcome(9.0))
    assert found is not None
    assert last_run_text(found._asdict()) == (
        f"The run before ({RUN}) ended: enough. Its last mission: 61 s, 12 m, anomalies: 3, radius limit"
    )


def test_only_the_end_of_a_long_log_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / RUN, numbered([HEADER, event("armed", 0.0), *drive(0.0, 500.0)]))
    size_b = (tmp_path / RUN / FILE_NAME).stat().st_size
    read = []
    take = LogLines.take

    def counted(lines: LogLines, line: bytes) -> Record | str:
        read.append(len(line))
        return take(lines, line)

    monkeypatch.setattr(LogLines, "take", counted)
    assert last_run(tmp_path) == LastRun(RUN, last_t_s=599.95, last_t_wall=BEGAN_WALL_S + 499.95, mode="armed")
    assert sum(read) <= LONG_TAIL_BYTES < size_b


def test_part_that_has_just_begun_leaves_the_one_before_to_tell(tmp_path: Path) -> None:
    write(tmp_path / RUN, numbered([HEADER | {"t_s": 99.0}, event("armed", 1.0), tick(2.0)]), "run.00001.jsonl")
    assert left(tmp_path) == LastRun(RUN, last_t_s=100.0, last_t_wall=BEGAN_WALL_S, mode="armed")


@pytest.mark.parametrize("garbage", [b"", b"\0" * 100_000, b"{" * 100_000, b'{"record":"tick","t_s":'])
def test_end_that_cannot_be_read_is_told_and_stops_nothing(tmp_path: Path, garbage: bytes) -> None:
    (tmp_path / RUN).mkdir()
    (tmp_path / RUN / FILE_NAME).write_bytes(garbage)
    assert last_run(tmp_path) == LastRun(RUN, error="nothing at the end of its log can be read")


@pytest.mark.parametrize("kind", ["folder", "pipe", "device"])
def test_log_that_is_no_file_is_told_and_stops_nothing(tmp_path: Path, kind: str) -> None:
    file = tmp_path / RUN / FILE_NAME
    file.parent.mkdir()
    match kind:
        case "folder":
            file.mkdir()
        case "pipe":
            os.mkfifo(file)
        case "device":
            file.symlink_to("/dev/zero")
    found = last_run(tmp_path)
    assert found is not None
    assert f"it is a {kind}" in (found.error or "")


def test_file_of_the_kernel_that_has_nothing_yet_stops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a symlink to /proc/kmsg, which root may read."""

    class Waiting(BytesIO):
        def read(self, _size: int | None = -1) -> bytes:
            return cast(bytes, None)

    write(tmp_path / RUN, [HEADER])
    monkeypatch.setattr(last_run_module, "open_regular", lambda _: Waiting())
    assert last_run(tmp_path) == LastRun(RUN, error="nothing at the end of its log can be read")


def test_folder_whose_name_is_no_text_can_be_told_in_json(tmp_path: Path) -> None:
    write(tmp_path / os.fsdecode(os.fsencode(RUN) + b"\x1b\xff"), [HEADER])
    assert last_run(tmp_path) == LastRun(f"{RUN}\\x1b\\udcff", last_t_s=100.0, last_t_wall=BEGAN_WALL_S)


def test_torn_last_line_leaves_the_one_before_it(tmp_path: Path) -> None:
    run = write(tmp_path / RUN, numbered([HEADER, tick(1.0)]))
    with (run / FILE_NAME).open("ab") as file:
        file.write(b'{"record":"outcome","t_s":1')
    assert last_run(tmp_path) == LastRun(RUN, last_t_s=101.0, last_t_wall=BEGAN_WALL_S + 1.0, mode="armed")


@pytest.mark.parametrize("tail", [b"", bytes(50)], ids=["cut", "NUL bytes"])
def test_log_that_the_power_cut_off_at_any_byte_has_every_line_before_it(tmp_path: Path, tail: bytes) -> None:
    run = write(tmp_path / RUN, numbered([HEADER, event("armed", 0.5), tick(1.0), tick(2.0)]))
    whole = (run / FILE_NAME).read_bytes()
    ends = [at for at, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(ends[0] + 1, len(whole), 3):
        (run / FILE_NAME).write_bytes(whole[:cut] + tail)
        lines = sum(end < cut for end in ends)
        assert len(list(RunReader(run))) == lines
        found = last_run(tmp_path)
        assert found is not None
        assert found.last_t_s == [100.0, 100.5, 101.0, 102.0][lines - 1] or cut in ends, "only its end is missing"


INTEGERS = st.integers(-(2**63), 2**64 - 1)  # those that the log's JSON can hold
ODD = st.none() | st.booleans() | INTEGERS | st.floats() | st.text() | st.lists(INTEGERS, max_size=2)


@given(st.lists(st.dictionaries(st.sampled_from(["record", "t_s", "t_wall", "name", "phase"]), ODD), max_size=5))
def test_records_that_no_rover_wrote_stop_nothing(tmp_path_factory: pytest.TempPathFactory, odd: list[Record]) -> None:
    logs = tmp_path_factory.mktemp("logs")
    write(
        logs / RUN,
        [{"record": "event", "t_s": 1.0, **{k: v for k, v in each.items() if k != "record"}} for each in odd],
    )
    last_run(logs)
    assert new_run_folder(logs).name.startswith("00018-")
