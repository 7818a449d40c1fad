"""Whatever cut a log short or broke it, every record that is whole is read back, and the rest is counted."""

from __future__ import annotations

import errno
import os
import tempfile
import tracemalloc
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, cast

import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fieldlog.lines import event, header, read, tick
from wayfarer.errors import BadInput, NothingReadable
from wayfarer.fieldlog import lines, reader
from wayfarer.fieldlog.lines import LogLines, sealed
from wayfarer.fieldlog.reader import Damage, RunReader, log_segments, read_header
from wayfarer.fieldlog.schema import Record

LINES = [header(1), *map(tick, range(1, 6)), event(6)]
LOG = b"".join(line + b"\n" for line in LINES)
LAST = len(LINES[-1]) + 1
HEAD = LOG[:-LAST]
WHOLE = [cast(Record, LogLines().take(line + b"\n")) for line in LINES]


def read_bytes(*parts: bytes) -> tuple[list[Record], Damage]:
    """Read a log of these parts, the newest last."""
    with tempfile.TemporaryDirectory() as folder:
        for number, data in enumerate(parts, start=1):
            Path(folder, f"run.{number:05d}.jsonl").write_bytes(data)
        its, found = RunReader(Path(folder)), []
        with suppress(BadInput):  # where there is nothing in it
            found = list(its)
        return found, its.damage


def test_log_cut_at_any_byte_of_its_last_record_gives_all_the_others() -> None:
    for cut in range(LAST):
        found, damage = read_bytes(HEAD + LOG[len(HEAD) :][:cut])
        assert found == WHOLE[:-1]
        assert damage == Damage(torn=1 if cut else 0), cut
    assert read_bytes(LOG) == (WHOLE, Damage())


@given(st.integers(0, LAST), st.integers(1, 20_000), st.booleans())
def test_tail_of_nul_bytes_after_any_cut_is_counted_once(cut: int, nuls: int, ended: bool) -> None:
    found, damage = read_bytes(HEAD + LOG[len(HEAD) :][:cut] + bytes(nuls) + b"\n" * ended)
    assert found == (WHOLE if cut == LAST else WHOLE[:-1])
    assert damage == Damage(nul=1)


@given(st.integers(0, LAST - 1), st.binary(max_size=300))
def test_garbage_after_any_cut_costs_no_record_before_it(cut: int, garbage: bytes) -> None:
    found, damage = read_bytes(HEAD + LOG[len(HEAD) :][:cut] + garbage)
    assert found in (WHOLE[:-1], WHOLE)  # the garbage may be the missing end of line
    assert bool(cut or garbage) == bool(damage.lines or found == WHOLE)


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
        b'{"record": "tock", "t_s": 1.0}',
        b'{"record": "tick"}',
        b'{"record": "tick", "t_s": null}',
        b'{"record": "tick", "t_s": NaN}',
        b'{"record": ["tick"], "t_s": 1.0}',
        b"[1, 2]",
        b"",
        b"[" * 5000,
    ],
)
def test_line_that_is_no_record_is_garbled(line: bytes) -> None:
    assert read_bytes(HEAD + line + b"\n" + event(6) + b"\n") == (WHOLE, Damage(garbled=1))


def test_oversized_line_is_skipped_to_its_end_and_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "LINE_BYTES", 200)
    monkeypatch.setattr(lines, "LINE_BYTES", 200)
    for length in (200, 201, 399, 400, 1234):
        assert read_bytes(HEAD + b"x" * length + b"\n" + event(6) + b"\n") == (WHOLE, Damage(oversized=1))
        assert read_bytes(LOG + b"x" * length) == (WHOLE, Damage(oversized=1))
        assert read_bytes(LOG + bytes(length)) == (WHOLE, Damage(nul=1))


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
    assert (found, its.damage) == (WHOLE, Damage(nul=1))
    assert peak_bytes < 8_000_000


def test_line_torn_in_any_part_costs_only_itself() -> None:
    parts = [HEAD, header(2) + b"\n" + tick(6)[:-5], header(3) + b"\n" + tick(7) + b"\n" + tick(8)[:1]]
    found, damage = read_bytes(*parts)
    assert [record.get("n", record.get("part")) for record in found] == [1, 1, 2, 3, 4, 5, 2, 3, 7]
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
    assert read_bytes(part(1, 1, 3, 2, 4))[1] == Damage(disordered=1, missing=1)
    assert read_bytes(part(1, 1, 5, 2))[1] == Damage(disordered=1, missing=3), "5 has its checksum"


def test_part_that_cannot_be_read_costs_only_itself(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl").mkdir()  # opening it is an error for every user
    (tmp_path / "run.00002.jsonl").write_bytes(header(2) + b"\n" + tick(6) + b"\n")
    found, its = read(tmp_path)
    assert [record["record"] for record in found] == ["run", "tick"]
    assert its.damage == Damage(unreadable=1, missing=5)


def test_log_of_which_nothing_can_be_read_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl").mkdir()
    with pytest.raises(BadInput, match=r"run\.00001\.jsonl: cannot be read: it is a folder"):
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


def test_part_that_is_longer_than_any_gives_its_beginning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "PART_BYTES", 100_000)
    monkeypatch.setattr(reader, "LINE_BYTES", 1000)
    (tmp_path / "run.00001.jsonl").write_bytes(LOG)
    with (tmp_path / "run.00001.jsonl").open("r+b") as file:
        file.truncate(10**12)
    found, its = read(tmp_path)
    assert (found, its.damage) == (WHOLE, Damage(unreadable=1))
    (tmp_path / "run.00001.jsonl").write_bytes(b"\n" * 100_001)
    with pytest.raises(NothingReadable, match="cannot be read: it has more than 100,000 bytes"):
        read(tmp_path)


def test_file_of_garbage_is_not_read_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "BROKEN_LINES", 100)
    (tmp_path / "run.00001.jsonl").write_bytes(LOG + b"\n" * 1000)
    found, its = read(tmp_path)
    assert (found, its.damage) == (WHOLE, Damage(garbled=101, unreadable=1))


@pytest.mark.parametrize("key", ["version", "boot_id", "seed", "rover", "config_hash"])
@pytest.mark.parametrize("begins_a_part", [False, True])
def test_header_of_another_run_is_named_and_left_out(key: str, begins_a_part: bool) -> None:
    another = sealed(orjson.loads(header(2)) | {key: "another"}) + b"\n"
    rest = another + event(6) + b"\n"
    found, damage = read_bytes(*([HEAD, rest] if begins_a_part else [HEAD + rest]))
    assert (found, damage) == (WHOLE, Damage(foreign=1, headless=int(begins_a_part)))
    assert "1 header is of another run" in str(damage)


def test_flipped_bit_costs_its_line_and_no_other() -> None:
    at = LOG.index(b'"t_s":0.2') + len(b'"t_s":0.')  # a number that is as good as any
    for bit in range(8):
        flipped = LOG[:at] + bytes([LOG[at] ^ 1 << bit]) + LOG[at + 1 :]
        found, damage = read_bytes(flipped)
        assert found == [*WHOLE[:4], *WHOLE[5:]]
        assert damage.lines == damage.missing == 1
    assert read_bytes(LOG.replace(b'"t_s":0.2,', b'"t_s":9.2,'))[1] == Damage(changed=1, missing=1)


@pytest.mark.parametrize("broken", [b',"crb":"', b',"CRC":"', b',"crc" :"'])
@pytest.mark.parametrize("number", range(len(LINES)))
def test_line_whose_checksum_cannot_be_found_was_changed(number: int, broken: bytes) -> None:
    lines = [line + b"\n" for line in LINES]
    lines[number] = lines[number].replace(b',"crc":"', broken)
    found, damage = read_bytes(b"".join(lines))
    assert found == [*WHOLE[:number], *WHOLE[number + 1 :]]
    assert (damage.lines, damage.changed) == (1, 1)


def test_lines_that_are_there_twice_or_elsewhere_are_out_of_order() -> None:
    lines = [line + b"\n" for line in LINES]
    assert read_bytes(b"".join([*lines[:4], *lines[2:]])) == (WHOLE, Damage(disordered=2))
    found, damage = read_bytes(b"".join([*lines[:2], lines[3], lines[2], *lines[4:]]))
    assert (found, damage) == ([*WHOLE[:2], *WHOLE[3:]], Damage(disordered=1, missing=1))


def test_log_of_schema_2_is_read_without_checksums() -> None:
    old = [record | ({"schema": 2} if record["record"] == "run" else {}) for record in WHOLE]
    lines = [orjson.dumps(record) + b"\n" for record in old]
    assert read_bytes(b"".join(lines)) == (old, Damage())
    lines[3] = lines[3].replace(b'"t_s":0.15', b'"t_s":-1.0')
    assert read_bytes(b"".join(lines)) == ([*old[:3], *old[4:]], Damage(wrong=1, missing=1)), "ranges are judged"


def test_header_is_found_in_a_later_part_where_the_first_is_damaged(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl").write_bytes(bytes(100) + LOG[100:])
    with pytest.raises(BadInput, match="does not say what ran"):
        read_header(tmp_path)
    (tmp_path / "run.00001.jsonl").write_bytes(header(2) + b"\n")
    assert read_header(tmp_path)["part"] == 2


def test_damage_says_what_it_is() -> None:
    assert str(Damage()) == "complete"
    assert str(Damage(torn=2, missing=14)) == "2 lines are torn, 14 records are missing"
    assert str(Damage(nul=1, oversized=1, garbled=3, unreadable=1)) == (
        "1 line is filled with NUL bytes, 1 line is far too long, 3 lines are no records, "
        "1 part of the log cannot be read"
    )
