"""How many faults end a mission: counts, pairs, reasons; and that ``docs/reference/faults.md`` tells of each."""

from __future__ import annotations

import re

import pytest

from tests.fault_scenarios.missions_page import HEAD, HEADLINE, PAGE, TABLE, part
from wayfarer.fault_scenarios.catalogue import catalogue
from wayfarer.fault_scenarios.missions import Mission, Strike, Striking, faults_of
from wayfarer.fault_scenarios.survival import NO_REASON, REASONS, MissionLine, headline, summed_up
from wayfarer.safety.conditions import Level
from wayfarer.safety.responses import LEVELS

OUT = Mission(10.0, 100.0, 80.0, "", {})
LONGER = OUT._replace(path_m=100.0, mode_s={"motion_lost": 40.0, "motion_unknown": 4.0})
LATCHED = OUT._replace(ended="fault: motors_failed", mode_s={"motors_failed": 0.05})
SPENT = OUT._replace(ended="path", mode_s={"heading_reckoned": 60.0})


def faults(*names: str) -> list[Striking]:
    return faults_of([row for row in catalogue() if row.name in names])[0]


def lines(*pairs: tuple[Mission, Mission]) -> list[MissionLine]:
    """The lines of a fault that lasted as the second of each pair says, and ended harmlessly for a while."""
    strikes = [Strike(0, trial, well, (struck, OUT)) for trial, (well, struck) in enumerate(pairs)]
    return list(summed_up(faults("motors-nack"), strikes))


def test_paths_are_compared_in_missions_that_got_out_both_ways() -> None:
    good, brief = lines((OUT, LONGER), (OUT._replace(path_m=500.0), LATCHED), (OUT._replace(path_m=60.0), OUT))
    assert (good.missions, good.out_without, good.out) == (3, 3, 2)
    assert (good.path_without_m, good.path_m) == (70.0, 90.0)
    assert (good.lasts_s, brief.lasts_s) == (None, 10.0)
    assert brief.out == 3


def test_conditions_are_told_longest_first_and_ends_are_counted() -> None:
    good, brief = lines((OUT, LONGER), (OUT, LATCHED))
    assert list(good.mode_s.items()) == [("motion_lost", 20.0), ("motion_unknown", 2.0), ("motors_failed", 0.03)]
    assert (good.ended, brief.ended) == ({"fault: motors_failed": 1}, {})


@pytest.mark.parametrize(
    ("pairs", "ends"),
    [
        ([(OUT, OUT), (OUT, LATCHED)], False),
        ([(OUT, OUT), (OUT, LATCHED), (OUT, LATCHED)], True),
        ([(OUT, OUT), (OUT, LATCHED), (SPENT, LATCHED)], False),
        ([(SPENT, LATCHED)], False),
    ],
    ids=["half get out", "fewer", "one that is lost without it does not count", "none gets out without it"],
)
def test_fault_ends_missions_if_fewer_than_half_get_out_that_do_without_it(
    pairs: list[tuple[Mission, Mission]], ends: bool
) -> None:
    good, _ = lines(*pairs)
    assert (good.ends_missions, bool(good.reason)) == (ends, ends)


def test_reason_is_that_of_the_condition_that_ended_most() -> None:
    (good, _), (spent, _) = lines((OUT, LATCHED), (OUT, LATCHED), (OUT, SPENT)), lines((OUT, SPENT))
    assert good.reason == REASONS["motors_failed"]
    assert spent.reason == NO_REASON, "what need not end a mission is told as such"


def test_every_condition_that_latches_has_its_reason() -> None:
    assert {each.value for each, level in LEVELS.items() if level is Level.FAULT} <= REASONS.keys()


def test_headline_counts_faults_and_rows_and_gives_each_reason_once() -> None:
    three = faults("motors-nack", "motors-two-nacks", "board-fault")
    strikes = [Strike(number, 0, OUT, (struck, OUT)) for number, struck in enumerate((LATCHED, OUT, LATCHED))]
    told = list(headline(list(summed_up(three, strikes))))
    assert told[0].startswith("2 of 3 faults that last end a mission: fewer than half")
    assert told[1] == "They are in 2 of the 2 rows of the fault catalogue that can strike"
    assert told[2] == "Of the same faults for 10 s 0 of 3 end a mission"
    assert told[3:] == [f"motors-nack, board-fault: {REASONS['motors_failed']}"]


def test_headline_of_a_users_own_faults_speaks_of_no_rows() -> None:
    own = [each._replace(rows=()) for each in faults("board-fault")]
    told = list(headline(list(summed_up(own, [Strike(0, 0, OUT, (OUT, OUT))]))))
    assert [line.split()[0] for line in told] == ["0", "Of"]


# -- docs/reference/faults.md ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cells() -> list[list[str]]:
    """The cells of the page's table."""
    _, table, _ = part(PAGE.read_text(encoding="utf-8"), TABLE)
    assert table.startswith(HEAD)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def test_page_tells_of_faults_of_the_catalogue_in_its_order(cells: list[list[str]]) -> None:
    """One that is new need not be there: all of them take hours to run again."""
    names = [each.scenario.name for each in faults_of(catalogue())[0]]
    told = [line[1].strip("`") for line in cells]
    assert told == [name for name in names if name in told]
    assert len(told) > 60


def test_headline_of_the_page_is_what_its_table_says(cells: list[list[str]]) -> None:
    _, told, _ = part(PAGE.read_text(encoding="utf-8"), HEADLINE)
    ending = {name for _, name, _, without, out, *_ in cells if 2 * int(out) < int(without)}
    assert told.startswith(f"**{len(ending)} of {len(cells)} faults that last end a mission: fewer than half")
    assert set(re.findall("`[^`]+`", told)) == ending
