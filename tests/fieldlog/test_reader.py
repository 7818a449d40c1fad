"""Whatever cut a log short or broke it, every record that is whole is read back, and the rest is counted."""

from __future__ import annotations

import errno
import gzip
import os
import tempfile
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, cast

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fieldlog.lines import event, header, read, tick
from wayfarer.errors import BadInput
from wayfarer.fieldlog import reader
from wayfarer.fieldlog.reader import Damage, Lines, RunReader, find_header, log_segments
from wayfarer.fieldlog.record import AnyRecord, Header, Tick

LINES = [header(1), *map(tick, range(1, 6)), event(6)]
LOG = b"".join(line + b"\n" for line in LINES)
LAST = len(LINES[-1]) + 1
HEAD = LOG[:-LAST]
WHOLE = [cast(AnyRecord, Lines().parse(line)) for line in LINES]


def read_bytes(*parts: bytes) -> tuple[list[AnyRecord], Damage]:
    """Read a log of these parts, the newest last."""
    with tempfile.TemporaryDirectory() as folder:
        for number, data in enumerate(parts, start=1):
            Path(folder, f"run.{number:05d}.jsonl").write_bytes(data)
        its, found = RunReader(Path(folder)), []
        with suppress(BadInput):  # if there is nothing in it
            found = list(its)
        return found, its.damage


def test_log_cut_at_any_byte_of_its_last_record_gives_all_the_others() -> None:
    for cut in range(LAST - 1):
        found, damage = read_bytes(HEAD + LOG[len(HEAD) :][:cut])
        assert found == WHOLE[:-1]
        assert damage == Damage(torn=1 if cut else 0), cut
    assert read_bytes(LOG) == (WHOLE, Damage())


@given(st.integers(0, LAST - 2) | st.just(LAST), st.integers(1, 20_000), st.booleans())
def test_tail_of_nul_bytes_after_any_cut_is_counted_once(cut: int, nuls: int, ended: bool) -> None:
    found, damage = read_bytes(HEAD + LOG[len(HEAD) :][:cut] + bytes(nuls) + b"\n" * ended)
    assert found == (WHOLE if cut == LAST else WHOLE[:-1])
    assert damage == Damage(torn=1)


@given(st.integers(0, LAST - 2), st.binary(max_size=300))
def test_garbage_after_any_cut_costs_no_record_before_it(cut: int, garbage: bytes) -> None:
    found, damage = read_bytes(HEAD + LOG[len(HEAD) :][:cut] + garbage)
    assert found in (WHOLE[:-1], WHOLE)  # the garbage may be the missing end of line
    assert damage.lines or not (cut or garbage.strip()) or found == WHOLE


@given(st.integers(0, len(LOG)), st.integers(1, 400))
def test_hole_of_nul_bytes_costs_only_the_lines_that_it_touches(begin: int, length: int) -> None:
    end = min(len(LOG), begin + length)
    found, damage = read_bytes(LOG[:begin] + bytes(end - begin) + LOG[end:])
    at, untouched = 0, []
    for line, record in zip(LINES, WHOLE, strict=True):
        if at + len(line) + 1 <= begin or at >= end:
            untouched.append(record)
        at += len(line) + 1
    assert found == untouched
    assert damage.lines == (1 if end > begin else 0)


@given(st.lists(st.binary(max_size=200), max_size=8))
def test_no_bytes_at_all_can_make_the_reader_fail(chunks: list[bytes]) -> None:
    found, damage = read_bytes(*(b"\n".join(chunks[:index]) for index in range(len(chunks) + 1)))
    assert found == []
    assert damage.missing == 0


@pytest.mark.parametrize(
    "line",
    [
        b"\xff\xfe not text",
        b'{"record": "tick", "n": 9, "t_s": 1.0',
        b"[" * 5000,
        b'{"t_s": NaN}',
        b'"\xff"',
    ],
)
def test_line_that_is_no_json_is_torn(line: bytes) -> None:
    assert read_bytes(HEAD + line + b"\n" + event(6) + b"\n") == (WHOLE, Damage(torn=1))


@pytest.mark.parametrize(
    "line",
    [
        b'{"record": "tock", "t_s": 1.0, "t_wall": 1.0}',
        b'{"record": "", "t_s": "x"}',
        b"[1, 2]",
        b'{"record": ["tick"]}',
        b"{}",
    ],
)
def test_kind_that_is_not_known_is_counted_and_read_over(line: bytes) -> None:
    """A log may have kinds that only a newer wayfarer knows."""
    assert read_bytes(HEAD + line + b"\n" + event(6) + b"\n") == (WHOLE, Damage(unknown=1))


@pytest.mark.parametrize(
    ("line", "first"),
    [
        (b'{"record": "tick"}', "tick: Object missing required field `t_s`"),
        (b'{"record": "truth", "t_s": null, "t_wall": 1.0}', "truth: Expected `float`, got `null` - at `$.t_s`"),
        (b'{"record": "board", "t_s": 1e300, "t_wall": 1.0}', "board: Expected `float` <= 1000000000.0 - at `$.t_s`"),
    ],
)
def test_value_that_cannot_be_is_counted_and_the_first_is_named(line: bytes, first: str) -> None:
    found, damage = read_bytes(HEAD + line + b"\n" + event(6) + b"\n")
    assert (found, damage.lines, damage.wrong) == (WHOLE, 1, 1)
    assert str(damage) == f"1 record holds an impossible value (the first: {first})"


@pytest.mark.parametrize(
    "changed",
    [
        pytest.param(lambda log: log.replace(b"\n", b"\r\n"), id="line ends of another system"),
        pytest.param(lambda log: b"\xef\xbb\xbf" + log, id="byte-order mark of an editor"),
        pytest.param(lambda log: b"\n\n".join(log.split(b"\n")), id="empty lines"),
        pytest.param(
            lambda log: b"".join(msgspec.json.format(line, indent=0) + b"\n" for line in log.splitlines()), id="spaces"
        ),
        pytest.param(
            lambda log: b"".join(
                msgspec.json.encode(msgspec.json.decode(line), order="sorted") + b"\n" for line in log.splitlines()
            ),
            id="sorted keys",
        ),
    ],
)
def test_log_that_another_program_has_passed_on_is_whole(changed: Callable[[bytes], bytes]) -> None:
    assert read_bytes(changed(LOG)) == (WHOLE, Damage())


def test_packed_parts_and_a_single_file_of_any_name_are_read(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl.gz").write_bytes(gzip.compress(HEAD))
    (tmp_path / "run.00002.jsonl").write_bytes(header(2) + b"\n" + event(6) + b"\n")
    found, its = read(tmp_path)
    assert ([record.n for record in found], its.damage) == ([0, 1, 2, 3, 4, 5, 0, 6], Damage())
    (tmp_path / "of the rover (1).txt").write_bytes(LOG)
    assert read(tmp_path / "of the rover (1).txt")[0] == WHOLE
    (tmp_path / "run.00001.jsonl.gz").write_bytes(gzip.compress(HEAD)[:-20])
    assert read(tmp_path)[1].damage.unreadable == 1, "it ends too early"


@pytest.mark.parametrize("schema", [2, 3, 5])
def test_log_of_another_schema_is_refused_in_a_line(tmp_path: Path, schema: int) -> None:
    line = b'{"record":"run","t_s":1.0,"t_wall":1.0,"schema":%d,"part":1,"version":"9","crc":"01234567"}\n' % schema
    (tmp_path / "run.00001.jsonl").write_bytes(line + LOG)
    with pytest.raises(
        BadInput, match=rf"run.00001.jsonl: this log has schema {schema}, and wayfarer .* reads 4: read it"
    ):
        read(tmp_path)


def test_oversized_line_is_skipped_to_its_end_and_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "LINE_BYTES", 500)
    for length in (500, 501, 999, 1000, 1234):
        assert read_bytes(HEAD + b"x" * length + b"\n" + event(6) + b"\n") == (WHOLE, Damage(torn=1))
        assert read_bytes(LOG + b"x" * length) == (WHOLE, Damage(torn=1))
        assert read_bytes(LOG + bytes(length)) == (WHOLE, Damage(torn=1))


def test_hole_of_many_megabytes_takes_no_memory_and_hides_no_record_behind_it(tmp_path: Path) -> None:
    with (tmp_path / "run.00001.jsonl").open("wb") as file:
        file.write(HEAD)
        file.truncate(100_000_000)
        file.seek(0, 2)
        file.write(event(6) + b"\n")
    tracemalloc.start()
    found, its = read(tmp_path)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (found, its.damage) == (WHOLE, Damage(torn=1))
    assert peak_bytes < 8_000_000


def test_line_torn_in_any_part_costs_only_itself() -> None:
    parts = [HEAD, header(2) + b"\n" + tick(6)[:-5], header(3) + b"\n" + tick(7) + b"\n" + tick(8)[:1]]
    found, damage = read_bytes(*parts)
    assert [record.n for record in found] == [0, 1, 2, 3, 4, 5, 0, 0, 7]
    assert damage == Damage(torn=2, missing=1)


def test_parts_are_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for name in ("run.100000.jsonl", "run.99999.jsonl", "run.00001.jsonl"):
        (tmp_path / name).write_bytes(b"")
    for name in ("run.jsonl", "run.backup.jsonl", "run.00002.jsonl.bak", "notes.txt"):
        (tmp_path / name).write_bytes(b"no log")
    assert [part.name for part in log_segments(tmp_path)] == [
        "run.00001.jsonl", "run.99999.jsonl", "run.100000.jsonl",
    ]  # fmt: skip
    with pytest.raises(BadInput, match=r"nothing in this log can be read \(it is empty\)$"):
        read(tmp_path)


def test_missing_records_are_counted_across_parts() -> None:
    def part(number: int, *numbers: int) -> bytes:
        return b"".join(line + b"\n" for line in [header(number), *map(tick, numbers)])

    assert read_bytes(part(1, 1, 2, 4), part(2, 5), part(4, 9, 10))[1] == Damage(missing=4)
    assert read_bytes(part(3, 11, 12))[1] == Damage(missing=10), "the parts before it are not there"
    assert read_bytes(part(1, 1, 3, 2, 4))[1] == Damage(repeated=1, missing=1)
    assert read_bytes(part(1, 1, 5, 2))[1] == Damage(repeated=1, missing=3), "5 can be"


def test_part_that_cannot_be_read_costs_only_itself(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl").mkdir()  # opening it is an error for every user
    (tmp_path / "run.00002.jsonl").write_bytes(header(2) + b"\n" + tick(6) + b"\n")
    found, its = read(tmp_path)
    assert [type(record) for record in found] == [Header, Tick]
    assert its.damage == Damage(unreadable=1, missing=5)


def test_log_of_which_nothing_can_be_read_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl").mkdir()
    with pytest.raises(BadInput, match=r"nothing in this log can be read \(it is a folder"):
        read(tmp_path)
    with pytest.raises(BadInput, match="is no run"):
        RunReader(tmp_path / "run.00001.jsonl")
    with pytest.raises(BadInput, match="cannot be read: No such file"):
        RunReader(tmp_path / "none")


def test_part_that_breaks_off_in_an_error_gives_what_came_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(file: BinaryIO, _most_bytes: int) -> Iterator[bytes]:
        yield from (file.readline() for _ in range(4))
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(reader, "_lines", failing)
    (tmp_path / "run.00001.jsonl").write_bytes(LOG)
    found, its = read(tmp_path)
    assert (found, its.damage) == (WHOLE[:4], Damage(unreadable=1))


def test_file_of_garbage_is_not_read_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "BROKEN_LINES", 100)
    (tmp_path / "run.00001.jsonl").write_bytes(LOG + b"x\n" * 1000)
    found, its = read(tmp_path)
    assert (found, its.damage) == (WHOLE, Damage(torn=101, unreadable=1))


def test_lines_that_are_there_twice_or_elsewhere_are_out_of_order() -> None:
    lines = [line + b"\n" for line in LINES]
    assert read_bytes(b"".join([*lines[:4], *lines[2:]])) == (WHOLE, Damage(repeated=2))
    found, damage = read_bytes(b"".join([*lines[:2], lines[3], lines[2], *lines[4:]]))
    assert (found, damage) == ([*WHOLE[:2], *WHOLE[3:]], Damage(repeated=1, missing=1))


def test_header_is_found_in_a_later_part_if_the_first_is_damaged(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl").write_bytes(bytes(100) + LOG[100:])
    assert find_header(tmp_path) is None
    (tmp_path / "run.00002.jsonl").write_bytes(header(2) + b"\n")
    found = find_header(tmp_path)
    assert found is not None
    assert found.part == 2


def test_damage_says_what_it_is() -> None:
    assert str(Damage()) == "complete"
    assert str(Damage(torn=2, missing=14)) == "2 lines are torn, 14 records are missing"
    assert str(Damage(torn=1, unknown=3, unreadable=1)) == (
        "1 line is torn, 3 records are of an unknown kind, 1 part of the log cannot be read"
    )
