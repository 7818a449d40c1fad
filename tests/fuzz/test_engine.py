"""The fuzzer itself: it finds what is planted, makes it small, and does the same again from the same seed."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

import orjson
import pytest
from hypothesis import strategies as st

import tests.fuzz.__main__ as command
from tests.fuzz.covered import Covered
from tests.fuzz.damage import DEPTH, as_json, bytes_of, changed, damaged, nested
from tests.fuzz.engine import fuzz_cases, fuzz_for
from tests.fuzz.target import Case, Target, reading, shape
from wayfarer.errors import BadReading

WHOLE = b"\x01\x02\x03\x04\x05\x06\x07\x08"


def decode(data: bytes) -> int:
    """Read what the third byte says, as a driver might; a zero there is a bug."""
    if len(data) != len(WHOLE):
        raise BadReading("too short or too long: look at the wires")
    if data[0] != 0x01:
        raise BadReading("another part: look at its address")
    if data[2] == 0x00:
        raise ValueError("nothing to divide by")
    return data[2]


PLANTED = Target(
    "planted",
    [f"{__name__}:decode"],
    lambda kept: bytes_of([WHOLE, *kept]),
    lambda: nullcontext(lambda data: reading(lambda: f"{decode(data)} read")),
)


def staircase(data: bytes) -> int:
    """Have a bug that is three bytes away from the whole, where each one right is a line of its own."""
    if data[1:2] != b"\xa1":
        return 0
    if data[3:4] != b"\xb2":
        return 1
    if data[5:6] != b"\xc3":
        return 2
    raise ValueError("the top")


def _one_byte_changed(kept: Sequence[Case]) -> st.SearchStrategy[Case]:
    def put(content: bytes, place: int, byte: int) -> bytes:
        return content[:place] + bytes([byte]) + content[place + 1 :]

    places = st.integers(0, len(WHOLE) - 1)
    return st.builds(put, st.sampled_from([WHOLE, *kept]), places, st.sampled_from(b"\xa1\xb2\xc3\xd4"))


def test_planted_bug_is_found_and_made_small() -> None:
    found = fuzz_cases(PLANTED, 2_000)
    assert isinstance(found.error, ValueError)
    assert (len(found.case), found.case[0], found.case[2]) == (len(WHOLE), 0x01, 0x00)


def test_same_seed_tries_the_same_cases() -> None:
    first, again, other = (fuzz_cases(PLANTED, 100, seed) for seed in (1, 1, 2))
    assert (first.cases, first.outcomes) == (again.cases, again.outcomes)
    assert first.outcomes != other.outcomes


def test_case_that_reached_something_new_is_changed_further() -> None:
    climbing = Target(
        "climbing", [f"{__name__}:staircase"], _one_byte_changed, lambda: nullcontext(lambda data: f"{staircase(data)}")
    )
    assert fuzz_cases(climbing, 500).error is None  # three steps at once are out of reach
    found = fuzz_for(climbing, seconds=20.0, seed=0)
    assert isinstance(found.error, ValueError)
    assert found.coverage == 1.0


def test_refusal_is_an_outcome_and_any_other_error_is_not() -> None:
    with PLANTED.opened() as attempt:
        assert attempt(b"") == "BadReading: too short or too long: look at the wires"
        assert attempt(WHOLE) == "3 read"
        with pytest.raises(ValueError, match="nothing to divide by"):
            attempt(WHOLE.replace(b"\x03", b"\x00"))


def test_lines_are_counted_of_the_functions_that_are_named() -> None:
    covered = Covered([f"{__name__}:decode"])
    with covered.watching():
        decode(WHOLE)
        shape("not counted")
    lines = decode.__code__.co_firstlineno
    assert covered.count == 4
    assert [line - lines for line in covered.missing[__file__]] == [3, 5, 7]
    assert covered.share == pytest.approx(4 / 7)


def test_tool_that_traced_before_goes_on_afterwards() -> None:
    def trace(*_: object) -> None: ...

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        with Covered([f"{__name__}:decode"]).watching():
            assert sys.gettrace() is not trace
        assert sys.gettrace() is trace
    finally:
        sys.settrace(before)


def test_nothing_is_damaged_where_nothing_is_told() -> None:
    assert damaged((b"x",), (), WHOLE, b"") == WHOLE
    assert changed(b'{"a":[1,2]}', b"") == {"a": [1, 2]}


@pytest.mark.parametrize("depth", [1, DEPTH])
def test_json_may_be_deeper_than_orjson_writes(depth: int) -> None:
    assert orjson.loads(as_json(nested("x", depth))) == nested("x", depth)


def test_command_prints_a_table_and_keeps_a_failing_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "TARGETS", (PLANTED,))
    monkeypatch.setattr(sys, "argv", ["fuzz", "--seconds", "20", "--keep", str(tmp_path)])
    assert command.main() == 1
    table = capfd.readouterr().out
    assert "planted" in table
    assert "ValueError: nothing to divide by" in table
    assert (tmp_path / "planted.py").read_text().startswith("CASE = b'\\x01")
