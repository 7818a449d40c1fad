"""The control socket's other verbs on a whole simulated rover: what each does, and when it is refused."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.daemon.played import DELAY_S, Run, played
from tests.kit.rover import Rig
from tests.virtual import asked, virtual
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import VERBS, RequestRefused
from wayfarer.hal import STOP, MotorHealth


def test_every_verb_of_the_socket_is_a_command() -> None:
    assert all(callable(getattr(RoverCommands, verb, None)) for verb in VERBS)


# -- what stops the wheels ---------------------------------------------------------------------------------------------


@played
async def test_disarming_stops_the_wheels_before_the_next_tick_and_for_good(run: Run) -> None:
    await run.arm()
    assert (await run.commands.disarm()) == {"mode": "disarmed"}
    assert run.wheels == STOP
    await asyncio.sleep(1.0)
    assert run.wheels == STOP
    assert (await run.status())["why_disarmed"] == "requested by a person"


@played
async def test_disarming_is_never_refused(run: Run) -> None:
    await run.commands.disarm()
    run.rig.motors.dead = True
    await run.commands.disarm()
    run.rig.motors.dead = False
    await asyncio.sleep(0.001)
    await run.commands.arm(asked())
    await run.commands.disarm()
    await run.arm()
    await run.commands.hold()
    await run.commands.disarm()
    assert run.mode == "disarmed"
    await run.arm()
    await run.commands.stop()
    await run.commands.disarm()
    assert run.mode == "disarmed"


@played
async def test_hold_stops_the_wheels_at_once_and_resume_goes_on_with_the_same_mission(run: Run) -> None:
    await run.arm()
    mission = run.supervisor.controller.mission
    assert await run.commands.hold() == {"held": True}
    assert run.wheels == STOP
    await asyncio.sleep(1.0)
    assert run.wheels == STOP
    assert "operator_hold" in (await run.status())["conditions"]
    assert await run.commands.resume(asked()) == {"held": False}
    await asyncio.sleep(0.5)
    assert run.wheels != STOP
    assert run.supervisor.controller.mission is mission


@played
async def test_hold_of_a_disarmed_rover_is_refused(run: Run) -> None:
    with pytest.raises(RequestRefused, match="its wheels do not turn"):
        await run.commands.hold()
    assert not (await run.status())["held"]


@played
async def test_resume_without_a_hold_is_refused(run: Run) -> None:
    with pytest.raises(RequestRefused, match="nothing to resume"):
        await run.commands.resume(asked())
    await run.arm()
    with pytest.raises(RequestRefused, match="nothing to resume"):
        await run.commands.resume(asked())


@played
async def test_stop_stops_the_wheels_at_once_and_ends_the_run(run: Run) -> None:
    await run.arm()
    assert await run.commands.stop() == {"log": "logs/00001"}
    assert run.wheels == STOP
    end = await run.running
    assert end.reason == "requested"


# -- what changes or notes something -----------------------------------------------------------------------------------


@played
async def test_goal_turns_the_rover_that_drives_elsewhere(run: Run) -> None:
    await run.arm(0.0)
    assert await run.commands.goal(90.0) == {"goal_heading_deg": 90.0}
    await asyncio.sleep(8.0)
    assert (await run.status())["heading_deg"] == pytest.approx(90.0, abs=15.0)


@pytest.mark.parametrize("arming", [False, True], ids=["disarmed", "arming"])
@played
async def test_goal_is_refused_before_the_rover_drives(run: Run, arming: bool) -> None:
    if arming:
        await run.commands.arm(asked(), 0.0)
    with pytest.raises(RequestRefused, match=f"{run.mode}: give the heading when arming"):
        await run.commands.goal(90.0)
    await asyncio.sleep(DELAY_S + 1.0)
    assert run.supervisor.controller.goal_heading_deg == 0.0


@played
async def test_mark_is_written_into_the_log(run: Run) -> None:
    assert await run.commands.mark("hit log") == {}
    assert run.log.named("mark") == [{"note": "hit log"}]


@played
async def test_marks_without_end_cost_two_records_a_second_and_stops_are_still_taken(run: Run) -> None:
    await run.arm()
    taken, refused = 0, set()
    for _ in range(5000):  # what 15 clients sent in 5 s
        await asyncio.sleep(0.001)
        try:
            await run.commands.mark("x")
            taken += 1
        except RequestRefused as refusal:
            refused.add(str(refusal))
    assert taken == len(run.log.named("mark"))
    assert 5 + 2.0 * 5 - 1 <= taken <= 5 + 2.0 * 5
    (why,) = refused
    assert why.startswith("not noted: all clients together may send 5 marks at once, and 2 a second for long; wait")
    assert await run.commands.hold() == {"held": True}


# -- status ------------------------------------------------------------------------------------------------------------


@virtual
async def test_status_can_be_sent_before_the_first_tick(tmp_path: Path) -> None:
    told = await Run(Rig(tmp_path)).status()
    assert (told["mode"], told["why_disarmed"]) == ("disarmed", "not armed since the start")
    assert "heading_deg" not in told


@played
async def test_status_can_be_sent_in_every_mode_and_says_which(run: Run) -> None:
    disarmed = await run.status()
    assert (disarmed["mode"], disarmed["battery_v"], disarmed["wheels"]) == ("disarmed", 12.0, [0.0, 0.0])
    assert "mission_s" not in disarmed
    await run.commands.arm(asked(), 0.0)
    assert (await run.status())["mode"] == "arming"
    await asyncio.sleep(DELAY_S + 1.0)
    armed = await run.status()
    assert (armed["mode"], armed["why_disarmed"], armed["held"]) == ("armed", None, False)
    assert armed["wheels"] == list(run.wheels)
    assert armed["mission_s"] == pytest.approx(1.0, abs=0.2)
    assert armed["travelled_m"] > 0.2
    assert armed["counter_deg"] is not None
    await run.commands.hold()
    await asyncio.sleep(0.1)
    held = await run.status()
    assert (held["mode"], held["held"], held["level"], held["cause"]) == ("armed", True, "hold", "operator_hold")


@played
async def test_status_says_what_is_wrong(run: Run) -> None:
    await run.arm()
    run.rig.motors.health_now = MotorHealth(12.0, ("motor A: drive fault",))
    await asyncio.sleep(2.5)  # sim.toml asks the board once a second, and a fault counts that is said twice
    told = await run.status()
    assert told["mode"] == "armed"
    assert (told["level"], told["cause"]) == ("hold", "motors_failed")
    assert 0.0 <= told["cause_for_s"] <= 2.5
    assert told["does"].startswith("stops, and opens the board again")
    assert "its deadman is on" in told["ends_when"]
    await run.commands.disarm()
    assert "does" not in await run.status(), "a rover that is disarmed does nothing"
    assert told["motor_faults"] == ["motor A: drive fault"]
