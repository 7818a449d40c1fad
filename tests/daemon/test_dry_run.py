"""A dry run: everything happens but motion."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tests.virtual import run_virtually
from wayfarer.daemon.dry_run import DryMotors
from wayfarer.hal import STOP, DriveMotors, MotorHealth, WheelCommand, troubles_of
from wayfarer.testing import check_motors


class Motors:
    """Notes what is done to it."""

    name = "bench motors"
    deadman_s: float | None = 0.25

    def __init__(self) -> None:
        self.done: list[str] = []
        self.commands: list[WheelCommand] = []
        self.turning = WheelCommand(0.25, 0.5)

    async def open(self) -> None:
        self.done.append("open")

    async def close(self) -> None:
        self.done.append("close")

    async def drive(self, command: WheelCommand) -> WheelCommand:
        self.commands.append(command)
        self.turning = command
        return command

    async def stop(self) -> None:
        self.done.append("stop")

    def halt(self) -> None:
        self.done.append("halt")

    async def read_back(self) -> WheelCommand | None:
        return self.turning

    async def health(self) -> MotorHealth:
        return MotorHealth(11.5, ("hot",))


DUTIES = st.floats(-1, 1)


@given(st.lists(st.builds(WheelCommand, DUTIES, DUTIES), min_size=1, max_size=20))
def test_board_never_sees_a_command_that_is_not_zero(commands: list[WheelCommand]) -> None:
    motors = Motors()
    dry = DryMotors(motors)

    async def main() -> list[WheelCommand]:
        return [await dry.drive(command) for command in commands]

    applied = run_virtually(main())
    assert applied == [STOP] * len(commands), "what was applied is told, not what was wanted"
    assert motors.commands == [STOP] * len(commands), "the board is asked each time: its deadman is watched as ever"


async def test_everything_else_reaches_the_board() -> None:
    motors = Motors()
    dry = DryMotors(motors)
    assert isinstance(dry, DriveMotors)
    assert (dry.name, dry.deadman_s) == ("bench motors (dry run)", 0.25)
    await dry.open()
    await dry.stop()
    dry.halt()
    await dry.close()
    assert motors.done == ["open", "stop", "halt", "close"]
    assert await dry.read_back() == WheelCommand(0.25, 0.5)
    assert await dry.health() == MotorHealth(11.5, ("hot",))


def test_troubles_of_the_board_are_told_in_a_dry_run_too() -> None:
    motors = Motors()
    assert troubles_of(DryMotors(motors)) == {}
    motors.troubles = {"transfers retried": 1}  # type: ignore[attr-defined]
    assert troubles_of(DryMotors(motors)) == {"transfers retried": 1}


async def test_dry_motors_keep_the_promises_of_motors() -> None:
    await check_motors(lambda: DryMotors(Motors()))
