"""The Sabertooth driver tells a board that never answers all that it must not forget."""

from __future__ import annotations

import asyncio
from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from tests.drivers.motor_boards import check_applied, check_strange_duties
from tests.virtual import virtual
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings, packet
from wayfarer.errors import NotResponding
from wayfarer.escape.api import Vehicle
from wayfarer.hal import STOP, DriveMotors, MotorHealth, WheelCommand
from wayfarer.simhal.buses import FakeBuses, FakeSerial
from wayfarer.simhal.chips.sabertooth import SabertoothChip
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World
from wayfarer.testing import check_motors

CLEARING = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ())
STEADY = Physics(steer_noise_rad=0.0, heading_noise_deg=0.0, side_gain_sd=0.0, track_sd=0.0, slip_mean_m=1e9)
TIMEOUT, STAND = "80 0E 03 11", "80 00 00 00 80 04 00 04"

DUTIES = st.floats(-1.0, 1.0)


class Wire:
    """Stands between a port and a chip and keeps what each write brought; drops some bytes if told to."""

    def __init__(self, chip: SabertoothChip) -> None:
        self.chip = chip
        self.seen: list[bytes] = []
        self.lost: set[int] = set()

    def receive(self, data: bytes) -> None:
        self.seen.append(data)
        self.chip.receive(bytes(byte for at, byte in enumerate(data) if at not in self.lost))


class Bench:
    """A board on a port, over a world; nothing has spoken to it yet."""

    def __init__(self, given: SabertoothSettings | None = None) -> None:
        given = given or SabertoothSettings()
        self.world = World(CLEARING, Vehicle(0.4, 0.4, 0.5, 1.4), STEADY, RandomStreams(0))
        self.chip = SabertoothChip(
            self.world,
            lambda: asyncio.get_running_loop().time(),
            address=given.address,
            full_level=127 * given.duty_limit,
            left=given.left,
            reverse_left=given.reverse_left,
            reverse_right=given.reverse_right,
        )
        self.wire = Wire(self.chip)
        self.buses = FakeBuses()
        self.buses.serial(given.port).chip = self.wire
        self.motors = Sabertooth(given, self.buses)

    def sent(self) -> list[str]:
        """Return what was written since this was asked last, a string for each write."""
        sent = [data.hex(" ").upper() for data in self.wire.seen]
        self.wire.seen.clear()
        return sent


class GoneBuses(FakeBuses):
    """Ports whose cables were pulled out."""

    def serial(self, name: str, *, baud: int = 9600) -> FakeSerial:
        return GoneSerial(name)


class GoneSerial(FakeSerial):
    async def write(self, data: bytes) -> None:
        raise NotResponding(f"{self.name}: the port is gone; plug it in again")


# -- what goes over the wire -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "command", "data", "sent"),
    [
        (128, 0, 127, "80 00 7F 7F"),
        (128, 1, 127, "80 01 7F 00"),
        (128, 4, 64, "80 04 40 44"),
        (128, 5, 64, "80 05 40 45"),
        (128, 14, 5, "80 0E 05 13"),
        (128, 14, 3, "80 0E 03 11"),
        (128, 2, 20, "80 02 14 16"),
        (128, 17, 3, "80 11 03 14"),
        (128, 16, 14, "80 10 0E 1E"),
        (128, 8, 64, "80 08 40 48"),
        (128, 10, 32, "80 0A 20 2A"),
        (128, 6, 64, "80 06 40 46"),
        (128, 15, 4, "80 0F 04 13"),
        (130, 0, 64, "82 00 40 42"),
        (135, 5, 127, "87 05 7F 0B"),
    ],
)
def test_a_packet_ends_in_its_sum_modulo_128(address: int, command: int, data: int, sent: str) -> None:
    assert packet(address, command, data) == bytes.fromhex(sent)


@virtual
async def test_both_sides_go_out_in_one_write_cut_off_towards_zero() -> None:
    bench = Bench()
    await bench.motors.open()
    bench.sent()
    await bench.motors.drive(WheelCommand(1.0, -0.5))
    assert bench.sent() == [f"80 00 7F 7F 80 05 3F 44 {TIMEOUT}"]
    assert bench.world.commanded == (1.0, -63 / 127)


@virtual
async def test_wires_may_be_swapped_and_reversed() -> None:
    bench = Bench(SabertoothSettings(address=130, left=2, reverse_left=True))
    await bench.motors.open()
    bench.sent()
    await bench.motors.drive(WheelCommand(1.0, 0.5))
    assert bench.sent() == ["82 05 7F 06 82 00 3F 41 82 0E 03 13"]
    assert bench.world.commanded == (1.0, 63 / 127)


@virtual
async def test_opening_sets_timeout_and_lowest_voltage_and_stands_still() -> None:
    bench = Bench(SabertoothSettings(battery_min_v=10.0))
    await bench.motors.open()
    assert bench.sent() == [f"{STAND} {TIMEOUT} 80 02 14 16"]
    assert bench.chip.settings == {14: 3, 2: 20}


@virtual
async def test_the_lowest_voltage_is_left_alone_where_none_is_given() -> None:
    bench = Bench()
    await bench.motors.open()
    assert bench.sent() == [f"{STAND} {TIMEOUT}"]


@virtual
async def test_stop_and_halt_say_it_three_times() -> None:
    bench = Bench()
    for stop in (bench.motors.stop, bench.motors.halt):
        await bench.motors.drive(WheelCommand(0.5, 0.5))
        assert bench.world.commanded != STOP
        bench.sent()
        if (waiting := stop()) is not None:
            await waiting
        assert bench.sent() == [f"{STAND} {STAND} {STAND}"]
        assert bench.world.commanded == STOP


@given(lost=st.sets(st.integers(0, 23), max_size=2))
@settings(deadline=None)
@virtual
async def test_stop_gets_through_where_two_bytes_are_lost(lost: set[int]) -> None:
    bench = Bench()
    await bench.motors.drive(WheelCommand(0.5, -0.5))
    bench.wire.lost = lost
    await bench.motors.stop()
    assert bench.world.commanded == STOP


@given(
    command=st.builds(WheelCommand, DUTIES, DUTIES),
    limit=st.floats(0.1, 1.0),
    left=st.sampled_from((1, 2)),
    reverse_left=st.booleans(),
    reverse_right=st.booleans(),
)
@settings(deadline=None)
@virtual
async def test_what_is_applied_is_what_the_wheels_get_and_at_most_what_was_asked(
    command: WheelCommand, limit: float, left: Literal[1, 2], reverse_left: bool, reverse_right: bool
) -> None:
    bench = Bench(
        SabertoothSettings(left=left, reverse_left=reverse_left, reverse_right=reverse_right, duty_limit=limit)
    )
    await check_applied(bench.motors, bench.world, command, 127 * limit)


@virtual
async def test_duties_beyond_full_are_full_and_what_is_no_number_reaches_no_motor() -> None:
    bench = Bench()
    assert await bench.motors.drive(WheelCommand(1.5, -7.0)) == (1.0, -1.0)
    await check_strange_duties(bench.motors, bench.sent)


# -- the deadman -----------------------------------------------------------------------------------------------------


@virtual
async def test_silence_stops_the_wheels() -> None:
    bench = Bench()
    await bench.motors.open()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    await asyncio.sleep(0.29)
    bench.chip.tick()
    assert bench.world.commanded != STOP
    await asyncio.sleep(0.02)
    bench.chip.tick()
    assert bench.world.commanded == STOP


@virtual
async def test_an_invisible_reset_takes_the_lowest_voltage_for_a_second_and_the_timeout_for_one_command() -> None:
    bench = Bench(SabertoothSettings(battery_min_v=10.0))
    await bench.motors.open()
    bench.chip.power_cycle()
    for _ in range(19):
        await asyncio.sleep(0.05)
        await bench.motors.drive(WheelCommand(0.5, 0.5))
        assert bench.chip.settings == {14: 3}
    for _ in range(2):
        await asyncio.sleep(0.05)
        await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.chip.settings == {14: 3, 2: 20}


@pytest.mark.parametrize("heard_from", range(13))
@virtual
async def test_a_board_that_starts_amid_a_command_turns_no_wheel_without_its_timeout(heard_from: int) -> None:
    bench = Bench()
    await bench.motors.open()
    bench.chip.power_cycle()
    bench.wire.lost = set(range(heard_from))
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.world.commanded == STOP or bench.chip.settings == {14: 3}


@virtual
async def test_at_2400_baud_the_timeout_goes_out_once_a_second_only() -> None:
    bench = Bench(SabertoothSettings(baud=2400))
    await bench.motors.open()
    bench.chip.power_cycle()
    for _ in range(19):
        await asyncio.sleep(0.05)
        await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.chip.settings == {}
    await asyncio.sleep(0.1)
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.chip.settings == {14: 3}


@pytest.mark.parametrize(("timeout_s", "units"), [(0.1, 1), (0.3, 3), (0.7, 7), (12.7, 127)])
@virtual
async def test_the_timeout_is_told_in_tenths_of_a_second(timeout_s: float, units: int) -> None:
    bench = Bench(SabertoothSettings(timeout_s=timeout_s))
    await bench.motors.open()
    assert bench.chip.settings[14] == units
    assert bench.motors.deadman_s == timeout_s


@pytest.mark.parametrize(("battery_min_v", "units"), [(6.0, 0), (6.6, 3), (10.15, 21), (18.4, 62), (30.0, 120)])
@virtual
async def test_the_lowest_voltage_is_told_in_the_nearest_fifth_of_a_volt(battery_min_v: float, units: int) -> None:
    bench = Bench(SabertoothSettings(battery_min_v=battery_min_v))
    await bench.motors.open()
    assert bench.chip.settings[2] == units


# -- what it cannot know ---------------------------------------------------------------------------------------------


@virtual
async def test_nothing_is_claimed_of_a_board_that_cannot_be_asked() -> None:
    motors: DriveMotors = Bench().motors
    assert await motors.read_back() is None
    assert await motors.health() == MotorHealth(None, ())


@virtual
async def test_a_port_that_is_gone_is_told_by_all_but_stop() -> None:
    motors = Sabertooth(SabertoothSettings(), GoneBuses())
    for call in (motors.open, lambda: motors.drive(STOP)):
        with pytest.raises(NotResponding, match="/dev/serial0: the port is gone"):
            await call()
    await motors.stop()


@virtual
async def test_settings_lost_with_a_port_are_sent_when_it_is_back() -> None:
    bench = Bench()
    port = bench.buses.serial("/dev/serial0")
    write, port.write = port.write, GoneSerial("/dev/serial0").write  # type: ignore[method-assign]
    with pytest.raises(NotResponding):
        await bench.motors.drive(STOP)
    port.write = write  # type: ignore[method-assign]
    await bench.motors.drive(STOP)
    assert bench.chip.settings == {14: 3}


@virtual
async def test_it_keeps_what_motors_promise() -> None:
    assert isinstance(Bench().motors, DriveMotors)
    await check_motors(lambda: Bench().motors, lambda: Sabertooth(SabertoothSettings(), GoneBuses()))


@pytest.mark.parametrize(
    "wrong",
    [{"address": 127}, {"address": 136}, {"baud": 115200}, {"left": 3}, {"timeout_s": 0.35}, {"timeout_s": 0.0},
     {"timeout_s": 12.8}, {"battery_min_v": 5.9}, {"duty_limit": 1.1}],
)  # fmt: skip
def test_settings_that_no_board_has_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(SabertoothSettings).validate_python(wrong)


@given(tenths=st.integers(1, 127))
def test_every_tenth_of_a_second_can_be_set(tenths: int) -> None:
    settings = TypeAdapter(SabertoothSettings).validate_python({"timeout_s": tenths / 10, "battery_min_v": None})
    assert settings.timeout_s == tenths / 10


@virtual
async def test_halt_that_comes_amid_a_drive_command_wins() -> None:
    bench = Bench()
    await bench.motors.open()
    write = bench.wire.receive

    def halted_first(data: bytes) -> None:
        bench.wire.receive = write  # type: ignore[method-assign]
        bench.motors.halt()
        write(data)  # the drive command, which was under way

    bench.wire.receive = halted_first  # type: ignore[method-assign]
    assert await bench.motors.drive(WheelCommand(0.5, 0.5)) == STOP
    assert bench.world.commanded == STOP


# -- the load of the wire --------------------------------------------------------------------------------------------


async def share_of_wire(bench: Bench, baud: int, control_hz: float) -> float:
    """Drive for ten seconds and return which share of the wire's time the bytes take, with start and stop bit."""
    await bench.motors.open()
    bench.sent()
    ticks = round(10.0 * control_hz)
    for _ in range(ticks):
        await asyncio.sleep(1.0 / control_hz)
        await bench.motors.drive(WheelCommand(0.5, 0.5))
    return sum(map(len, bench.wire.seen)) * 10 / baud / 10.0


@pytest.mark.parametrize("baud", [2400, 9600])
@virtual
async def test_control_rate_is_refused_from_where_it_takes_more_than_7_tenths_of_the_wire(
    baud: Literal[2400, 9600],
) -> None:
    """The rest is for stops; the lowest voltage goes out with the other settings."""
    given = SabertoothSettings(baud=baud, battery_min_v=10.0)
    fastest_hz = max(hz for hz in range(1, 200) if given.keeps_up_with(hz) is None)
    assert await share_of_wire(Bench(given), baud, fastest_hz) <= 0.7
    assert await share_of_wire(Bench(given), baud, fastest_hz + 1) > 0.7
    assert f"baud = {baud}" in str(given.keeps_up_with(fastest_hz + 1))


@pytest.mark.parametrize("timeout_s", [0.3, 0.7])
@virtual
async def test_the_deadman_that_is_told_is_the_time_after_which_the_board_stops_the_wheels(timeout_s: float) -> None:
    given = SabertoothSettings(timeout_s=timeout_s)
    bench = Bench(given)
    await bench.motors.open()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    time = asyncio.get_running_loop().time
    driven_s = time()
    while bench.world.commanded != STOP:
        await asyncio.sleep(0.005)
        bench.chip.tick()
    assert time() - driven_s == pytest.approx(timeout_s, abs=0.01)
    assert bench.motors.deadman_s == given.deadman_s == timeout_s
