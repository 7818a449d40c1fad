"""The table of results, at every width of a terminal."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from wayfarer.fault_scenarios.results import Result, Tried, print_results, skipped_lines, summed_up
from wayfarer.fault_scenarios.scenario import ResponseLevel

MET = Result(
    "compass-answers-45-ms-late", 9, "answers come late", Tried.SIMULATED, "reject",
    ResponseLevel.NONE, ResponseLevel.NONE, None,
    "compass: an older reading at +0.02 s", None, None, "", (), "the readings are used as late as they are",
)  # fmt: skip
MISSED = Result(
    "undervoltage-thrice", 32, "the supply sags three times in a minute", Tried.SIMULATED, "S1 + duty cap; S2",
    ResponseLevel.HOLD, ResponseLevel.FAULT, 21.0, "event power at +0.80 s", 120.82, 0.0, "power_unstable",
    ("S3 was reached, S2 is expected",),
)  # fmt: skip
OWN = MET._replace(row=None, name="[own]")


SKIPPED = MET._replace(name="camera-black", row=20, remark="", skipped="OpenCV is not installed")


def printed(width: int, *results: Result, untried: tuple[int, ...] = (), verbose: bool = True) -> str:
    console = Console(file=io.StringIO(), width=width)
    print_results(console, results, untried, verbose=verbose)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("width", [80, 115, 200])
def test_every_row_is_there_in_full_and_no_line_is_too_long(width: int) -> None:
    text = printed(width, MET, MISSED, OWN)
    assert max(map(len, text.splitlines())) <= width
    for each in ("compass-answers-45-ms-late", "undervoltage-thrice", "[own]", "120.82", "21.00", "ok", "FAILED"):
        assert each in text


def test_wider_terminals_show_more() -> None:
    narrow, middle, wide = (printed(width, MISSED) for width in (80, 115, 200))
    assert "S1 + duty cap" not in narrow
    assert "S1 + duty cap" in middle
    assert "power_unstable" not in middle
    assert "power_unstable" in wide
    assert "event power at +0.80 s" in wide


def test_what_failed_remarks_and_what_was_skipped_stand_below() -> None:
    also = SKIPPED._replace(name="camera-gone")
    text = printed(80, MET, MISSED, SKIPPED, also, SKIPPED._replace(name="bumped", skipped="no bumper"), untried=(3, 4))
    for title, line in {
        "Not as expected": "undervoltage-thrice: S3 was reached, S2 is expected",
        "Remarks": "compass-answers-45-ms-late: the readings are used as late as they are",
        "Skipped": "camera-black, camera-gone: OpenCV is not installed\n  bumped: no bumper",
        "Untried": "no scenario for row 3, 4 of the fault catalogue",
    }.items():
        assert f"{title}\n  {line}" in text


def test_only_what_failed_is_printed_unless_asked_and_the_sum_has_ten_lines_at_most() -> None:
    many = [SKIPPED._replace(name=f"s{number}", skipped=f"reason {number}") for number in range(30)]
    by_tests = [SKIPPED._replace(tried=Tried.TEST, skipped=f"covered by test {number}") for number in range(30)]
    text = printed(80, MET, MISSED, *many, *by_tests, verbose=False)
    assert "undervoltage-thrice: S3 was reached, S2 is expected" in text
    assert not any(word in text for word in ("compass-answers", "Remarks", "covered by test 3", "reason 29"))
    told = printed(80, MET, *many, *by_tests, verbose=False).splitlines()
    assert len(told) <= 10
    assert "30 scenarios skipped: covered by a test in wayfarer's checkout" in told


def test_a_remark_of_several_is_told_once() -> None:
    assert "\n  compass-answers-45-ms-late, [own]: the readings are used" in printed(80, MET, OWN)


def test_row_is_as_expected_if_all_its_scenarios_are() -> None:
    lines = list(summed_up([MET, MET._replace(name="b", problems=("no",)), MISSED._replace(problems=())], (3,)))
    assert lines == [
        "2 of 3 scenarios as expected: 3 in virtual time",
        "1 of 3 rows of the catalogue as expected",
    ]
    assert list(summed_up([MET, SKIPPED, SKIPPED._replace(row=9), MISSED])) == [
        "1 of 2 scenarios as expected: 2 in virtual time; 2 skipped",
        "0 of 3 rows of the catalogue as expected; 2 not fully tested",
    ]


@pytest.mark.parametrize("width", [80, 115, 200])
def test_row_that_was_skipped_is_marked_and_has_no_level(width: int) -> None:
    line = next(line for line in printed(width, SKIPPED).splitlines() if "camera-black" in line)
    assert "skipped" in line
    assert not {"ok", "FAILED", "-"} & set(line.split())


def test_each_reason_for_skipping_is_told_once() -> None:
    assert list(skipped_lines([SKIPPED, SKIPPED, SKIPPED._replace(skipped="no bumper")])) == [
        "2 scenarios skipped: OpenCV is not installed",
        "1 scenario skipped: no bumper",
    ]


def test_scenarios_of_ones_own_have_no_rows() -> None:
    assert list(summed_up([OWN])) == ["1 of 1 scenarios as expected: 1 in virtual time"]
    assert list(summed_up([])) == ["0 of 0 scenarios as expected: none"]
