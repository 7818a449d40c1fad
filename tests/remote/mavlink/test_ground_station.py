"""What a ground station is told, how it stops a rover, and that it starts nothing; in virtual time."""

from __future__ import annotations

import asyncio
import random
from copy import copy
from dataclasses import replace
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from tests.daemon.played import Run, played
from tests.kit.rover import Rig
from tests.remote.live.records import tick
from tests.remote.mavlink.station import (
    USUAL,
    Encoder,
    Message,
    arming,
    command,
    heartbeat,
    kinds,
    linked,
    mode,
    starts,
    texts,
)
from tests.virtual import asked, virtual
from wayfarer.config.settings import MavlinkSettings
from wayfarer.hal import STOP, MotorHealth
from wayfarer.remote.mavlink.ground_station import NOT_FROM_HERE, NOT_FROM_THERE
from wayfarer.remote.mavlink.telemetry import MODE_AUTO, MODE_HOLD, MODE_INITIALISING, MODE_MANUAL

ACCEPTED, BUSY, DENIED, UNKNOWN = (
    common.MAV_RESULT_ACCEPTED, common.MAV_RESULT_TEMPORARILY_REJECTED, common.MAV_RESULT_DENIED,
    common.MAV_RESULT_UNSUPPORTED,
)  # fmt: skip
NAN = float("nan")


def whole(number: int, first: float = 0.0) -> Message:
    """A command of the kind with whole numbers for a place."""
    return common.MAVLink_command_int_message(1, 1, 0, number, 0, 0, first, 0, 0, 0, 0, 0, 0)


# -- stops -----------------------------------------------------------------------------------------------------------

STOPS: list[tuple[str, Message]] = [
    ("disarm", arming(0.0)),
    ("disarm", arming(-0.0)),
    ("disarm", command(common.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, 21196.0)),
    ("disarm", command(common.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, target=0)),
    ("disarm", whole(common.MAV_CMD_COMPONENT_ARM_DISARM)),
    ("disarm", command(common.MAV_CMD_DO_FLIGHTTERMINATION, 1.0)),
    *(("disarm", command(common.MAV_CMD_DO_SET_MODE, float(base))) for base in (0, 64, 66, 80, 88, 92)),
    ("disarm", common.MAVLink_set_mode_message(1, common.MAV_MODE_AUTO_DISARMED, 0)),
    ("hold", mode(MODE_HOLD)),
    ("hold", mode(5)),
    ("hold", common.MAVLink_set_mode_message(1, 217, MODE_HOLD)),
    ("hold", command(common.MAV_CMD_DO_SET_STANDARD_MODE, 1.0)),
    ("hold", command(common.MAV_CMD_DO_PAUSE_CONTINUE, 0.0)),
    ("hold", whole(common.MAV_CMD_DO_PAUSE_CONTINUE)),
    ("hold", command(common.MAV_CMD_OVERRIDE_GOTO, 0.0, 2.0)),
    ("hold", command(common.MAV_CMD_NAV_LOITER_UNLIM)),
]


@virtual
async def test_rover_stops_under_each_of_mavlinks_names_for_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        for place, (name, order) in enumerate(STOPS):
            await link.says(order)
            assert link.rover.asked == [name for name, _ in STOPS[: place + 1]], order
            assert link.acks() == [ACCEPTED], order
        link.encoder = Encoder(signs=True)  # by a station that was given a key for another vehicle
        await link.says(arming(0.0))
        assert link.acks() == [ACCEPTED]


@pytest.mark.parametrize("system", [0, 1, 2])
@pytest.mark.parametrize("component", [0, 1, 154, 190, 250])
@virtual
async def test_what_is_for_everybody_is_for_the_rover_and_what_is_for_another_component_is_not(
    monkeypatch: pytest.MonkeyPatch, system: int, component: int
) -> None:
    questions: list[tuple[str, Message]] = [
        ("PARAM_VALUE", common.MAVLink_param_request_list_message(system, component)),
        ("PARAM_VALUE", common.MAVLink_param_request_read_message(system, component, b"SYSID_THISMAV", -1)),
        ("MISSION_COUNT", common.MAVLink_mission_request_list_message(system, component, 0)),
        (
            "AUTOPILOT_VERSION",
            command(
                common.MAV_CMD_REQUEST_MESSAGE, common.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0.0,
                target=system, component=component,
            ),
        ),
    ]  # fmt: skip
    is_ours = system in (0, 1) and component in (0, 1)
    async with linked(monkeypatch) as link:
        for _, stop in STOPS:
            order = copy(stop)
            order.target_system, order.target_component = system, component
            await link.says(order)
        whole_system = [name for name, order in STOPS if order.get_type() == "SET_MODE" and system in (0, 1)]
        assert link.rover.asked == ([name for name, _ in STOPS] if is_ours else whole_system)
        for answer, question in questions:
            link.heard()
            await link.says(question)
            assert (answer in kinds(link.heard())) is is_ours, answer


@pytest.mark.parametrize(("is_near", "may"), [(True, False), (True, True), (False, False), (False, True)])
@virtual
async def test_station_of_another_computer_stops_the_rover_if_the_rover_file_says_so(
    monkeypatch: pytest.MonkeyPatch, is_near: bool, may: bool
) -> None:
    async with linked(monkeypatch, MavlinkSettings(network_may_stop=may)) as link:
        link.port.is_near = is_near
        await link.says(heartbeat(), arming(0.0))
        obeyed = is_near or may
        await asyncio.sleep(1.0)
        heard = link.heard()
        assert link.rover.asked == ["disarm"] * obeyed
        assert [each.result for each in heard if each.get_type() == "COMMAND_ACK"] == [ACCEPTED if obeyed else DENIED]
        assert (f"disarm refused: {NOT_FROM_THERE}" in texts(heard)) is not obeyed


@pytest.mark.parametrize("signs", [False, True])
@virtual
async def test_thousand_disarms_behind_random_bytes_are_all_obeyed(
    monkeypatch: pytest.MonkeyPatch, signs: bool
) -> None:
    chance = random.Random(3)
    async with linked(monkeypatch) as link:
        link.encoder = Encoder(signs=signs)
        for _ in range(1_000):
            noise = chance.randbytes(chance.randrange(40)) + chance.choice([b"", b"\xfd", b"\xfd\xff", b"\xfd\xff\x01"])
            link.port.receive(noise + link.encoder.frame(arming(0.0)))
            await asyncio.sleep(chance.choice([0.0, 0.01, 0.15]))
        await asyncio.sleep(0.2)
        link.port.receive(b"")  # the last ones may wait for the end of a frame that never comes
        await asyncio.sleep(0.01)
        assert link.rover.asked == ["disarm"] * 1_000


@virtual
async def test_stop_behind_a_stray_marker_waits_for_no_further_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as made:
        made.port.receive(b"\xfd\xff" + made.encoder.frame(arming(0.0)))
        await asyncio.sleep(0.01)
        assert made.rover.asked == []
        await asyncio.sleep(0.2)
        assert made.rover.asked == ["disarm"]


async def test_person_is_told_why_a_stop_was_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        link.rover.refuses = "the rover is disarmed: its wheels do not turn"
        await link.says(heartbeat(), mode(MODE_HOLD))
        await asyncio.sleep(1.0)
        heard = link.heard()
        assert [each.result for each in heard if each.get_type() == "COMMAND_ACK"] == [BUSY]
        assert texts(heard)[-1] == "hold refused: the rover is disarmed: its wheels do not turn"


# -- nothing starts --------------------------------------------------------------------------------------------------


@virtual
async def test_what_would_start_or_is_unknown_is_refused_with_where_to_do_it(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, set_mode, pause = (
        common.MAV_CMD_COMPONENT_ARM_DISARM, common.MAV_CMD_DO_SET_MODE, common.MAV_CMD_DO_PAUSE_CONTINUE,
    )  # fmt: skip
    started = [
        command(arm, 1.0), command(arm, NAN), command(arm, 0.5), command(arm, 1e30), mode(MODE_AUTO), mode(MODE_MANUAL),
        command(set_mode, 1.0, NAN), command(set_mode, NAN, 4.0), command(set_mode, float("inf"), 4.0),
        command(set_mode, 1.0, 1e38), command(pause, 1.0), command(pause, NAN),
    ]  # fmt: skip
    unknown = [command(common.MAV_CMD_MISSION_START), command(common.MAV_CMD_NAV_WAYPOINT)]
    questions = [
        command(common.MAV_CMD_REQUEST_MESSAGE, NAN), command(common.MAV_CMD_REQUEST_MESSAGE, 1e30),
        command(common.MAV_CMD_GET_HOME_POSITION), command(31_000, 1.0),
    ]  # fmt: skip
    async with linked(monkeypatch) as link:
        for orders, result, is_told in ((started, DENIED, True), (unknown, UNKNOWN, True), (questions, UNKNOWN, False)):
            for order in orders:
                await link.says(heartbeat(), order)
                await asyncio.sleep(1.0)
                heard = link.heard()
                assert [each.result for each in heard if each.get_type() == "COMMAND_ACK"] == [result], order
                assert (NOT_FROM_HERE in texts(heard)) is is_told, order
        await link.says(command(arm, 0.0, target=2), command(arm, 1.0, target=2))
        assert not link.acks()
        assert not link.rover.asked


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """A rover that a person may drive, under its daemon's commands."""
    rig = Rig(tmp_path)
    rig.set(manual={"allowed": True})
    return Run(rig)


def hostile(chance: random.Random, number: int, encoders: list[Encoder], orders: list[Message]) -> bytes:
    """A frame that would start something, whole or damaged; random bytes; or a whole frame with anything in it."""
    encoder = chance.choice(encoders)
    if number % 5 == 0:
        return chance.randbytes(chance.randrange(300))
    if number % 5 == 1:
        kind = common.mavlink_map[chance.choice([11, 69, 70, 75, 76, chance.choice(sorted(common.mavlink_map))])]
        message = common.MAVLink_message(kind.id, kind.msgname)
        payload = chance.choice([chance.randbytes(40), b"\x01" * 40, b"\xff" * 40])
        message.pack = lambda mavlink, **_: message._pack(mavlink, kind.crc_extra, payload)
        return encoder.frame(message)
    data = bytearray(encoder.frame(chance.choice(orders)))
    if number % 5 == 2:
        data[chance.randrange(len(data))] = chance.randrange(256)
    return bytes(data)


@pytest.mark.parametrize("before", ["disarmed", "held"])
@played
async def test_ten_thousand_hostile_packets_move_no_wheel(
    run: Run, monkeypatch: pytest.MonkeyPatch, before: str
) -> None:
    """The whole rover, whose person may drive it by hand; the station is believed to be near."""
    chance, encoders, orders = random.Random(7), [Encoder(), Encoder(signs=True)], starts()
    if before == "held":
        await run.arm()
        await run.commands.hold()
        await asyncio.sleep(1.0)
    async with linked(monkeypatch, MavlinkSettings(network_may_stop=True), run.commands) as link:
        await link.says(heartbeat())
        for number in range(10_000):
            link.port.receive(hostile(chance, number, encoders, orders))
            if number % 10 == 0:
                await asyncio.sleep(0.01)
                assert run.wheels == STOP
        await asyncio.sleep(5.0)
        assert run.wheels == STOP
        assert run.mode == "disarmed" or run.supervisor.controller.held, "what was held may have been disarmed"
        assert len(link.station._texts) < 30
        assert not link.station._stopping


@played
async def test_armed_rover_is_held_and_disarmed_by_a_station(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    await run.arm()
    async with linked(monkeypatch, USUAL, run.commands) as link:
        await link.says(mode(MODE_HOLD))
        assert (run.wheels, run.mode) == (STOP, "armed")
        await asyncio.sleep(1.0)
        await link.says(mode(MODE_AUTO), command(common.MAV_CMD_DO_PAUSE_CONTINUE, 1.0))
        await asyncio.sleep(3.0)
        assert (run.wheels, run.supervisor.controller.held) == (STOP, True)
        await run.commands.resume(asked())
        await asyncio.sleep(3.0)
        assert run.wheels != STOP
        await link.says(arming(0.0))
        assert (run.wheels, run.mode) == (STOP, "disarmed")


# -- what it is asked and told ---------------------------------------------------------------------------------------


@virtual
async def test_station_that_connects_gets_version_parameters_and_an_empty_mission(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with linked(monkeypatch) as link:
        await link.says(
            command(common.MAV_CMD_REQUEST_MESSAGE, common.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
            common.MAVLink_param_request_list_message(1, 1),
            common.MAVLink_param_request_read_message(1, 1, b"SYSID_THISMAV", -1),
            common.MAVLink_param_request_read_message(1, 1, b"", 1),
            common.MAVLink_param_request_read_message(1, 1, b"", 9),
            common.MAVLink_param_set_message(1, 1, b"LINK_LOST_HOLD", 1.0, common.MAV_PARAM_TYPE_REAL32),
            common.MAVLink_mission_request_list_message(1, 1, 0),
        )
        heard = link.heard()
        assert kinds(heard)["AUTOPILOT_VERSION"] == 1
        values = [(each.param_id, each.param_value) for each in heard if each.get_type() == "PARAM_VALUE"]
        assert values[:3] == [("SYSID_THISMAV", 1.0), ("LINK_LOST_S", 5.0), ("LINK_LOST_HOLD", 0.0)]
        assert values[3:] == [("SYSID_THISMAV", 1.0), ("LINK_LOST_S", 5.0), ("LINK_LOST_HOLD", 0.0)]
        assert [each.count for each in heard if each.get_type() == "MISSION_COUNT"] == [0]


@virtual
async def test_heartbeat_tells_mode_and_state(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:

        async def now() -> tuple[int, bool, int]:
            await asyncio.sleep(1.0)
            last = [each for each in link.heard() if each.get_type() == "HEARTBEAT"][-1]
            assert (last.type, last.autopilot) == (common.MAV_TYPE_GROUND_ROVER, common.MAV_AUTOPILOT_GENERIC)
            return last.custom_mode, bool(last.base_mode & common.MAV_MODE_FLAG_SAFETY_ARMED), last.system_status

        standby, active = common.MAV_STATE_STANDBY, common.MAV_STATE_ACTIVE
        assert await now() == (MODE_HOLD, False, standby)
        link.log.tick(tick(101.0, mode="arming"))
        assert await now() == (MODE_INITIALISING, False, standby)
        link.log.tick(tick(102.0, mode="armed", goal_heading_deg=0.0))
        assert await now() == (MODE_AUTO, True, active)
        link.log.tick(tick(103.0, mode="armed", held=True))
        assert await now() == (MODE_HOLD, True, active)
        link.log.tick(tick(104.0))
        assert await now() == (MODE_HOLD, False, standby)


@virtual
async def test_texts_wait_for_a_station_and_come_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        link.log.event("unclean_shutdown", 100.5, text="The last mission (run 00041) was cut off")
        await asyncio.sleep(10.0)
        assert not texts(link.heard())
        await link.says(heartbeat())
        await asyncio.sleep(2.0)
        assert texts(link.heard())[1] == "The last mission (run 00041) was cut off"
        for number in range(1000):
            link.log.event("mark", 101.0 + number, text=f"{number} " + "é" * 400)
        assert len(link.station._texts) < 30


async def bytes_a_second(monkeypatch: pytest.MonkeyPatch, settings: MavlinkSettings) -> float:
    """What a rover sends that drives, has everything and meets something each second; the station is there."""
    async with linked(monkeypatch, settings) as link:
        for second in range(20):
            t_s = 100.0 + second
            for each in range(20):
                link.log.tick(tick(t_s + each / 20.0))
            link.log.board(t_s, MotorHealth(12.0, ()), None)
            link.log.event("mark", t_s, text="stalled while probing in a curve")
            await link.says(heartbeat())
            await asyncio.sleep(0.99)
        return sum(map(len, link.port.sent)) / 20.0


@virtual
async def test_all_messages_fit_half_of_a_radio(monkeypatch: pytest.MonkeyPatch) -> None:
    assert 300.0 < await bytes_a_second(monkeypatch, USUAL) < 1_000.0
    fast = MavlinkSettings(attitude_hz=20.0, position_hz=20.0, values_hz=20.0)
    at_most = await bytes_a_second(monkeypatch, fast)
    assert 2_700.0 < at_most <= 1.06 * 2_880.0  # a second of it at once, at the beginning
    floor = await bytes_a_second(monkeypatch, replace(fast, bytes_per_s=500))
    assert floor <= 1.06 * 500.0


# -- links that are lost, and enemies --------------------------------------------------------------------------------


@pytest.mark.parametrize("on_link_lost", ["continue", "hold"])
@pytest.mark.parametrize("armed", [True, False])
@virtual
async def test_lost_link_does_what_the_rover_file_says(
    monkeypatch: pytest.MonkeyPatch, on_link_lost: str, armed: bool
) -> None:
    settings = MavlinkSettings(on_link_lost=on_link_lost)  # type: ignore[arg-type]
    async with linked(monkeypatch, settings) as link:
        if armed:
            link.log.tick(tick(101.0, mode="armed", goal_heading_deg=0.0))
        await asyncio.sleep(20.0)
        assert not link.rover.asked  # a station that was never there is not lost
        chance = random.Random(1)
        for _ in range(100):  # with 30 % of its heartbeats lost
            if chance.random() > 0.3:
                await link.says(heartbeat())
            await asyncio.sleep(1.0)
        assert not link.rover.asked
        for data in link.port.sent[-9:]:  # an enemy sends back what the rover said
            link.port.receive(data)
            await asyncio.sleep(0.6)
        holds = armed and on_link_lost == "hold"
        noted = f"link_lost: the ground station is silent{': held' if holds else ''}"
        assert link.rover.asked == ["hold"] * holds + [noted]
        await asyncio.sleep(60.0)
        assert link.rover.asked == ["hold"] * holds + [noted]  # once, and it may be resumed by somebody else


@virtual
async def test_station_that_comes_back_from_another_port_is_the_same_one(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch, MavlinkSettings(on_link_lost="hold")) as link:
        link.log.tick(tick(101.0, mode="armed", goal_heading_deg=0.0))
        for port in (14550, 40001, 40002, 14550):
            link.port.sender = ("192.168.1.5", port)
            for _ in range(8):
                await link.says(heartbeat())
                await asyncio.sleep(0.99)
        assert link.rover.asked == []
        await asyncio.sleep(10.0)
        assert link.rover.asked == ["hold", "link_lost: the ground station is silent: held"]


@pytest.mark.parametrize(
    ("host", "port", "system"), [("192.168.1.5", 14550, 254), ("192.168.1.6", 14550, 255), ("192.168.1.5", 14551, 254)]
)
@virtual
async def test_heartbeats_of_another_station_do_not_tell_that_the_served_one_is_there(
    monkeypatch: pytest.MonkeyPatch, host: str, port: int, system: int
) -> None:
    lost = "link_lost: the ground station is silent"
    async with linked(monkeypatch) as link:
        for first, second in ((5, 5), (0, 5), (0, 20)):  # seconds in which each speaks; both at first
            for second_s in range(max(first, second)):
                if second_s < first:
                    link.port.sender, link.encoder = ("192.168.1.5", 14550), Encoder()
                    await link.says(heartbeat())
                link.port.sender, link.encoder = (host, port), Encoder(system=system)
                await link.says(heartbeat())
                await asyncio.sleep(1.0)
        assert link.rover.asked == [lost], "the first one; the second has its place now"
        await asyncio.sleep(10.0)
        assert link.rover.asked == [lost, lost]


@virtual
async def test_link_that_is_lost_while_the_computer_sleeps_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        link.port.receive(link.encoder.frame(heartbeat()))
        link.station._link.heard_s -= 60.0  # no look at the link since
        await asyncio.sleep(0.2)
        assert link.rover.asked == ["link_lost: the ground station is silent"]


@virtual
async def test_bug_in_holding_ends_neither_the_watch_nor_the_telemetry(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch, MavlinkSettings(on_link_lost="hold")) as link:
        link.log.tick(tick(101.0, mode="armed", goal_heading_deg=0.0))
        noted = "link_lost: the ground station is silent"  # and not held
        for times in (1, 2):
            await link.says(heartbeat())
            link.rover.breaks = RuntimeError("a bug")
            await asyncio.sleep(10.0)
            assert link.rover.asked == ["hold", noted] * times
            link.heard()
            await asyncio.sleep(2.0)
            assert kinds(link.heard())["HEARTBEAT"] == 2


@virtual
async def test_heartbeats_of_one_who_is_not_served_keep_no_link(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        await link.says(heartbeat())
        link.port.is_served = False
        for _ in range(10):
            await link.says(heartbeat())
            await asyncio.sleep(1.0)
        assert link.rover.asked == ["link_lost: the ground station is silent"]


@virtual
async def test_bug_in_taking_one_frame_does_not_lose_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        monkeypatch.setattr(link.station._answers, "to", lambda _: 1 / 0)
        bug, stop = common.MAVLink_param_request_list_message(1, 1), arming(0.0)
        link.port.receive(link.encoder.frame(bug) + link.encoder.frame(stop))
        await asyncio.sleep(0.01)
        assert link.rover.asked == ["disarm"]


@virtual
async def test_commands_that_are_refused_by_the_thousand_keep_nothing_from_the_station(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with linked(monkeypatch) as link:
        link.log.tick(tick(1.0))
        for _ in range(3000):
            link.port.receive(link.encoder.frame(arming(1.0)))
        await asyncio.sleep(2.0)
        heard = kinds(link.heard())
        assert heard["COMMAND_ACK"] < 200
        assert heard["ATTITUDE"] > 2


@virtual
async def test_stops_by_the_thousand_delay_what_is_told_by_two_seconds_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        link.log.tick(tick(1.0))
        for _ in range(3000):
            link.port.receive(link.encoder.frame(arming(0.0)))
        await asyncio.sleep(0.01)
        assert len(link.acks()) == 3000
        await asyncio.sleep(2.0)
        assert kinds(link.heard())["ATTITUDE"] > 2


@virtual
async def test_link_that_breaks_is_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        link.port.broken = True
        link.port.receive(b"")
        link.heard()
        await asyncio.sleep(1.5)
        assert not link.heard()
        link.port.broken = False
        await asyncio.sleep(1.5)
        assert kinds(link.heard())["HEARTBEAT"] >= 1
