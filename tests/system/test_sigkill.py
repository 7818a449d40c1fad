"""The daemon is killed at random instants. More often:
``KILLS=200 pytest -n 0 -m long -s tests/system/test_sigkill.py``.
"""

from __future__ import annotations

import os

import pytest

from tests.system.killer import Life, sweep

KILLS = int(os.environ.get("KILLS", "12"))  # ten at one rover, then ten at the other; each takes about three seconds


@pytest.mark.long
def test_every_kill_leaves_standing_wheels_and_a_whole_log() -> None:
    kills = []
    for kill in sweep(KILLS, seed=12):
        print(kill)
        kills.append(kill)
    assert [kill.problems for kill in kills] == [()] * KILLS
    assert {kill.life for kill in kills} == set(Life)
    assert {kill.rover for kill in kills} == {"forestrover", "minirover"}
    assert sum(kill.silence_s is not None for kill in kills) >= 3, "most of those that were killed while they drove"
