"""The board's power dips, then the daemon is killed; ``python -m tests.system.brown_out`` does it more often."""

from __future__ import annotations

import pytest

from tests.system.brown_out import kills


@pytest.mark.slow
def test_wheels_stand_within_the_deadman_after_a_brown_out_of_the_board_and_the_death_of_the_daemon() -> None:
    done = list(kills(6, seed=24))
    assert {kill.rover for kill in done} == {"forestrover", "minirover"}
    assert [kill for kill in done if not kill.stands] == []
