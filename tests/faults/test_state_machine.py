"""Any interleaving of faults, commands and time keeps the safety rules; and the machine that says so can fail."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest
from hypothesis import Phase
from hypothesis.stateful import run_state_machine_as_test

from tests.faults.broken_product import breaks_the_product
from tests.faults.daemon_machine import Daemon, DaemonMachine, machine_settings
from wayfarer.daemon.commands import RoverCommands
from wayfarer.hal import WheelCommand
from wayfarer.safety.gate import Gate
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.physics import Depth

EXAMPLES, STEPS = 40, 30


def find() -> None:
    """Run until something is found, without making it small: that takes minutes."""
    asked = machine_settings(EXAMPLES, STEPS, derandomize=True, phases=[Phase.generate])
    run_state_machine_as_test(DaemonMachine, settings=asked)


@pytest.mark.long
def test_any_interleaving_keeps_the_safety_rules() -> None:
    run_state_machine_as_test(DaemonMachine, settings=machine_settings(EXAMPLES, STEPS, derandomize=True))


def test_machine_drives_the_rover_and_ends_it_with_its_wheels_still() -> None:
    daemon = Daemon("sim", Depth.DEVICE, 0)
    daemon.pass_time(1.0)
    daemon.ask("arm", 0.0)
    daemon.pass_time(3.0)
    assert daemon.status()["mode"] == "armed"
    assert daemon.setup.world.forward_m > 0.5
    daemon.close()
    assert daemon.rules.broken == ()
    assert daemon.setup.world.commanded == (0.0, 0.0)


@pytest.mark.parametrize("kind", ["nack", "hang"])
def test_machine_lets_a_motor_board_heal_and_the_rover_drives_on(kind: str) -> None:
    daemon = Daemon("forestrover", Depth.BUS, 0)
    daemon.pass_time(1.0)
    daemon.ask("arm", 0.0)
    daemon.pass_time(3.0)
    board_fails = daemon.begin(Fault(0.0, inf, "motors", kind))
    daemon.pass_time(1.0)
    assert daemon.status()["cause"] == "motors_failed"
    daemon.end(board_fails)
    daemon.pass_time(6.0)
    assert (daemon.status()["mode"], daemon.status()["cause"]) == ("armed", None)
    assert daemon.setup.world.commanded != (0.0, 0.0)
    daemon.close()
    assert daemon.rules.broken == ()


@breaks_the_product
@pytest.mark.long
def test_gate_that_forgets_to_hold_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = Gate.judge

    def judge(self: Gate, *arguments: Any, armed: bool) -> bool:
        return honest(self, *arguments, armed=armed) or armed

    monkeypatch.setattr(Gate, "judge", judge)
    monkeypatch.setattr(Gate, "limit", lambda *_: WheelCommand(0.3, 0.3))
    with pytest.raises(AssertionError, match="rule 2: motion commanded"):
        find()


@pytest.mark.long
def test_status_that_tells_another_mode_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    status = RoverCommands.status

    async def wrong(self: RoverCommands) -> object:
        return dict(await status(self)) | {"mode": "disarmed"}

    monkeypatch.setattr(RoverCommands, "status", wrong)
    with pytest.raises(AssertionError, match="the status says disarmed"):
        find()
