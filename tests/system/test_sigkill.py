"""The daemon is killed at a few random instants; ``python -m tests.system.sigkill --kills 200`` does it more often."""

from __future__ import annotations

import pytest

from tests.system.killer import Kill, Life, sweep
from tests.system.sigkill import table


@pytest.mark.slow
def test_every_kill_leaves_standing_wheels_and_a_whole_log() -> None:
    kills = list(sweep(12, seed=12))  # ten at one rover, two at the other
    print(table(kills))
    assert [kill.problems for kill in kills] == [()] * 12
    assert {kill.life for kill in kills} == set(Life)
    assert {kill.rover for kill in kills} == {"forestrover", "minirover"}
    assert sum(kill.silence_s is not None for kill in kills) >= 3, "most of those that were killed while they drove"


def test_table_has_a_row_for_each_part_of_life_and_the_figures_of_all() -> None:
    kills = [
        Kill("minirover", Life.DRIVING, 0.25, 0.2, 0.1, False, ()),
        Kill("minirover", Life.DRIVING, 0.25, 0.24, 0.2, True, ("the log is gone",)),
        Kill("minirover", Life.STARTING, None, None, None, False, ()),
    ]
    rows = {line.partition("  ")[0]: line.split() for line in table(kills).splitlines()}
    assert len(rows) == 2 + len(Life) + 1
    assert rows["minirover starting"][2:] == ["1", "0", "-", "-", "-", "0", "0"]
    assert rows["all"][1:3] == ["3", "2"]
    assert rows["all"][3:8] == ["0.250", "/", "0.250", "/", "0.250"]
    assert rows["all"][8:13] == ["0.200", "/", "0.220", "/", "0.240"]
    assert rows["all"][-2:] == ["1", "1"]
