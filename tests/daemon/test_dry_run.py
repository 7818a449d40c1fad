"""A dry run: everything happens but motion."""

from __future__ import annotations

from typing import Any
from unittest.mock import call, create_autospec

from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.clearing import steady_world
from tests.virtual import run_virtually
from wayfarer.daemon.daemon import DryMotors
from wayfarer.hal import STOP, DriveMotors, WheelCommand, error_counts_of
from wayfarer.simhal.parts import SimMotors
from wayfarer.testing import check_motors

DUTIES = st.floats(-1, 1)


def board() -> Any:
    """A motor board that notes what is done to it."""
    noted = create_autospec(DriveMotors, instance=True)
    noted.name, noted.deadman_s, noted.error_counts = "bench motors", 0.25, {"transfers retried": 1}
    noted.drive.side_effect = lambda command: command
    return noted


@given(st.lists(st.builds(WheelCommand, DUTIES, DUTIES), min_size=1, max_size=20))
def test_board_never_sees_a_command_that_is_not_zero(commands: list[WheelCommand]) -> None:
    motors = board()
    dry = DryMotors(motors)

    async def main() -> list[WheelCommand]:
        return [await dry.drive(command) for command in commands]

    applied = run_virtually(main())
    assert applied == [STOP] * len(commands), "what was applied is told, not what was wanted"
    asked = motors.drive.await_args_list
    assert asked == [call(STOP)] * len(commands), "the board is asked each time: its deadman is watched as ever"


async def test_everything_else_reaches_the_board() -> None:
    motors = board()
    dry = DryMotors(motors)
    assert isinstance(dry, DriveMotors)
    assert (dry.name, dry.deadman_s, error_counts_of(dry)) == ("bench motors (dry run)", 0.25, {"transfers retried": 1})
    for method in (dry.open, dry.stop, dry.close):
        await method()
    dry.halt()
    assert motors.method_calls == [call.open(), call.stop(), call.close(), call.halt()]
    assert await dry.read_back() is motors.read_back.return_value
    assert await dry.health() is motors.health.return_value


def test_dry_motors_keep_the_promises_of_motors() -> None:
    run_virtually(check_motors(lambda: DryMotors(SimMotors(steady_world()))))
