"""The guard of results: what has changed is found, and told as worse, not worse or undecided."""

from __future__ import annotations

from copy import deepcopy

from benchmarks.guard import CAMPAIGNS, compare, stored_rows
from benchmarks.size import code_lines

NAME = "clutter-minirover"


def verdicts(lost: int, pairs: int = 500) -> dict[str, str]:
    """What the guard says of each figure if so many more trials end entrapped."""
    before = stored_rows(NAME)[:pairs]
    now = deepcopy(before)
    for row in [row for row in now if row["outcome"] == "escaped"][:lost]:
        row.update(outcome="entrapped", spl="0.0000")
    return {line[2]: line[-1] for line in compare(NAME, before, now)}


def test_rows_of_every_campaign_are_stored() -> None:
    for name, campaign in CAMPAIGNS.items():
        rows = stored_rows(name)
        assert len(rows) == campaign.stored * len({row["algorithm"] for row in rows})
        assert campaign.trials <= campaign.stored


def test_same_rows_are_no_change() -> None:
    assert verdicts(lost=0) == {}


def test_many_lost_trials_are_worse_whatever_the_others_do() -> None:
    assert verdicts(lost=40) == {"success": "worse", "path": "not worse", "spl": "worse"}


def test_one_lost_trial_of_few_is_undecided() -> None:
    assert verdicts(lost=1, pairs=60)["success"] == "undecided"


def test_few_layouts_decide_nothing() -> None:
    assert set(verdicts(lost=5, pairs=9).values()) == {"undecided"}


def test_comments_docstrings_and_imports_are_no_code() -> None:
    lines = ['"""Doc', 'of two lines."""', "from a import (", "    b,", ")", "", "# why", "X = 1", '"""Said."""']
    lines += ["def f():", '    "doc"', '    return """two', 'lines"""']
    text = "\n".join(lines)
    assert code_lines(text) == {8, 10, 12, 13}
