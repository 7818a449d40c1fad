"""The RoboClaw driver proves its deadman, lets no request prolong a command, and believes no answer without its CRC."""

from __future__ import annotations

import asyncio
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.boards import RoboClawBench, now_s, stall
from tests.virtual import virtual
from wayfarer.drivers.roboclaw import RoboClaw, RoboClawSettings
from wayfarer.drivers.roboclaw_board import Opcode, link_to, with_crc
from wayfarer.errors import BadReading, DriverError, NotResponding, PowerLost
from wayfarer.hal import STOP, WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.faults.bus import BoardFault, FailsafeOff
from wayfarer.simhal.faults.wires import SERIAL, FaultyWire, Hang, WiredPart

AHEAD = WheelCommand(0.5, 0.5)
ASK_TIMEOUT, STAND = "80 0F", "80 22 00 00 00 00 98 17"


def moves(bench: RoboClawBench) -> list[str]:
    """The commands to move that were sent."""
    return [sent for sent in bench.sent() if sent.startswith("80 22") and not sent.startswith(STAND)]


# -- what goes over the wire -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "data", "sent"),
    [
        (34, "40 00 C0 00", "80 22 40 00 C0 00 E0 DF"),
        (34, "7F FF 7F FF", "80 22 7F FF 7F FF C7 78"),
        (34, "80 01 80 01", "80 22 80 01 80 01 79 A6"),
        (14, "03", "80 0E 03 28 36"),
        (14, "00", "80 0E 00 18 55"),
    ],
)
def test_packets_are_those_that_the_makers_library_sends(command: int, data: str, sent: str) -> None:
    assert with_crc(0x80, command, bytes.fromhex(data)).hex(" ").upper() == sent


@virtual
async def test_opening_asks_who_it_is_stands_still_sets_the_timeout_and_reads_it_back() -> None:
    bench = RoboClawBench()
    await bench.motors.open()
    assert bench.sent() == ["80 15 00", STAND, with_crc(0x80, 14, b"\x02").hex(" ").upper(), ASK_TIMEOUT]
    assert bench.chip.timeout == 2
    assert bench.motors.name == "RoboClaw 128 on /dev/serial0 (2x15a v4.1.34)"


@virtual
async def test_each_command_to_move_is_after_a_look_at_the_timeout_and_a_stop_is_at_once() -> None:
    bench = await RoboClawBench(left=2, address=0x87, reverse_right=True).opened()
    await bench.motors.drive(WheelCommand(1.0, 0.5))
    assert bench.sent() == ["87 0F", with_crc(0x87, 34, bytes.fromhex("C0 01 7F FF")).hex(" ").upper()]
    await bench.motors.drive(STOP)
    assert bench.sent() == ["87 22 00 00 00 00 50 56"]


def test_baud_rate_that_is_too_slow_for_the_control_rate_is_refused() -> None:
    assert RoboClawSettings().keeps_up_with(20.0) is None
    assert RoboClawSettings(baud=115200).keeps_up_with(50.0) is None
    assert RoboClawSettings().keeps_up_with(50.0) == "baud = 38400: the board would answer too late"


# -- the deadman -------------------------------------------------------------------------------------------------------


@virtual
async def test_firmware_that_does_not_acknowledge_the_timeout_is_opened_because_it_is_read_back() -> None:
    bench = await RoboClawBench({"acknowledges_one_byte": False}).opened()
    assert bench.chip.timeout == 2
    assert await bench.motors.drive(AHEAD) == pytest.approx(AHEAD, abs=1e-4)


@virtual
async def test_board_that_does_not_keep_its_timeout_does_not_open() -> None:
    bench = RoboClawBench()
    bench.chip.keeps_timeout = False
    bench.chip.receive(with_crc(0x80, 34, bytes(3) + b"\x7f"))  # whoever told it that
    assert bench.world.commanded != STOP
    with pytest.raises(NotResponding, match=r"its timeout does not stay at 0\.2 s: set 3 times, another is read"):
        await bench.motors.open()
    assert bench.world.commanded == STOP


@pytest.mark.parametrize("fed", [True, False])
@pytest.mark.parametrize("asks_each_s", [0.02, 0.05, 0.15, 0.35, 10.0])
@virtual
async def test_no_request_lets_the_wheels_turn_longer_than_the_deadman_that_is_told(
    asks_each_s: float, fed: bool
) -> None:
    """The control tick hangs; health and wheels are still asked for, also by another driver of the board."""
    bench = await RoboClawBench({"fed_by_requests": fed}).opened()
    other = link_to(bench.buses.serial("/dev/serial0"), 0x80)
    await bench.motors.drive(AHEAD)
    began_s, asked_s, deadman_s = now_s(), now_s(), bench.motors.deadman_s
    assert deadman_s == 0.4
    while bench.world.commanded != STOP:
        await asyncio.sleep(0.01)
        bench.chip.tick()
        if now_s() - asked_s >= asks_each_s:
            asked_s = now_s()
            await bench.motors.health()
            await other.ask(Opcode.GET_TIMEOUT, 1)
    assert 0.19 < now_s() - began_s <= deadman_s + 0.01


@virtual
async def test_late_request_is_answered_truly_before_the_stop_behind_it() -> None:
    """So a check that waits for the deadman to trip still proves something."""
    bench = await RoboClawBench().opened()
    await bench.motors.drive(AHEAD)
    bench.chip.timeout = 20  # the board's clock is slow
    await asyncio.sleep(0.5)
    assert await bench.motors.read_back() == pytest.approx(AHEAD, abs=1e-4)
    assert await bench.motors.read_back() == STOP


@virtual
async def test_stop_that_is_acknowledged_after_a_newer_command_does_not_count_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = await RoboClawBench().opened()
    line = bench.buses.serial("/dev/serial0")
    link, exchange = link_to(line, 0x80), line.exchange

    async def slow(*arguments: Any) -> bytes:
        answer = await exchange(*arguments)
        await asyncio.sleep(0.01)
        return answer

    monkeypatch.setattr(line, "exchange", slow)
    await asyncio.gather(link.drive(0, 0, 0.2), link.drive(9000, 9000, 0.2))
    bench.chip.timeout = 20
    await asyncio.sleep(0.3)
    assert bench.chip.levels == (9000, 9000)
    await bench.motors.read_back()
    assert bench.chip.levels == (0, 0)


@pytest.mark.parametrize("halted_after_s", [0.0, 0.049, 0.055])
@virtual
async def test_command_that_was_not_acknowledged_is_not_sent_again_after_a_halt(halted_after_s: float) -> None:
    bench = await RoboClawBench().opened()
    bench.change = lambda asked, answer: b"" if asked[1] == Opcode.SET_DUTIES else answer
    asyncio.get_running_loop().call_later(halted_after_s, bench.motors.halt)
    assert await bench.motors.drive(AHEAD) == STOP
    assert len(moves(bench)) == 1
    assert bench.world.commanded == STOP


@pytest.mark.parametrize("amid", [Opcode.GET_TIMEOUT, Opcode.SET_DUTIES])
@pytest.mark.parametrize("is_halted", [True, False])
@virtual
async def test_after_a_halt_or_a_suspension_amid_a_command_the_wheels_stand(amid: Opcode, is_halted: bool) -> None:
    bench = await RoboClawBench().opened()

    def change(asked: bytes, answer: bytes) -> bytes:
        if asked[1] == amid:
            bench.change = lambda _, answer: answer
            if is_halted:
                bench.motors.halt()
            else:
                stall(1.0)
        return answer

    bench.change = change
    assert await bench.motors.drive(AHEAD) == STOP
    assert bench.world.commanded == STOP
    assert len(moves(bench)) == (amid is Opcode.SET_DUTIES)


@virtual
async def test_command_during_which_the_process_was_suspended_is_not_sent_again() -> None:
    bench = await RoboClawBench().opened()

    def lost(data: bytes) -> bool:
        if is_move := data[1] == Opcode.SET_DUTIES:
            stall(1.0)
        return is_move

    bench.lost = lost
    with pytest.raises(NotResponding):
        await bench.motors.drive(AHEAD)
    assert len(moves(bench)) == 1


@virtual
async def test_board_that_has_just_started_and_takes_the_second_try_is_stopped() -> None:
    bench = await RoboClawBench().opened()

    def lost(data: bytes) -> bool:
        if is_move := data[1] == Opcode.SET_DUTIES:
            bench.chip.power_cycle()
            bench.lost = lambda _: False
        return is_move

    bench.lost = lost
    with pytest.raises(PowerLost):
        await bench.motors.drive(AHEAD)
    assert len(moves(bench)) == 2
    assert bench.chip.levels == (0, 0)


@virtual
async def test_stop_that_is_not_acknowledged_is_posted_behind() -> None:
    bench = await RoboClawBench().opened()
    await bench.motors.drive(AHEAD)
    bench.chip.timeout = 20
    bench.lost = lambda data: data == bytes.fromhex(STAND)
    await bench.motors.stop()
    assert bench.chip.levels == (0, 0)


@virtual
async def test_standing_rover_is_asked_without_stops() -> None:
    bench = await RoboClawBench().opened()
    await asyncio.sleep(5.0)
    await bench.motors.health()
    assert bench.sent() == ["80 18", "80 5A", "80 0F"]


@virtual
async def test_board_that_lost_its_power_gets_no_command_to_move_before_it_is_opened() -> None:
    bench = await RoboClawBench().opened()
    await bench.motors.drive(AHEAD)
    bench.chip.power_cycle()
    bench.sent()
    for _ in range(2):
        with pytest.raises(PowerLost):
            await bench.motors.drive(AHEAD)
    assert moves(bench) == []
    assert bench.chip.timeout == 2
    assert bench.world.commanded == STOP
    assert bench.motors.error_counts["power lost"] == 1
    await bench.motors.open()
    await bench.motors.drive(AHEAD)
    assert bench.world.commanded != STOP


@virtual
async def test_faults_on_purpose_are_a_deadman_that_does_not_arm_and_a_sentence() -> None:
    bench = RoboClawBench()
    wired = WiredPart("roboclaw", None, SERIAL, bench.chip, FaultyWire(""), Hang(""))
    with FailsafeOff().effect(wired, Random(0)), pytest.raises(NotResponding, match="does not stay"):
        await bench.motors.open()
    await bench.motors.open()
    with BoardFault().effect(wired, Random(0)):
        assert (await bench.motors.health()).faults[0].startswith("M1 (left): driver fault")
    assert (await bench.motors.health()).faults == ()


# -- answers -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("status_bytes", "status", "said"),
    [
        (4, 0, []),
        (2, 0, []),
        (4, 0x1, ["emergency stop"]),
        (2, 0x4, ["emergency stop"]),
        (4, 0x40, ["M1 (right): driver fault"]),
        (2, 0x200, ["M2 (left): driver fault"]),
        (4, 0x2 | 0x20, ["too hot", "logic voltage too low"]),
        (4, 0x10000 | 0x80000, []),  # warnings
        (2, 0x1 | 0x800, []),
    ],
)
@virtual
async def test_status_of_either_firmware_is_the_same_sentences(status_bytes: Any, status: int, said: list[str]) -> None:
    bench = await RoboClawBench({"status_bytes": status_bytes}, left=2).opened()
    bench.chip.status = status
    health = await bench.motors.health()
    assert health.battery_v == 12.6
    assert [fault[: len(text)] for fault, text in zip(health.faults, said, strict=True)] == said


@virtual
async def test_side_whose_current_is_limited_obeys_and_another_does_not() -> None:
    bench = await RoboClawBench().opened()
    await bench.motors.drive(WheelCommand(0.5, -0.5))
    bench.chip.levels = (4000, -4000)
    bench.chip.status = 0x10000
    await bench.motors.health()
    left, right = await bench.motors.read_back()
    assert (left, right) == pytest.approx((0.5, -4000 / 32767), abs=1e-4)
    for neither in ((-4000, 20000), (0, 0)):  # the wrong way, and a timeout that has tripped
        bench.chip.levels = neither
        assert await bench.motors.read_back() == pytest.approx([level / 32767 for level in neither])


@virtual
async def test_acknowledgements_of_a_posted_stop_do_not_spoil_the_next_answer() -> None:
    bench = await RoboClawBench().opened()
    bench.chip.levels = (-1, -1)  # FF FF FF FF
    for strays in range(4):
        bench.change = lambda _, answer, strays=strays: b"\xff" * strays + answer  # type: ignore[misc]
        assert await bench.motors.read_back() == pytest.approx((0.0, 0.0), abs=1e-4)
        assert (await bench.motors.health()).battery_v == 12.6
    assert bench.motors.error_counts["requests retried"] == 0


def torn(_: bytes, answer: bytes) -> bytes:
    return answer[:-1]


def noise(_: bytes, answer: bytes) -> bytes:
    return bytes(byte ^ 0x11 for byte in answer)


class StandardSerial:
    """A board in the wrong mode: each byte turns a motor until the next."""

    def receive(self, data: bytes) -> bytes:
        assert data.endswith(b"\0"), "it would turn until something else is sent"
        return b""


@virtual
async def test_board_in_standard_serial_stands_after_all_that_may_be_sent_to_it() -> None:
    buses = FakeBuses()
    buses.serial("/dev/serial0").attach(StandardSerial())
    motors = RoboClaw(RoboClawSettings(), buses)
    with pytest.raises(NotResponding, match="not in packet serial mode"):
        await motors.open()
    await motors.stop()
    motors.halt()


@pytest.mark.parametrize("change", [torn, noise])
@virtual
async def test_one_bad_answer_is_asked_for_again_after_the_board_has_dropped_the_packet(change: Any) -> None:
    bench = await RoboClawBench().opened()
    bad = iter((True,))
    bench.change = lambda asked, answer: change(asked, answer) if next(bad, False) else answer
    assert (await bench.motors.health()).battery_v == 12.6
    bad = iter((True,))
    await bench.motors.drive(AHEAD)
    assert bench.world.commanded == pytest.approx(AHEAD, abs=1e-4)
    assert bench.motors.error_counts["requests retried"] == 2


@virtual
async def test_answer_to_something_else_is_no_reading() -> None:
    """A board whose answers repeat is caught by the CRC, which is over the question too."""
    bench = await RoboClawBench().opened()
    frozen = bench.chip.receive(bytes.fromhex("80 18"))
    bench.change = lambda *_: frozen
    for use in (bench.motors.read_back, lambda: bench.motors.drive(AHEAD)):
        with pytest.raises(DriverError):
            await use()
    assert bench.world.commanded == STOP


@given(answer=st.binary(max_size=4).filter(lambda answer: answer[:1] != b"\xff"))
@virtual
async def test_nothing_but_ff_acknowledges_a_command(answer: bytes) -> None:
    bench = await RoboClawBench().opened()
    bench.change = lambda asked, said: answer if asked[1] == Opcode.SET_DUTIES else said
    with pytest.raises((NotResponding, BadReading)):
        await bench.motors.drive(AHEAD)


@given(answer=st.binary(max_size=12))
@virtual
async def test_no_answer_without_the_right_crc_is_taken(answer: bytes) -> None:
    buses = FakeBuses()
    bench = RoboClawBench()
    bench.change = lambda *_: answer
    buses.serial("/dev/serial0").attach(bench)
    with pytest.raises((NotResponding, BadReading)):
        await link_to(buses.serial("/dev/serial0"), 0x80).ask(Opcode.GET_STATUS, 2, 4)
