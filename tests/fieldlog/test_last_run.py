"""The end of the run before: told from its last records, whatever has become of the file."""

from __future__ import annotations

import os
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.views.text.records import BEGAN_WALL_S, HEADER, RUN, drive, event, numbered, outcome, tick, write
from wayfarer.fieldlog import last_run
from wayfarer.fieldlog.folders import FILE_NAME, new_run_folder
from wayfarer.fieldlog.last_run import TAIL_BYTES, UnfinishedRun, unfinished_run
from wayfarer.fieldlog.lines import LogLines
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.schema import Record

STANDING: dict[str, Any] = {"phase": "halt", "why": "halt"}


def left(logs: Path, *records: Record) -> UnfinishedRun | None:
    write(logs / RUN, numbered([HEADER, *records]))
    return unfinished_run(logs)


def test_first_run_of_all_has_none_before_it(tmp_path: Path) -> None:
    assert unfinished_run(tmp_path / "not there") is None
    assert unfinished_run(tmp_path) is None


def test_run_with_an_outcome_was_ended_in_order(tmp_path: Path) -> None:
    assert left(tmp_path, event("armed", 1.0), tick(2.0), outcome(0.0)) is None


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
    assert left(tmp_path, *records) == UnfinishedRun(RUN, 100.0 + at_s, BEGAN_WALL_S + at_s, mode)


def test_only_the_newest_run_counts(tmp_path: Path) -> None:
    write(tmp_path / "00016-20261120T061405Z", numbered([HEADER, tick(1.0)]))
    assert left(tmp_path, tick(3.0), outcome(3.0)) is None


def test_only_the_end_of_a_long_log_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / RUN, numbered([HEADER, event("armed", 0.0), *drive(0.0, 500.0)]))
    size_b = (tmp_path / RUN / FILE_NAME).stat().st_size
    read = []
    take = LogLines.take

    def counted(lines: LogLines, line: bytes) -> Record | str:
        read.append(len(line))
        return take(lines, line)

    monkeypatch.setattr(LogLines, "take", counted)
    assert unfinished_run(tmp_path) == UnfinishedRun(RUN, 599.95, BEGAN_WALL_S + 499.95, "armed")
    assert sum(read) <= TAIL_BYTES < size_b


def test_part_that_has_just_begun_leaves_the_one_before_to_tell(tmp_path: Path) -> None:
    write(tmp_path / RUN, numbered([HEADER | {"t_s": 99.0}, event("armed", 1.0), tick(2.0)]), "run.00001.jsonl")
    assert left(tmp_path) == UnfinishedRun(RUN, 100.0, BEGAN_WALL_S, "armed")


@pytest.mark.parametrize("garbage", [b"", b"\0" * 100_000, b"{" * 100_000, b'{"record":"tick","t_s":'])
def test_end_that_cannot_be_read_is_told_and_stops_nothing(tmp_path: Path, garbage: bytes) -> None:
    (tmp_path / RUN).mkdir()
    (tmp_path / RUN / FILE_NAME).write_bytes(garbage)
    assert unfinished_run(tmp_path) == UnfinishedRun(RUN, error="nothing at the end of its log can be read")


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
    found = unfinished_run(tmp_path)
    assert found is not None
    assert f"it is a {kind}" in (found.error or "")


def test_file_of_the_kernel_that_has_nothing_yet_stops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a symlink to /proc/kmsg, which root may read."""

    class Waiting(BytesIO):
        def read(self, _size: int | None = -1) -> bytes:
            return cast(bytes, None)

    write(tmp_path / RUN, [HEADER])
    monkeypatch.setattr(last_run, "open_regular", lambda _: Waiting())
    assert unfinished_run(tmp_path) == UnfinishedRun(RUN, error="nothing at the end of its log can be read")


def test_folder_whose_name_is_no_text_can_be_told_in_json(tmp_path: Path) -> None:
    write(tmp_path / os.fsdecode(os.fsencode(RUN) + b"\x1b\xff"), [HEADER])
    assert unfinished_run(tmp_path) == UnfinishedRun(f"{RUN}\\x1b\\udcff", 100.0, BEGAN_WALL_S)


def test_torn_last_line_leaves_the_one_before_it(tmp_path: Path) -> None:
    run = write(tmp_path / RUN, numbered([HEADER, tick(1.0)]))
    with (run / FILE_NAME).open("ab") as file:
        file.write(b'{"record":"outcome","t_s":1')
    assert unfinished_run(tmp_path) == UnfinishedRun(RUN, 101.0, BEGAN_WALL_S + 1.0, "armed")


@pytest.mark.parametrize("tail", [b"", bytes(50)], ids=["cut", "NUL bytes"])
def test_log_that_the_power_cut_off_at_any_byte_has_every_line_before_it(tmp_path: Path, tail: bytes) -> None:
    run = write(tmp_path / RUN, numbered([HEADER, event("armed", 0.5), tick(1.0), tick(2.0)]))
    whole = (run / FILE_NAME).read_bytes()
    ends = [at for at, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(ends[0] + 1, len(whole), 3):
        (run / FILE_NAME).write_bytes(whole[:cut] + tail)
        lines = sum(end < cut for end in ends)
        assert len(list(RunReader(run))) == lines
        found = unfinished_run(tmp_path)
        assert found is not None
        assert found.last_t_s == [100.0, 100.5, 101.0, 102.0][lines - 1] or cut in ends, "only its end is missing"


ODD = st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.integers(), max_size=2)


@given(st.lists(st.dictionaries(st.sampled_from(["record", "t_s", "t_wall", "name", "phase"]), ODD), max_size=5))
def test_records_that_no_rover_wrote_stop_nothing(tmp_path_factory: pytest.TempPathFactory, odd: list[Record]) -> None:
    logs = tmp_path_factory.mktemp("logs")
    write(
        logs / RUN,
        [{"record": "event", "t_s": 1.0, **{k: v for k, v in each.items() if k != "record"}} for each in odd],
    )
    unfinished_run(logs)
    assert new_run_folder(logs).name.startswith("00018-")
