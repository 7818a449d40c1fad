"""The ThunderBorg driver says the board's own words, and hears when the board does not mean what it wants."""

from __future__ import annotations

import asyncio
from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from tests.drivers.motor_boards import check_applied, check_strange_duties
from tests.virtual import virtual
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings, _Motor
from wayfarer.drivers.thunderborg_light import ThunderBorgLight, ThunderBorgLightSettings
from wayfarer.errors import BadReading, NotResponding, PowerLost, WrongPart
from wayfarer.escape.api import Vehicle
from wayfarer.hal import STOP, Colour, DriveMotors, StatusLight, WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.thunderborg import ThunderBorgChip
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World
from wayfarer.testing import check_motors

ADDRESS = 0x15
CLEARING = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ())
STEADY = Physics(steer_noise_rad=0.0, heading_noise_deg=0.0, side_gain_sd=0.0, track_sd=0.0, slip_mean_m=1e9)
PURPLE = Colour(1.0, 0.0, 1.0)

DUTIES = st.floats(-1.0, 1.0)


def now_s() -> float:
    return asyncio.get_running_loop().time()


class Cable:
    """Stands between a bus and a chip: the next writes fail, or some are lost although acknowledged.

    ``garbled`` is how many answers to a command come back with a wrong echo, ``answers`` what is answered in place of
    the chip's own.
    """

    def __init__(self, chip: ThunderBorgChip) -> None:
        self.chip = chip
        self.loose = 0
        self.garbled: dict[int, int] = {}
        self.failsafes_lost = 0
        self.answers: dict[int, bytes] = {}
        self.restarts_at: bytes | None = None

    def write(self, data: bytes) -> None:
        if data == self.restarts_at:
            self.restarts_at, self.loose = None, 1
            self.chip.power_cycle()
        if self.loose:
            self.loose -= 1
            raise NotResponding("/dev/i2c-1: no answer at address 0x15")
        if data == b"\x13\x01" and self.failsafes_lost:
            self.failsafes_lost -= 1
            return
        self.chip.write(data)

    def read(self, count: int) -> bytes:
        reply = self.chip.read(count)
        command = reply[0]
        if self.garbled.get(command):
            self.garbled[command] -= 1
            return b"\x07" + reply[1:]
        return bytes((command, *self.answers.get(command, reply[1:]))).ljust(count)


class Bench:
    """A board on a bus, over a world; nothing has spoken to it yet."""

    def __init__(self, given: ThunderBorgSettings | None = None) -> None:
        given = given or ThunderBorgSettings()
        self.world = World(CLEARING, Vehicle(0.4, 0.4, 0.5, 1.4), STEADY, RandomStreams(0))
        self.chip = ThunderBorgChip(
            self.world,
            now_s,
            full_level=255 * given.duty_limit,
            left=given.left,
            reverse_left=given.reverse_left,
            reverse_right=given.reverse_right,
        )
        self.cable = Cable(self.chip)
        self.buses = FakeBuses()
        self.buses.i2c("/dev/i2c-1").attach(ADDRESS, self.cable)
        self.motors = ThunderBorg(given, self.buses)
        self.light = ThunderBorgLight(ThunderBorgLightSettings(), self.buses)

    async def opened(self) -> Bench:
        """This bench with open motors, of which nothing is in ``sent``."""
        await self.motors.open()
        self.sent()
        return self

    def sent(self) -> list[str]:
        """Return what was written since this was asked last."""
        sent = [data.hex(" ").upper() for data in self.chip.writes]
        self.chip.writes.clear()
        return sent


# -- what goes over the wire -----------------------------------------------------------------------------------------


@virtual
async def test_driving_asks_for_the_failsafe_and_writes_the_left_motor_then_the_right_one() -> None:
    bench = await Bench().opened()
    await bench.motors.drive(WheelCommand(0.5, -1.0))
    assert bench.sent() == ["14", "0B 79", "09 F2"]


@virtual
async def test_a_stop_asks_for_nothing_first() -> None:
    bench = await Bench().opened()
    await bench.motors.drive(STOP)
    assert bench.sent() == ["0B 00", "08 00"]


@pytest.mark.parametrize(("duty", "sent"), [(0.5, "08 7F"), (1.0, "08 FF"), (0.0, "08 00"), (-0.5, "09 7F")])
@virtual
async def test_levels_are_cut_off_towards_zero_and_zero_is_forward(duty: float, sent: str) -> None:
    bench = await Bench(ThunderBorgSettings(duty_limit=1.0, left="A")).opened()
    await bench.motors.drive(WheelCommand(duty, 0.0))
    assert bench.sent()[-2:] == [sent, "0B 00"]


@virtual
async def test_a_reversed_side_is_told_the_other_direction() -> None:
    bench = await Bench(ThunderBorgSettings(reverse_left=True)).opened()
    applied = await bench.motors.drive(WheelCommand(1.0, 1.0))
    assert bench.sent()[-2:] == ["0C F2", "08 F2"]
    assert applied.left == applied.right > 0.99
    assert bench.world.commanded == applied


@virtual
async def test_opening_asks_who_it_is_arms_the_failsafe_reads_it_back_and_stands_still() -> None:
    bench = Bench()
    await bench.motors.open()
    assert bench.sent() == ["99", "14", "13 01", "14", "0B 00", "08 00"]
    assert bench.chip.failsafe


@virtual
async def test_stop_and_halt_switch_both_motors_off() -> None:
    bench = await Bench().opened()
    for stop in (bench.motors.stop, bench.motors.halt):
        await bench.motors.drive(WheelCommand(0.5, 0.5))
        assert bench.world.commanded != STOP
        if (waiting := stop()) is not None:
            await waiting
        assert bench.sent()[-1] == "0E 00"
        assert bench.world.commanded == STOP


@given(
    command=st.builds(WheelCommand, DUTIES, DUTIES),
    limit=st.floats(0.1, 1.0),
    left=st.sampled_from(("A", "B")),
    reverse_left=st.booleans(),
    reverse_right=st.booleans(),
)
@settings(deadline=None)
@virtual
async def test_what_is_applied_is_what_the_wheels_get_and_at_most_what_was_asked(
    command: WheelCommand, limit: float, left: Literal["A", "B"], reverse_left: bool, reverse_right: bool
) -> None:
    bench = await Bench(ThunderBorgSettings("/dev/i2c-1", ADDRESS, limit, left, reverse_left, reverse_right)).opened()
    applied = await bench.motors.drive(command)
    assert await bench.motors.read_back() == applied
    await check_applied(bench.motors, bench.world, command, 255 * limit)


@virtual
async def test_duties_beyond_full_are_full_and_what_is_no_number_reaches_no_motor() -> None:
    bench = await Bench().opened()
    await check_strange_duties(bench.motors, bench.sent)


# -- the deadman -----------------------------------------------------------------------------------------------------


@virtual
async def test_silence_stops_the_wheels_and_reads_back_as_zero() -> None:
    bench = Bench()
    await bench.motors.open()
    applied = await bench.motors.drive(WheelCommand(0.5, 0.5))
    await asyncio.sleep(0.2)
    assert await bench.motors.read_back() == applied
    await asyncio.sleep(0.06)
    assert await bench.motors.read_back() == STOP
    assert bench.world.commanded == STOP


@virtual
async def test_the_deadman_that_is_told_is_the_time_after_which_the_board_stops_the_wheels() -> None:
    bench = Bench()
    await bench.motors.open()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    driven_s = now_s()
    while bench.world.commanded != STOP:
        await asyncio.sleep(0.005)
        bench.chip.tick()
    assert now_s() - driven_s == pytest.approx(0.25, abs=0.01)
    assert bench.motors.deadman_s == ThunderBorgSettings().deadman_s == 0.25


@virtual
async def test_a_failsafe_that_arms_at_the_fifth_try_is_armed() -> None:
    bench = Bench()
    bench.cable.failsafes_lost = 4
    await bench.motors.open()
    assert bench.chip.failsafe


@virtual
async def test_noise_on_reading_the_failsafe_back_is_one_try_of_five() -> None:
    bench = Bench()
    before = 1  # open asks whether the failsafe is still on
    bench.cable.garbled[20] = (before + 4) * 3
    await bench.motors.open()
    assert bench.chip.failsafe
    bench.cable.garbled[20] = (before + 5) * 3
    with pytest.raises(NotResponding, match="the failsafe does not arm"):
        await bench.motors.open()


@virtual
async def test_a_failsafe_that_does_not_arm_refuses_to_open() -> None:
    bench = Bench()
    bench.cable.failsafes_lost = 5
    with pytest.raises(NotResponding, match="ThunderBorg at 0x15 on /dev/i2c-1: the failsafe does not arm"):
        await bench.motors.open()


@virtual
async def test_a_board_that_lost_its_power_turns_no_wheel_until_it_is_opened_again() -> None:
    bench = await Bench().opened()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    bench.chip.power_cycle()
    for _ in range(2):
        with pytest.raises(PowerLost, match="ThunderBorg at 0x15 on /dev/i2c-1: lost its power for a moment"):
            await bench.motors.drive(WheelCommand(0.5, 0.5))
        assert bench.world.commanded == STOP
    assert bench.chip.failsafe, "and its deadman is on again"
    await bench.motors.drive(STOP)
    await bench.motors.open()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.world.commanded != STOP
    assert bench.motors.troubles["power lost"] == 1


@virtual
async def test_a_loss_of_power_that_the_health_poll_finds_is_a_fault_only_of_a_rover_that_drives() -> None:
    bench = await Bench().opened()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    bench.chip.power_cycle()
    for _ in range(2):  # the drive fault flags that are up after power-up count for nothing
        assert (await bench.motors.health()).faults == ()
    assert bench.chip.failsafe
    with pytest.raises(PowerLost):
        await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.world.commanded == STOP


@virtual
async def test_a_board_that_starts_between_two_tries_of_a_command_turns_no_wheel() -> None:
    bench = await Bench().opened()
    bench.cable.restarts_at = b"\x0b\x79"  # the left side's command, after the failsafe was read
    with pytest.raises(PowerLost):
        await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.world.commanded == STOP
    assert bench.chip.failsafe


@pytest.mark.parametrize("suspended_at", ["14", "0B 79", "08 79"])
@virtual
async def test_a_command_amid_which_the_process_was_suspended_turns_no_wheel_afterwards(suspended_at: str) -> None:
    bench = await Bench().opened()
    write = bench.cable.write
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)

    def write_slowly(data: bytes) -> None:
        write(data)
        if data.hex(" ").upper() == suspended_at:
            loop.stall(3.0)

    bench.cable.write = write_slowly  # type: ignore[method-assign]
    assert await bench.motors.drive(WheelCommand(0.5, 0.5)) == STOP
    assert bench.world.commanded == STOP
    sent = bench.sent()
    assert sent[sent.index(suspended_at) + 1 :] == ["0E 00"]


@virtual
async def test_a_write_that_failed_late_is_not_tried_again() -> None:
    bench = await Bench().opened()
    tries = 0
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)

    def fail_late(data: bytes) -> None:
        nonlocal tries
        tries += 1
        loop.stall(0.2)
        raise NotResponding("/dev/i2c-1: no end of a transfer")

    bench.cable.write = fail_late  # type: ignore[method-assign]
    with pytest.raises(NotResponding, match="no answer in time"):
        await bench.motors.drive(STOP)
    assert tries == 1


@virtual
async def test_one_wrong_byte_is_no_loss_of_power() -> None:
    bench = await Bench().opened()
    read, said = bench.cable.read, [b"\x14\x00"]

    def read_wrongly_once(count: int) -> bytes:
        reply = read(count)
        return said.pop().ljust(count) if reply[0] == 0x14 and said else reply

    bench.cable.read = read_wrongly_once  # type: ignore[method-assign]
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert said == []
    assert bench.world.commanded != STOP


@virtual
async def test_a_failsafe_that_cannot_be_read_for_noise_is_switched_on_again_and_the_rover_drives() -> None:
    bench = await Bench().opened()
    bench.chip.failsafe = False
    bench.cable.garbled[20] = 3
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.chip.failsafe
    assert bench.world.commanded != STOP


@virtual
async def test_a_failsafe_that_does_not_arm_is_a_fault_of_the_board() -> None:
    bench = await Bench().opened()
    bench.chip.power_cycle()
    bench.cable.failsafes_lost = 5
    (fault,) = (await bench.motors.health()).faults
    assert "the failsafe does not arm" in fault


# -- when the wire is bad --------------------------------------------------------------------------------------------


@virtual
async def test_two_missing_acknowledgements_are_made_good_and_three_are_told() -> None:
    bench = await Bench().opened()
    bench.cable.loose = 2
    assert (await bench.motors.drive(WheelCommand(0.5, 0.5))).left > 0.49
    bench.cable.loose = 3
    with pytest.raises(NotResponding, match=r"ThunderBorg at 0x15 .* no answer .* battery off or flat"):
        await bench.motors.drive(STOP)


@virtual
async def test_transfers_that_were_tried_again_are_counted() -> None:
    bench = await Bench().opened()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.motors.troubles == {"transfers retried": 0, "power lost": 0}
    bench.cable.loose = 2
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    bench.cable.garbled = {21: 1}
    await bench.motors.health()
    assert bench.motors.troubles == {"transfers retried": 3, "power lost": 0}


@virtual
async def test_stop_keeps_trying_and_never_raises() -> None:
    bench = await Bench().opened()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    bench.cable.loose = 2
    await bench.motors.stop()
    assert bench.world.commanded == STOP
    bench.cable.loose = 1000
    await bench.motors.stop()


@virtual
async def test_an_answer_to_something_else_is_asked_for_again_and_then_refused() -> None:
    bench = Bench()
    await bench.motors.open()
    bench.cable.garbled[13] = 2
    assert await bench.motors.read_back() == STOP
    bench.cable.garbled[13] = 3
    with pytest.raises(BadReading, match="asked 0x0D, answered to 0x07; noise on the wires"):
        await bench.motors.read_back()


@virtual
async def test_another_part_at_the_address_is_named() -> None:
    bench = Bench()
    bench.cable.answers[153] = b"\x2a"
    for part in (bench.motors, bench.light):
        with pytest.raises(WrongPart, match=r"expected a ThunderBorg \(id 0x15\), got id 0x2A"):
            await part.open()
    bench.cable.garbled[153] = 6
    for part in (bench.motors, bench.light):
        with pytest.raises(WrongPart, match="no echo of the request"):
            await part.open()


@virtual
async def test_a_direction_that_is_none_is_not_taken_for_zero() -> None:
    bench = Bench()
    bench.cable.answers[13] = b"\x03\x64"
    with pytest.raises(BadReading, match="motor B says direction 3"):
        await bench.motors.read_back()


# -- health ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("volts", "told_v"), [(12.0, 11.994), (14.0, 14.016), (36.3, 36.3)])
@virtual
async def test_the_battery_is_told_in_the_boards_steps(volts: float, told_v: float) -> None:
    bench = Bench()
    bench.chip.volts = volts
    assert (await bench.motors.health()).battery_v == pytest.approx(told_v, abs=5e-4)


@virtual
async def test_a_voltage_beyond_the_scale_is_refused() -> None:
    bench = Bench()
    bench.cable.answers[21] = b"\x04\x00"
    with pytest.raises(BadReading, match="battery reads 1024"):
        await bench.motors.health()


@virtual
async def test_drive_faults_count_once_both_motors_have_been_driven() -> None:
    bench = Bench()
    await bench.motors.open()
    bench.chip.drive_faults.add(0)
    assert (await bench.motors.health()).faults == ()
    await bench.motors.drive(WheelCommand(0.3, 0.0))
    assert (await bench.motors.health()).faults == ()
    await bench.motors.drive(WheelCommand(0.0, 0.3))
    (fault,) = (await bench.motors.health()).faults
    assert fault.startswith("motor A (right): drive fault: under-voltage, a short or overheating")
    bench.chip.power_cycle()
    await bench.motors.open()
    assert (await bench.motors.health()).faults == ()


@virtual
async def test_a_drive_fault_outlives_an_opening_and_noise_but_no_loss_of_power() -> None:
    bench = Bench()
    await bench.motors.open()
    await bench.motors.drive(WheelCommand(0.3, 0.3))
    bench.chip.drive_faults.add(0)
    for bench.cable.garbled[20] in (0, 3):
        await bench.motors.open()
        assert "motor A (right): drive fault" in (await bench.motors.health()).faults[0]
    bench.chip.power_cycle()
    await bench.motors.open()
    assert (await bench.motors.health()).faults == ()


# -- life cycle ------------------------------------------------------------------------------------------------------


@virtual
async def test_it_keeps_what_motors_promise() -> None:
    def unreachable() -> ThunderBorg:
        return ThunderBorg(ThunderBorgSettings(), FakeBuses())

    assert isinstance(Bench().motors, DriveMotors)
    await check_motors(lambda: Bench().motors, unreachable)


@virtual
async def test_a_board_that_is_not_there_is_told_with_bus_and_address() -> None:
    motors = ThunderBorg(ThunderBorgSettings("/dev/i2c-3", 0x20), FakeBuses())
    with pytest.raises(NotResponding, match=r"ThunderBorg at 0x20 on /dev/i2c-3: .*check the board's power switch"):
        await motors.open()


@pytest.mark.parametrize("wrong", [{"address": 0x78}, {"address": 2}, {"duty_limit": 0.0}, {"left": "C"}])
def test_settings_that_no_board_has_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(ThunderBorgSettings).validate_python(wrong)


# -- light -----------------------------------------------------------------------------------------------------------


@virtual
async def test_the_light_takes_the_leds_from_the_battery_display_and_shows_both_in_one_colour() -> None:
    bench = Bench()
    assert isinstance(bench.light, StatusLight)
    await bench.light.open()
    await bench.light.show(PURPLE)
    assert bench.sent() == ["99", "06 00", "05 FF 00 FF", "05 FF 00 FF"]
    assert bench.chip.colours == [(255, 0, 255), (255, 0, 255)]


@virtual
async def test_the_light_speaks_only_when_the_colour_changes() -> None:
    bench = Bench()
    await bench.light.open()
    await bench.light.show(PURPLE)
    bench.sent()
    await bench.light.show(PURPLE)
    assert bench.sent() == []
    await bench.light.show(Colour(0.0, 0.5, 0.001))
    assert bench.chip.colours[0] == (0, 128, 0)


@virtual
async def test_a_light_that_was_lost_shows_its_colour_again() -> None:
    bench = Bench()
    await bench.light.open()
    bench.cable.loose = 3
    with pytest.raises(NotResponding, match="no answer"):
        await bench.light.show(PURPLE)
    await bench.light.show(PURPLE)
    bench.chip.power_cycle()
    await bench.light.open()
    await bench.light.show(PURPLE)
    assert bench.chip.colours == [(255, 0, 255), (255, 0, 255)]


@virtual
async def test_a_light_closes_twice_and_after_no_opening() -> None:
    bench = Bench()
    await bench.light.close()
    await bench.light.open()
    await bench.light.close()
    await bench.light.close()
    await bench.light.open()
    await bench.light.show(PURPLE)
    assert bench.chip.colours == [(255, 0, 255), (255, 0, 255)]


class HaltsBetween(ThunderBorg):
    """Somebody halts it between the writes of its two sides."""

    async def _set(self, motor: _Motor, level: int) -> None:
        await super()._set(motor, level)
        if level and motor is self._left:
            self.halt()


@virtual
async def test_halt_that_comes_amid_a_drive_command_wins() -> None:
    bench = Bench()
    motors = HaltsBetween(ThunderBorgSettings(), bench.buses)
    await motors.open()
    assert await motors.drive(WheelCommand(0.5, 0.5)) == STOP
    assert bench.world.commanded == STOP
