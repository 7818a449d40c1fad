"""Manoeuvres do what they are asked on any ground: closed on the compass and on the distance covered."""

from __future__ import annotations

from itertools import product
from statistics import mean

import pytest

from tests.simhal.mujoco.manoeuvring import manoeuvres

FRICTIONS = (0.15, 0.3, 0.5, 0.8)
MOTORS = (1.0, 3.0)
# MiniRover's motors cannot turn it at a friction of 0.8: docs/explanation/physics.md.
CANNOT_TURN = ("minirover", 0.8, 1.0)
CELLS = [cell for cell in product(("sim", "forestrover", "minirover"), FRICTIONS, MOTORS) if cell != CANNOT_TURN]
DONE = "turn_away.done"


@pytest.mark.long
@pytest.mark.parametrize(("rover", "friction", "torque_scale"), CELLS)
def test_turn_is_as_far_as_was_asked(rover: str, friction: float, torque_scale: float) -> None:
    done = manoeuvres(rover, friction, torque_scale)
    assert DONE in done.ends
    # The first turn on unknown ground may be short. ``sim`` turns at 180 degrees per second, while its wheels spin.
    assert mean(done.turned_deg[1:]) == pytest.approx(30.0, abs=4.5 if rover == "sim" else 3.0)


@pytest.mark.long
@pytest.mark.parametrize(("rover", "friction", "torque_scale"), CELLS)
def test_arc_has_the_radius_that_was_asked(rover: str, friction: float, torque_scale: float) -> None:
    done = manoeuvres(rover, friction, torque_scale, turn_deg=90.0)
    assert len(done.radii) >= 3
    assert mean(done.radii) == pytest.approx(1.0, abs=0.15)


def test_what_cannot_turn_gives_each_turn_up() -> None:
    done = manoeuvres(*CANNOT_TURN, episodes=2)
    assert done.ends == {"turn_away.exhausted"}
