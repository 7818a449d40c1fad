"""What a ground station is told and may do, in virtual time."""

from __future__ import annotations

import asyncio
import random
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import common

from tests.views.live.records import tick
from tests.views.mavlink.station import (
    KEY,
    MAY_ARM,
    NO_KEY,
    NOW_S,
    Encoder,
    arming,
    command,
    heartbeat,
    kinds,
    linked,
    mode,
    stick,
    texts,
)
from tests.virtual import virtual
from wayfarer.config.mavlink_settings import MavlinkSettings
from wayfarer.hal import MotorHealth
from wayfarer.views.mavlink.modes import MODE_AUTO, MODE_HOLD, MODE_INITIALISING, MODE_MANUAL
from wayfarer.views.mavlink.signing import MOST_TICKS, signing_ticks

ACCEPTED, BUSY, DENIED = (
    common.MAV_RESULT_ACCEPTED, common.MAV_RESULT_TEMPORARILY_REJECTED, common.MAV_RESULT_DENIED,
)  # fmt: skip
SIGNED = MavlinkSettings(key_file="key")
ORDERS = {
    "arm": arming(1.0), "disarm": arming(0.0), "hold": mode(MODE_HOLD), "resume": mode(MODE_AUTO),
    "manual by mavlink": mode(MODE_MANUAL),
}  # fmt: skip


@virtual
async def test_each_order_reaches_the_rover_where_it_is_signed(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch, MAY_ARM) as link:
        for name, order in ORDERS.items():
            await link.says(order)
            await asyncio.sleep(1.0)
            assert link.rover.asked[-1] == name
            assert link.acks() == [ACCEPTED]
        await link.says(common.MAVLink_set_mode_message(1, 1, MODE_HOLD))
        assert link.rover.asked[-1] == "hold"


async def orders_that_work(
    monkeypatch: pytest.MonkeyPatch, settings: MavlinkSettings, *, signed: bool, local: bool, simulated: bool = False
) -> set[str]:
    """Which orders reach the rover."""
    async with linked(monkeypatch, settings, simulated=simulated) as link:
        link.port.local = local
        for order in ORDERS.values():
            await link.says(order, encoder=None if signed else Encoder())
            await asyncio.sleep(1.0)
        return set(link.rover.asked)


@virtual
async def test_who_may_do_what(monkeypatch: pytest.MonkeyPatch) -> None:
    every, stops = set(ORDERS), {"disarm", "hold"}

    async def works(settings: MavlinkSettings, **sender: bool) -> set[str]:
        return await orders_that_work(monkeypatch, settings, **sender)

    assert await works(MAY_ARM, signed=True, local=False) == every
    assert await works(SIGNED, signed=True, local=False) == every - {"arm"}
    assert await works(MAY_ARM, signed=False, local=True) == set()  # it may relay what comes from elsewhere
    assert await works(NO_KEY, signed=False, local=False) == set()
    assert await works(NO_KEY, signed=False, local=True) == stops
    assert await works(NO_KEY, signed=False, local=True, simulated=True) == every - {"arm"}
    assert await works(NO_KEY, signed=False, local=False, simulated=True) == set()


@virtual
async def test_person_is_told_why_an_order_was_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch, SIGNED) as link:
        link.rover.refuses = "not armed: compass: no answer (check its wires)"
        await link.says(heartbeat(), arming(1.0), mode(MODE_HOLD))
        await asyncio.sleep(1.0)
        heard = link.heard()
        assert [each.result for each in heard if each.get_type() == "COMMAND_ACK"] == [DENIED, BUSY]
        assert texts(heard)[-2:] == [
            "arm refused: may_arm in [mavlink] of the rover file is false: use wayfarer arm",
            "hold refused: not armed: compass: no answer (check its wires)",
        ]


@virtual
async def test_order_that_is_repeated_while_it_is_carried_out_is_carried_out_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with linked(monkeypatch, MAY_ARM) as link:
        await link.says(arming(1.0), arming(1.0), arming(1.0))
        await asyncio.sleep(1.0)
        assert link.acks() == [common.MAV_RESULT_IN_PROGRESS] * 2 + [ACCEPTED]
        assert link.rover.asked == ["arm"]


@virtual
async def test_commands_for_others_and_with_impossible_values_do_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    nan, arm, set_mode = float("nan"), common.MAV_CMD_COMPONENT_ARM_DISARM, common.MAV_CMD_DO_SET_MODE
    async with linked(monkeypatch, MAY_ARM) as link:
        await link.says(command(arm, 1.0, target=2), command(arm, 1.0, target=0))
        assert not link.acks()
        await link.says(
            command(arm, nan), command(arm, 0.5), command(arm, 1e30), command(set_mode, 1.0, nan),
            command(set_mode, 0.0, 10.0), command(set_mode, 1.0, 1e38), command(31_000, 1.0),
            command(common.MAV_CMD_REQUEST_MESSAGE, nan), command(common.MAV_CMD_REQUEST_MESSAGE, 1e30),
        )  # fmt: skip
        assert link.acks() == [common.MAV_RESULT_UNSUPPORTED] * 9
        assert not link.rover.asked


@virtual
async def test_station_that_connects_gets_version_parameters_and_an_empty_mission(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with linked(monkeypatch) as link:
        await link.says(
            command(common.MAV_CMD_REQUEST_MESSAGE, common.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
            common.MAVLink_param_request_list_message(1, 1),
            common.MAVLink_param_request_read_message(1, 1, b"SYSID_THISMAV", -1),
            common.MAVLink_param_set_message(1, 1, b"MAY_ARM", 1.0, common.MAV_PARAM_TYPE_REAL32),
            common.MAVLink_mission_request_list_message(1, 1, 0),
        )
        heard = link.heard()
        assert kinds(heard)["AUTOPILOT_VERSION"] == 1
        values = [(each.param_id, each.param_value) for each in heard if each.get_type() == "PARAM_VALUE"]
        assert values[:4] == [("SYSID_THISMAV", 1.0), ("LINK_LOST_S", 5.0), ("LINK_LOST_HOLD", 0.0), ("MAY_ARM", 0.0)]
        assert values[4:] == [("SYSID_THISMAV", 1.0), ("MAY_ARM", 0.0)]
        assert [each.count for each in heard if each.get_type() == "MISSION_COUNT"] == [0]


# -- what it is told -------------------------------------------------------------------------------------------------


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
        link.log.event("arming", 101.0)
        assert await now() == (MODE_INITIALISING, False, standby)
        link.log.event("armed", 102.0, goal_heading_deg=0.0)
        link.log.tick(tick(102.1))
        assert await now() == (MODE_AUTO, True, active)
        link.log.event("hold", 103.0)
        assert await now() == (MODE_HOLD, True, active)
        link.log.event("disarmed", 104.0, reason="fault: compass_lost")
        assert await now() == (MODE_HOLD, False, standby)


@virtual
async def test_texts_wait_for_a_station_and_come_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch) as link:
        link.log.event("contact_map", 100.4, mode="plan")  # too often for a radio
        link.log.event("unclean_shutdown", 100.5, run="00041", mode="armed")
        await asyncio.sleep(10.0)
        assert not texts(link.heard())
        await link.says(heartbeat())
        await asyncio.sleep(2.0)
        assert texts(link.heard())[1] == "The run before (00041) was cut off while armed: killed, or without power"
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
async def test_all_messages_fit_half_of_a_radio_signed_or_not(monkeypatch: pytest.MonkeyPatch) -> None:
    unsigned, signed = await bytes_a_second(monkeypatch, NO_KEY), await bytes_a_second(monkeypatch, SIGNED)
    assert 300.0 < unsigned < signed < 1_000.0, (unsigned, signed)
    fast = MavlinkSettings(key_file="key", attitude_hz=20.0, position_hz=20.0, values_hz=20.0)
    at_most = await bytes_a_second(monkeypatch, fast)
    assert 2_700.0 < at_most <= 1.06 * 2_880.0  # a second of it at once, at the beginning
    floor = await bytes_a_second(monkeypatch, replace(fast, bytes_per_s=500))
    assert floor <= 1.06 * 500.0


@virtual
async def test_rover_sends_less_while_the_radio_is_full_and_heartbeats_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    async def sent_in_10_s(txbuf: int) -> tuple[int, int]:
        for _ in range(10):  # unsigned: a radio has no key
            await link.says(common.MAVLink_radio_status_message(90, 90, txbuf, 20, 20, 0, 0), encoder=Encoder())
            link.log.tick(tick(100.0))
            await asyncio.sleep(0.99)
        count = sum(map(len, link.port.sent))
        return count, kinds(link.heard())["HEARTBEAT"]

    async with linked(monkeypatch, MavlinkSettings(key_file="key", attitude_hz=20.0, bytes_per_s=2880)) as link:
        usual, _ = await sent_in_10_s(60)
        await sent_in_10_s(5)
        less, beats = await sent_in_10_s(5)
        assert less < 0.4 * usual
        assert beats >= 9
        await sent_in_10_s(95)
        assert (await sent_in_10_s(95))[0] > 0.9 * usual


# -- links that are lost, and enemies --------------------------------------------------------------------------------


@pytest.mark.parametrize("on_link_lost", ["continue", "hold"])
@pytest.mark.parametrize("armed", [True, False])
@virtual
async def test_lost_link_does_what_the_rover_file_says(
    monkeypatch: pytest.MonkeyPatch, on_link_lost: str, armed: bool
) -> None:
    settings = MavlinkSettings(key_file="key", on_link_lost=on_link_lost)  # type: ignore[arg-type]
    async with linked(monkeypatch, settings) as link:
        if armed:
            link.log.event("armed", 101.0, goal_heading_deg=0.0)
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
        noted = f"link lost: the ground station is silent{': held' if holds else ''}"
        assert link.rover.asked == ["hold"] * holds + [noted]
        await asyncio.sleep(60.0)
        assert link.rover.asked == ["hold"] * holds + [noted]  # once, and it may be resumed by somebody else


@virtual
async def test_forged_frame_from_the_future_shuts_nobody_out(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch, SIGNED) as link:
        await link.says(heartbeat())
        await link.says(arming(1.0), mode(MODE_AUTO), encoder=Encoder(bytes(32), MOST_TICKS - 9))
        await link.says(mode(MODE_HOLD))
        assert link.rover.asked == ["hold"]
        await asyncio.sleep(31.0)
        assert any("2 messages ignored: not signed with our key" in text for text in texts(link.heard()))


@virtual
async def test_station_behind_the_time_of_a_restarted_rover_is_told_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rover reserves 10 min ahead; at udpin a station hears nothing else before it is believed."""
    async with linked(monkeypatch, SIGNED) as link:
        late = Encoder(KEY, ticks=signing_ticks(NOW_S - 600.0))
        await link.says(heartbeat(), heartbeat(), encoder=late)
        await link.says(heartbeat(), encoder=Encoder(b"x" * 32))
        await link.says(heartbeat(), encoder=Encoder())
        (answer,) = link.port.answered
        assert common.MAVLink(None).decode(bytearray(answer)).get_type() == "SYSTEM_TIME"
        told = int.from_bytes(answer[-12:-6], "little")
        await link.says(command(common.MAV_CMD_DO_SET_MODE, 1.0, MODE_HOLD), encoder=Encoder(KEY, ticks=told))
        assert link.rover.asked == ["hold"]


@virtual
async def test_hostile_packets_do_nothing_and_leave_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    chance, unsigned, forged = random.Random(7), Encoder(), Encoder(bytes(32))
    recorded = Encoder(KEY).frame(mode(MODE_AUTO))
    async with linked(monkeypatch, SIGNED) as link:
        await link.says(heartbeat(), heartbeat())
        for number in range(2_000):
            order = chance.choice([*ORDERS.values(), stick(1000, 1000)])
            data = bytearray(chance.choice([unsigned, forged]).frame(order))
            if number % 3 == 0:
                data[chance.randrange(len(data))] = chance.randrange(256)
            link.port.receive(bytes(data) if number % 5 else chance.randbytes(chance.randrange(300)))
        link.port.receive(recorded)  # its time was that of the first heartbeat
        await asyncio.sleep(1.0)
        assert not link.rover.asked
        assert len(link.port.sent) < 60


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
