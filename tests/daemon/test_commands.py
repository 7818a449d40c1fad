"""The control socket's verbs on a whole simulated rover in virtual time: what each does, and when it is refused."""

from __future__ import annotations

import asyncio
import dataclasses
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import orjson
import pytest

from tests.commissioning.checks.rigs import T_WALL, Flow, Needle, Rig
from wayfarer.commissioning.checks import CheckVerdict, run_checks
from wayfarer.commissioning.checks.deadman import keep_proof
from wayfarer.commissioning.checks.parts import contact
from wayfarer.config.calibration_file import Calibration, MotorsEntry, save, stamp
from wayfarer.control.records import PartialLog
from wayfarer.control.supervisor import Supervisor
from wayfarer.daemon.arming_inspection import FRESH_S, RunningInspection
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import Commands, Refused
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.errors import NotResponding, WayfarerError
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import STOP, CompassReading, MotionReading, MotorHealth, Side, WheelCommand
from wayfarer.safety.mission_limits import RunEnd
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.thunderborg import ThunderBorgChip
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.random_streams import RandomStreams

ABOUT = {"version": "1", "rover": "sim", "algorithm": "pledge", "log": "logs/00001", "start_delay_s": 2.0}
DELAY_S = 2.0


class Log(PartialLog):
    """Keeps events."""

    def __init__(self) -> None:
        self.events: list[tuple[str, dict[str, object]]] = []

    def event(self, name: str, t_s: float, **details: object) -> None:
        self.events.append((name, details))

    def close(self, reason: str, text: str) -> None:
        self.event("closed", 0.0, reason=reason)

    def named(self, name: str) -> list[dict[str, object]]:
        return [details for event, details in self.events if event == name]


class Run:
    """A rover whose daemon runs, and its commands."""

    def __init__(self, rig: Rig, algorithm: str = "pledge") -> None:
        self.rig = rig
        self.log = Log()
        safety = rig.config.model_dump()["safety"] | {"start_delay_s": DELAY_S}
        config = type(rig.config).model_validate(rig.config.model_dump() | {"safety": safety})
        chosen = CATALOGUE[algorithm]
        handler = chosen.make(config.escape, config.vehicle, Random(0))
        self.supervisor = Supervisor(rig.rover, config, chosen, handler, self.log)
        self.inspect = RunningInspection(config, rig.rover, rig.host, self.supervisor)
        self.commands = RoverCommands(self.supervisor, rig.motors, lambda: self.inspect, self.log, ABOUT)

    @property
    def wheels(self) -> WheelCommand:
        return WheelCommand(*self.rig.world.commanded)

    @property
    def mode(self) -> str:
        return self.supervisor.mode.value

    async def status(self) -> dict[str, Any]:
        """What a client would get."""
        told: dict[str, Any] = orjson.loads(orjson.dumps(await self.commands.status()))
        return told

    async def arm(self, heading_deg: float | None = 0.0) -> None:
        """Arm, and drive for a second."""
        await self.commands.arm(heading_deg)
        await asyncio.sleep(DELAY_S + 1.0)
        assert self.mode == "armed"
        assert self.wheels != STOP


Scene = Callable[[Run], Awaitable[None]]
Play = Callable[..., RunEnd]


@pytest.fixture
def play(tmp_path: Path) -> Play:
    """Plays a scene a second (``after_s``) after a run has begun, and ends the run where the scene did not."""

    def play_scene(scene: Scene, algorithm: str = "pledge", rig: Rig | None = None, after_s: float = 1.0) -> RunEnd:
        async def main() -> RunEnd:
            run = Run(rig or Rig(tmp_path), algorithm)
            running = asyncio.create_task(run.supervisor.run())
            await asyncio.sleep(after_s)
            try:
                await scene(run)
            finally:
                run.supervisor.finish("over", "the scene is over")
                end = await running
            assert run.wheels == STOP
            return end

        with asyncio.Runner(loop_factory=VirtualLoop) as runner:
            return runner.run(main())

    return play_scene


def test_it_can_do_all_that_the_socket_knows(play: Play) -> None:
    async def scene(run: Run) -> None:
        commands: Commands = run.commands
        for verb in ("status", "arm", "disarm", "hold", "resume", "goal", "mark", "stop"):
            assert callable(getattr(commands, verb))

    play(scene)


# -- arming ------------------------------------------------------------------------------------------------------------


def test_rover_starts_disarmed_and_drives_after_arming_and_the_delay(play: Play) -> None:
    async def scene(run: Run) -> None:
        assert run.mode == "disarmed"
        reply = await run.commands.arm(90.0)
        assert (reply["mode"], reply["start_delay_s"]) == ("arming", DELAY_S)
        await asyncio.sleep(DELAY_S - 0.2)
        assert run.wheels == STOP
        await asyncio.sleep(0.5)
        assert run.mode == "armed"
        assert run.supervisor.controller.goal_heading_deg == 90.0
        assert run.wheels != STOP

    play(scene)


def test_warnings_of_the_checks_are_told_and_keep_no_rover_from_arming(play: Play) -> None:
    async def scene(run: Run) -> None:
        warnings = str((await run.commands.arm())["warnings"])
        assert "calibrated compass" in warnings
        assert "wayfarer calibrate" in warnings

    play(scene)


@pytest.mark.parametrize("armed", [False, True], ids=["arming", "armed"])
def test_arming_twice_is_refused_and_changes_nothing(play: Play, armed: bool) -> None:
    async def scene(run: Run) -> None:
        await run.commands.arm(0.0)
        if armed:
            await asyncio.sleep(DELAY_S + 1.0)
        mode = run.mode
        with pytest.raises(Refused, match=f"{mode} already: disarm it first"):
            await run.commands.arm(180.0)
        assert run.mode == mode
        assert run.supervisor.controller.goal_heading_deg == 0.0

    play(scene)


def test_only_one_of_two_who_arm_at_once_is_heard(play: Play) -> None:
    async def scene(run: Run) -> None:
        opened = asyncio.Event()

        async def open_slowly() -> None:
            await opened.wait()

        run.rig.motors.open = open_slowly  # type: ignore[method-assign]
        first = asyncio.create_task(run.commands.arm(0.0))
        await asyncio.sleep(0.01)
        with pytest.raises(Refused, match="being checked"):
            await run.commands.arm(180.0)
        opened.set()
        assert (await first)["mode"] == "arming"

    play(scene)


def test_arming_right_after_the_start_waits_until_the_parts_are_open(play: Play, tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    opens = rig.compass.open

    async def open_slowly() -> None:
        await asyncio.sleep(1.0)
        await opens()

    rig.compass.open = open_slowly  # type: ignore[method-assign]

    async def scene(run: Run) -> None:
        assert (await run.commands.arm(0.0))["mode"] == "arming"
        await asyncio.sleep(DELAY_S + 1.0)
        assert run.wheels != STOP

    play(scene, rig=rig, after_s=0.0)


def test_arming_while_parts_take_too_long_to_open_is_refused_and_says_so(play: Play, tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.compass.open = lambda: asyncio.sleep(4.0)  # type: ignore[method-assign]

    async def scene(run: Run) -> None:
        with pytest.raises(Refused, match="still being opened: try again in some seconds"):
            await run.commands.arm(0.0)

    play(scene, rig=rig, after_s=0.0)


class ThunderBorgRig(Rig):
    """A rover whose motor board is a ThunderBorg, through its real driver."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        buses = FakeBuses()
        self.chip = ThunderBorgChip(self.world, lambda: asyncio.get_running_loop().time(), full_level=255)
        buses.i2c("/dev/i2c-1").attach(0x15, self.chip)
        self.motors = ThunderBorg(ThunderBorgSettings(), buses)  # type: ignore[assignment]
        self.rover = dataclasses.replace(self.rover, motors=self.motors)


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("driving", [False, True], ids=["standing", "driving"])
def test_first_arming_after_the_board_lost_its_power_is_not_refused(
    play: Play, tmp_path: Path, after_s: float, driving: bool
) -> None:
    rig = ThunderBorgRig(tmp_path)

    async def scene(run: Run) -> None:
        if driving:
            await run.arm()
        rig.chip.power_cycle()
        if driving:
            await asyncio.sleep(0.1)
            assert (run.mode, run.wheels) == ("disarmed", STOP)
            assert "lost its power" in str(run.log.named("motors_failed"))
        await asyncio.sleep(after_s)
        await run.arm()
        assert rig.chip.failsafe

    play(scene, rig=rig)


def break_battery(rig: Rig) -> None:
    rig.motors.health_now = MotorHealth(12.0, ("motor A: drive fault",))


def break_compass(rig: Rig) -> None:
    rig.compass.level = 1


def break_deadman(rig: Rig) -> None:
    rig.motors.deadman_s = None


def break_motors(rig: Rig) -> None:
    rig.motors.dead = True


@pytest.mark.parametrize(
    ("set_faults", "text"),
    [
        (break_battery, "motor faults: motor A: drive fault .*switch it off and on"),
        (break_compass, "compass calibration: level 1 of 3, at least 2 is needed"),
        (break_deadman, "cannot stop the wheels by itself"),
        (break_motors, "board at 0x15 on /dev/i2c-1: no answer"),
    ],
)
def test_arming_is_refused_with_what_a_check_found_and_what_to_do(
    play: Play, set_faults: Callable[[Rig], None], text: str
) -> None:
    async def scene(run: Run) -> None:
        set_faults(run.rig)
        await asyncio.sleep(0.1)
        with pytest.raises(Refused, match=f"not armed: .*{text}"):
            await run.commands.arm()
        assert run.mode == "disarmed"
        assert run.log.named("arming_refused")
        await asyncio.sleep(DELAY_S + 1.0)
        assert run.wheels == STOP

    play(scene)


SHIFTED = MotorsEntry(
    **stamp("board at 0x15 on /dev/i2c-1", T_WALL), shift_half_deg=4.0, shift_full_deg=17.0, passed=False
)


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        (SHIFTED, "calibrated motors: the motors turn the heading by 17°"),
        (dataclasses.replace(SHIFTED, part="board at 0x16"), "calibrated motors: made with board at 0x16, but this is"),
        (None, "calibrated compass: .*calibration.json: not a calibration"),
    ],
)
def test_calibration_that_is_bad_broken_or_of_another_part_refuses_arming_and_is_named(
    play: Play, entry: MotorsEntry | None, text: str
) -> None:
    """Field catalogue, faults 12 and 49."""

    async def scene(run: Run) -> None:
        path = run.rig.host.calibration_file
        save(path, Calibration(motors=entry))
        if entry is None:
            path.write_bytes(path.read_bytes()[:-10])
        with pytest.raises(Refused, match=f"not armed: .*{text}"):
            await run.commands.arm(0.0)
        assert run.mode == "disarmed"

    play(scene)


@pytest.mark.parametrize("because", ["", "nobody may come near it"])
def test_board_that_cannot_be_asked_is_armed_with_a_proof_or_a_reason_that_is_told(
    play: Play, tmp_path: Path, because: str
) -> None:
    rig = Rig(tmp_path)
    rig.motors.tells = False
    safety = dataclasses.replace(rig.config.safety, deadman_unproved_because=because)
    rig.config = rig.config.model_copy(update={"safety": safety})

    async def scene(run: Run) -> None:
        if not because:
            with pytest.raises(Refused, match=r"deadman proved: nobody has seen board at 0x15 .*wayfarer check"):
                await run.commands.arm(0.0)
            assert run.log.named("arming_refused") == [{"failed": ["deadman proved"]}]
            keep_proof(run.inspect, tripped=True)
        warnings: Any = (await run.commands.arm(0.0))["warnings"]
        told = [warning for warning in warnings if warning.startswith("deadman proved")]
        assert len(told) == bool(because)
        assert all(because in warning for warning in told)

    play(scene, rig=rig)


def test_rover_that_lies_on_its_roof_is_refused_at_once_and_told_what_to_do(play: Play) -> None:
    """Today's fault, not a memory of one: set upright, it is armed."""

    async def scene(run: Run) -> None:
        run.rig.compass.tilt_deg = 170.0
        await asyncio.sleep(1.0)
        with pytest.raises(Refused, match=r"not armed: overturned: .*stand it on its wheels"):
            await run.commands.arm(0.0)
        assert run.mode == "disarmed"
        assert run.log.named("arming_refused") == [{"failed": ["overturned"]}]
        assert not run.log.named("arming")
        run.rig.compass.tilt_deg = 0.0
        await asyncio.sleep(1.0)
        await run.arm()

    play(scene)


def test_board_that_turns_the_wheels_by_itself_is_refused_at_once(play: Play) -> None:
    async def scene(run: Run) -> None:
        async def astray() -> WheelCommand:
            return WheelCommand(0.3, 0.3)

        run.rig.motors.read_back = astray  # type: ignore[method-assign]
        await asyncio.sleep(2.5)  # sim.toml asks the board once a second
        with pytest.raises(Refused, match=r"board disagrees: .*no other program commands it"):
            await run.commands.arm(0.0)
        assert not run.log.named("arming")

    play(scene)


def test_motors_that_failed_keep_no_rover_from_arming_once_they_answer(play: Play) -> None:
    """Nobody knows whether they answer again before they are opened, and arming does that."""

    async def scene(run: Run) -> None:
        await run.arm()
        run.rig.motors.fails_at = 0
        await asyncio.sleep(0.5)
        assert (run.mode, (await run.status())["why_disarmed"]) == ("disarmed", "fault: motors_failed")
        run.rig.motors.fails_at = 10**9
        await run.arm()

    play(scene)


def test_rover_that_was_refused_can_be_armed_once_it_is_mended(play: Play) -> None:
    async def scene(run: Run) -> None:
        break_compass(run.rig)
        await asyncio.sleep(0.1)
        with pytest.raises(Refused):
            await run.commands.arm()
        run.rig.compass.level = 3
        await asyncio.sleep(0.1)
        await run.arm()

    play(scene)


def test_board_that_falls_silent_after_the_checks_refuses_arming(play: Play) -> None:
    async def scene(run: Run) -> None:
        opened = 0

        async def open_once() -> None:
            nonlocal opened
            opened += 1
            if opened > 1:
                raise NotResponding("board: no answer")

        run.rig.motors.open = open_once  # type: ignore[method-assign]
        with pytest.raises(Refused, match="not armed: board: no answer"):
            await run.commands.arm()
        assert run.mode == "disarmed"

    play(scene)


@pytest.mark.parametrize("verb", ["disarm", "hold", "stop"])
def test_whatever_stops_the_wheels_while_the_checks_run_ends_the_arming(play: Play, verb: str) -> None:
    async def scene(run: Run) -> None:
        opened = asyncio.Event()

        async def open_slowly() -> None:
            await opened.wait()

        run.rig.motors.open = open_slowly  # type: ignore[method-assign]
        arming = asyncio.create_task(run.commands.arm(0.0))
        await asyncio.sleep(0.01)
        with suppress(Refused):
            await getattr(run.commands, verb)()
        opened.set()
        with pytest.raises(WayfarerError, match="disarmed while it was being checked"):
            await arming
        await asyncio.sleep(DELAY_S + 1.0)
        assert run.wheels == STOP

    play(scene)


# -- what stops the wheels ---------------------------------------------------------------------------------------------


def test_disarming_stops_the_wheels_before_the_next_tick_and_for_good(play: Play) -> None:
    async def scene(run: Run) -> None:
        await run.arm()
        assert (await run.commands.disarm()) == {"mode": "disarmed"}
        assert run.wheels == STOP
        await asyncio.sleep(1.0)
        assert run.wheels == STOP
        assert (await run.status())["why_disarmed"] == "requested by a person"

    play(scene)


def test_disarming_is_never_refused(play: Play) -> None:
    async def scene(run: Run) -> None:
        await run.commands.disarm()
        run.rig.motors.dead = True
        await run.commands.disarm()
        run.rig.motors.dead = False
        await run.commands.arm()
        await run.commands.disarm()
        await run.arm()
        await run.commands.hold()
        await run.commands.disarm()
        assert run.mode == "disarmed"
        await run.arm()
        await run.commands.stop()
        await run.commands.disarm()
        assert run.mode == "disarmed"

    play(scene)


def test_hold_stops_the_wheels_at_once_and_resume_goes_on_with_the_same_mission(play: Play) -> None:
    async def scene(run: Run) -> None:
        await run.arm()
        mission = run.supervisor.controller.mission
        assert await run.commands.hold() == {"held": True}
        assert run.wheels == STOP
        await asyncio.sleep(1.0)
        assert run.wheels == STOP
        assert "operator_hold" in (await run.status())["conditions"]
        assert await run.commands.resume() == {"held": False}
        await asyncio.sleep(0.5)
        assert run.wheels != STOP
        assert run.supervisor.controller.mission is mission

    play(scene)


def test_hold_of_a_disarmed_rover_is_refused(play: Play) -> None:
    async def scene(run: Run) -> None:
        with pytest.raises(Refused, match="its wheels do not turn"):
            await run.commands.hold()
        assert not (await run.status())["held"]

    play(scene)


def test_resume_without_a_hold_is_refused(play: Play) -> None:
    async def scene(run: Run) -> None:
        with pytest.raises(Refused, match="nothing to resume"):
            await run.commands.resume()
        await run.arm()
        with pytest.raises(Refused, match="nothing to resume"):
            await run.commands.resume()

    play(scene)


def test_arming_anew_forgets_a_hold(play: Play) -> None:
    async def scene(run: Run) -> None:
        await run.arm()
        await run.commands.hold()
        await run.commands.disarm()
        await run.arm()
        assert (await run.commands.status())["held"] is False

    play(scene)


def test_stop_stops_the_wheels_at_once_and_ends_the_run(play: Play) -> None:
    async def scene(run: Run) -> None:
        await run.arm()
        assert await run.commands.stop() == {"log": "logs/00001"}
        assert run.wheels == STOP

    assert play(scene).reason == "requested"


# -- what changes or notes something -----------------------------------------------------------------------------------


def test_goal_turns_the_rover_that_drives_elsewhere(play: Play) -> None:
    async def scene(run: Run) -> None:
        await run.arm(0.0)
        assert await run.commands.goal(90.0) == {"goal_heading_deg": 90.0}
        await asyncio.sleep(8.0)
        assert (await run.status())["heading_deg"] == pytest.approx(90.0, abs=15.0)

    play(scene)


@pytest.mark.parametrize("arming", [False, True], ids=["disarmed", "arming"])
def test_goal_is_refused_before_the_rover_drives(play: Play, arming: bool) -> None:
    async def scene(run: Run) -> None:
        if arming:
            await run.commands.arm(0.0)
        with pytest.raises(Refused, match=f"{run.mode}: give the heading when arming"):
            await run.commands.goal(90.0)
        await asyncio.sleep(DELAY_S + 1.0)
        assert run.supervisor.controller.goal_heading_deg == 0.0

    play(scene)


def test_mark_is_written_into_the_log(play: Play) -> None:
    async def scene(run: Run) -> None:
        assert await run.commands.mark("hit log") == {}
        assert run.log.named("mark") == [{"text": "hit log"}]

    play(scene)


def test_marks_without_end_cost_two_records_a_second_and_stops_are_still_taken(play: Play) -> None:
    async def scene(run: Run) -> None:
        await run.arm()
        taken, refused = 0, set()
        for _ in range(5000):  # what 15 clients sent in 5 s
            await asyncio.sleep(0.001)
            try:
                await run.commands.mark("x")
                taken += 1
            except Refused as refusal:
                refused.add(str(refusal))
        assert taken == len(run.log.named("mark"))
        assert 5 + 2.0 * 5 - 1 <= taken <= 5 + 2.0 * 5
        (why,) = refused
        assert why.startswith("not noted: of all marks together 5 are taken at once, and 2 a second for long; wait")
        assert await run.commands.hold() == {"held": True}

    play(scene)


# -- status ------------------------------------------------------------------------------------------------------------


def test_status_can_be_sent_before_the_first_tick(tmp_path: Path) -> None:
    async def main() -> None:
        told = await Run(Rig(tmp_path)).status()
        assert (told["mode"], told["why_disarmed"]) == ("disarmed", "not armed since the start")
        assert "heading_deg" not in told

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(main())


def test_status_can_be_sent_in_every_mode_and_says_which(play: Play) -> None:
    async def scene(run: Run) -> None:
        disarmed = await run.status()
        assert (disarmed["mode"], disarmed["battery_v"], disarmed["wheels"]) == ("disarmed", 12.0, [0.0, 0.0])
        assert "mission_s" not in disarmed
        await run.commands.arm(0.0)
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

    play(scene)


def test_status_says_what_is_wrong(play: Play) -> None:
    async def scene(run: Run) -> None:
        await run.arm()
        break_battery(run.rig)
        await asyncio.sleep(2.5)  # sim.toml asks the board once a second, and a fault counts that is said twice
        told = await run.status()
        assert told["mode"] == "disarmed"
        assert told["why_disarmed"] == "fault: board_fault"
        assert told["motor_faults"] == ["motor A: drive fault"]

    play(scene)


# -- what the checks before arming look at -----------------------------------------------------------------------------


def test_inspection_gives_what_the_sensor_tasks_read_last(play: Play) -> None:
    async def scene(run: Run) -> None:
        now_s = asyncio.get_running_loop().time()
        compass, motion = await run.inspect.compass(), await run.inspect.motion()
        assert motion is not None
        assert now_s - compass.t_s < 0.1
        assert now_s - motion.t_s < 0.2
        assert (await run.inspect.motor_health()).battery_v == 12.0

    play(scene)


class MuteCompass(Needle):
    """A compass that can fall silent."""

    silent = False

    async def read(self) -> CompassReading:
        if self.silent:
            raise self.error
        return await super().read()


class MuteFlow(Flow):
    """A motion sensor that can fall silent."""

    silent = False

    async def read(self) -> MotionReading:
        if self.silent:
            raise NotResponding("PMW3901: no answer")
        return await super().read()


def test_compass_that_fell_silent_is_stale_and_keeps_the_rover_from_arming(play: Play, tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    compass = MuteCompass(rig.world, RandomStreams(0))
    rig.rover = dataclasses.replace(rig.rover, compass=compass)

    async def scene(run: Run) -> None:
        compass.silent = True
        await asyncio.sleep(FRESH_S / 2)
        assert (await run.inspect.compass()).calibration == 3, "half a second is no silence yet"
        await asyncio.sleep(FRESH_S)
        with pytest.raises(NotResponding, match="compass has said nothing for 1 s"):
            await run.inspect.compass()
        with pytest.raises(Refused, match="compass has said nothing"):
            await run.commands.arm()
        assert run.mode == "disarmed"

    play(scene, rig=rig)


def test_motion_sensor_that_fell_silent_lets_no_rover_drive(play: Play, tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    motion = MuteFlow(rig.world, RandomStreams(0))
    rig.rover = dataclasses.replace(rig.rover, motion=motion)

    async def scene(run: Run) -> None:
        motion.silent = True
        await asyncio.sleep(5.0)
        with suppress(Refused):
            await run.commands.arm(0.0)
        for _ in range(200):
            await asyncio.sleep(0.1)
            assert run.mode != "armed"
            assert run.wheels == STOP
        assert run.mode == "disarmed"

    play(scene, rig=rig)


def test_inspection_before_the_first_tick_says_to_wait(tmp_path: Path) -> None:
    async def main() -> None:
        with pytest.raises(NotResponding, match="still being opened"):
            await Run(Rig(tmp_path)).inspect.compass()

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(main())


def test_bumper_that_no_decision_uses_is_not_asked(play: Play) -> None:
    async def scene(run: Run) -> None:
        assert await run.inspect.contact() is None
        (finding,) = await run_checks(run.inspect, [contact])
        assert finding.verdict is CheckVerdict.SKIPPED

    play(scene)


def test_bumper_that_the_algorithm_uses_is_read(play: Play, tmp_path: Path) -> None:
    async def scene(run: Run) -> None:
        run.rig.contact.sides = (Side.FRONT,)
        await asyncio.sleep(0.1)
        reading = await run.inspect.contact()
        assert reading is not None
        assert reading.sides == (Side.FRONT,)

    play(scene, next(name for name, each in CATALOGUE.items() if "contact" in each.requires))
