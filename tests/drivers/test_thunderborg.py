"""The ThunderBorg driver says the board's own words, and hears when the board does not mean what it wants."""

from __future__ import annotations

from typing import Any

import pytest

from tests.kit.boards import ThunderBorgBench, stall
from tests.virtual import virtual
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.errors import BadReading, NotResponding, PowerLost, WrongPart
from wayfarer.hal import STOP, Colour, StatusLight, WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.testing import check_status_light

AHEAD = WheelCommand(0.5, 0.5)
PURPLE = Colour(1.0, 0.0, 1.0)

# -- what goes over the wire -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "command", "sent"),
    [
        ({}, WheelCommand(0.5, -1.0), ["14", "0B 79", "09 F2"]),
        ({}, STOP, ["0B 00", "08 00"]),  # a stop asks for nothing first
        ({"duty_limit": 1.0}, WheelCommand(0.5, -0.5), ["14", "0B 7F", "09 7F"]),
        ({"duty_limit": 1.0, "left": "A"}, WheelCommand(1.0, 0.0), ["14", "08 FF", "0B 00"]),
        ({"reverse_left": True}, WheelCommand(1.0, 1.0), ["14", "0C F2", "08 F2"]),
    ],
)
@virtual
async def test_driving_asks_for_the_failsafe_and_writes_the_left_motor_then_the_right_one(
    settings: dict[str, Any], command: WheelCommand, sent: list[str]
) -> None:
    bench = await ThunderBorgBench(**settings).opened()
    await bench.motors.drive(command)
    assert bench.sent() == sent


@virtual
async def test_opening_asks_who_it_is_arms_the_failsafe_reads_it_back_and_stands_still() -> None:
    bench = ThunderBorgBench()
    await bench.motors.open()
    assert bench.sent() == ["99", "14", "13 01", "14", "0B 00", "08 00"]
    assert bench.chip.failsafe


# -- the deadman -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lost", "unread", "arms"),
    [(4, 0, True), (5, 0, False), (0, 4, True), (0, 5, False)],  # switched on in vain, or not read back for noise
)
@virtual
async def test_the_failsafe_has_five_tries_to_arm(lost: int, unread: int, arms: bool) -> None:
    bench = ThunderBorgBench()
    bench.failsafes_lost, bench.garbled[20] = lost, 3 * (1 + unread)  # open asks first whether it is still on
    if not arms:
        with pytest.raises(NotResponding, match="ThunderBorg at 0x15 on /dev/i2c-1: the failsafe does not arm"):
            await bench.motors.open()
        return
    await bench.motors.open()
    assert bench.chip.failsafe


@virtual
async def test_a_board_that_lost_its_power_turns_no_wheel_until_it_is_opened_again() -> None:
    bench = await ThunderBorgBench().opened()
    await bench.motors.drive(AHEAD)
    bench.chip.power_cycle()
    for _ in range(2):
        with pytest.raises(PowerLost, match="ThunderBorg at 0x15 on /dev/i2c-1: lost its power for a moment"):
            await bench.motors.drive(AHEAD)
        assert bench.world.commanded == STOP
    assert bench.chip.failsafe, "and its deadman is on again"
    await bench.motors.drive(STOP)
    await bench.motors.open()
    await bench.motors.drive(AHEAD)
    assert bench.world.commanded != STOP
    assert bench.motors.error_counts["power lost"] == 1


@virtual
async def test_a_loss_of_power_that_the_health_poll_finds_is_a_fault_only_of_a_rover_that_drives() -> None:
    bench = await ThunderBorgBench().opened()
    await bench.motors.drive(AHEAD)
    bench.chip.power_cycle()
    for _ in range(2):  # the drive fault flags that are up after power-up count for nothing
        assert (await bench.motors.health()).faults == ()
    assert bench.chip.failsafe
    with pytest.raises(PowerLost):
        await bench.motors.drive(AHEAD)
    assert bench.world.commanded == STOP


@virtual
async def test_a_board_that_starts_between_two_tries_of_a_command_turns_no_wheel() -> None:
    bench = await ThunderBorgBench().opened()
    bench.restarts_at = b"\x0b\x79"  # the left side's command, after the failsafe was read
    with pytest.raises(PowerLost):
        await bench.motors.drive(AHEAD)
    assert bench.world.commanded == STOP
    assert bench.chip.failsafe


@pytest.mark.parametrize("suspended_at", ["14", "0B 79", "08 79"])
@virtual
async def test_a_command_amid_which_the_process_was_suspended_turns_no_wheel_afterwards(suspended_at: str) -> None:
    bench = await ThunderBorgBench().opened()
    write = bench.write

    def write_slowly(data: bytes) -> None:
        write(data)
        if data.hex(" ").upper() == suspended_at:
            stall(3.0)

    bench.write = write_slowly  # type: ignore[method-assign]
    assert await bench.motors.drive(AHEAD) == STOP
    assert bench.world.commanded == STOP
    sent = bench.sent()
    assert sent[sent.index(suspended_at) + 1 :] == ["0E 00"]


@virtual
async def test_a_write_that_failed_late_is_not_tried_again() -> None:
    bench = await ThunderBorgBench().opened()
    tries = []

    def fail_late(data: bytes) -> None:
        tries.append(data)
        stall(0.2)
        raise NotResponding("/dev/i2c-1: no end of a transfer")

    bench.write = fail_late  # type: ignore[method-assign]
    with pytest.raises(NotResponding, match="no answer in time"):
        await bench.motors.drive(STOP)
    assert len(tries) == 1


@virtual
async def test_one_wrong_byte_is_no_loss_of_power() -> None:
    bench = await ThunderBorgBench().opened()
    read, said = bench.read, [b"\x14\x00"]

    def read_wrongly_once(count: int) -> bytes:
        reply = read(count)
        return said.pop().ljust(count) if reply[0] == 0x14 and said else reply

    bench.read = read_wrongly_once  # type: ignore[method-assign]
    await bench.motors.drive(AHEAD)
    assert said == []
    assert bench.world.commanded != STOP


@virtual
async def test_a_failsafe_that_cannot_be_read_for_noise_is_switched_on_again_and_the_rover_drives() -> None:
    bench = await ThunderBorgBench().opened()
    bench.chip.failsafe = False
    bench.garbled[20] = 3
    await bench.motors.drive(AHEAD)
    assert bench.chip.failsafe
    assert bench.world.commanded != STOP


@virtual
async def test_a_failsafe_that_does_not_arm_is_a_fault_of_the_board() -> None:
    bench = await ThunderBorgBench().opened()
    bench.chip.power_cycle()
    bench.failsafes_lost = 5
    (fault,) = (await bench.motors.health()).faults
    assert "the failsafe does not arm" in fault


# -- when the wire is bad --------------------------------------------------------------------------------------------


@virtual
async def test_two_missing_acknowledgements_are_made_good_and_counted_and_three_are_told() -> None:
    bench = await ThunderBorgBench().opened()
    assert bench.motors.error_counts == {"transfers retried": 0, "power lost": 0}
    bench.loose = 2
    assert (await bench.motors.drive(AHEAD)).left > 0.49
    bench.garbled = {21: 1}
    await bench.motors.health()
    assert bench.motors.error_counts == {"transfers retried": 3, "power lost": 0}
    bench.loose = 3
    with pytest.raises(NotResponding, match=r"ThunderBorg at 0x15 .* no answer .* battery off or flat"):
        await bench.motors.drive(STOP)


@virtual
async def test_stop_keeps_trying_and_never_raises() -> None:
    bench = await ThunderBorgBench().opened()
    await bench.motors.drive(AHEAD)
    bench.loose = 2
    await bench.motors.stop()
    assert bench.world.commanded == STOP
    bench.loose = 1000
    await bench.motors.stop()


@virtual
async def test_an_answer_to_something_else_is_asked_for_again_and_then_refused() -> None:
    bench = await ThunderBorgBench().opened()
    bench.garbled[13] = 2
    assert await bench.motors.read_back() == STOP
    bench.garbled[13] = 3
    with pytest.raises(BadReading, match="asked 0x0D, answered to 0x07; noise on the wires"):
        await bench.motors.read_back()


@virtual
async def test_another_part_at_the_address_is_named() -> None:
    bench = ThunderBorgBench()
    bench.answers[153] = b"\x2a"
    for part in (bench.motors, bench.light):
        with pytest.raises(WrongPart, match=r"expected a ThunderBorg \(id 0x15\), got id 0x2A"):
            await part.open()
    bench.garbled[153] = 6
    for part in (bench.motors, bench.light):
        with pytest.raises(WrongPart, match="no echo of the request"):
            await part.open()


@pytest.mark.parametrize(
    ("command", "answer", "said"),
    [(13, b"\x03\x64", "motor B reports direction 3"), (21, b"\x04\x00", "battery reads 1024")],
)
@virtual
async def test_an_answer_that_cannot_be_true_is_refused(command: int, answer: bytes, said: str) -> None:
    bench = ThunderBorgBench()
    bench.answers[command] = answer
    with pytest.raises(BadReading, match=said):
        await (bench.motors.read_back() if command == 13 else bench.motors.health())


# -- health ----------------------------------------------------------------------------------------------------------


@virtual
async def test_drive_faults_count_once_both_motors_have_been_driven() -> None:
    bench = await ThunderBorgBench().opened()
    bench.chip.drive_faults.add(0)
    assert (await bench.motors.health()).faults == ()
    await bench.motors.drive(WheelCommand(0.3, 0.0))
    assert (await bench.motors.health()).faults == ()
    await bench.motors.drive(WheelCommand(0.0, 0.3))
    (fault,) = (await bench.motors.health()).faults
    assert fault.startswith("motor A (right): drive fault: under-voltage, a short or overheating")


@virtual
async def test_a_drive_fault_outlives_an_opening_and_noise_but_no_loss_of_power() -> None:
    bench = await ThunderBorgBench().opened()
    await bench.motors.drive(WheelCommand(0.3, 0.3))
    bench.chip.drive_faults.add(0)
    for bench.garbled[20] in (0, 3):
        await bench.motors.open()
        assert "motor A (right): drive fault" in (await bench.motors.health()).faults[0]
    bench.chip.power_cycle()
    await bench.motors.open()
    assert (await bench.motors.health()).faults == ()


# -- life cycle ------------------------------------------------------------------------------------------------------


@virtual
async def test_a_board_that_is_not_there_is_told_with_bus_and_address() -> None:
    motors = ThunderBorg(ThunderBorgSettings("/dev/i2c-3", 0x20), FakeBuses())
    with pytest.raises(NotResponding, match=r"ThunderBorg at 0x20 on /dev/i2c-3: .*check the board's power switch"):
        await motors.open()


# -- light -----------------------------------------------------------------------------------------------------------


@virtual
async def test_the_light_takes_the_leds_from_the_battery_display_and_shows_both_in_one_colour() -> None:
    bench = ThunderBorgBench()
    assert isinstance(bench.light, StatusLight)
    await check_status_light(lambda: ThunderBorgBench().light)
    await bench.light.open()
    await bench.light.show(PURPLE)
    assert bench.sent() == ["99", "06 00", "05 FF 00 FF", "05 FF 00 FF"]
    assert bench.chip.colours == [(255, 0, 255), (255, 0, 255)]


@virtual
async def test_the_light_speaks_only_when_the_colour_changes() -> None:
    bench = ThunderBorgBench()
    await bench.light.open()
    await bench.light.show(PURPLE)
    bench.sent()
    await bench.light.show(PURPLE)
    assert bench.sent() == []
    await bench.light.show(Colour(0.0, 0.5, 0.001))
    assert bench.chip.colours[0] == (0, 128, 0)


@virtual
async def test_a_light_that_was_lost_shows_its_colour_again() -> None:
    bench = ThunderBorgBench()
    await bench.light.open()
    bench.loose = 3
    with pytest.raises(NotResponding, match="no answer"):
        await bench.light.show(PURPLE)
    await bench.light.show(PURPLE)
    bench.chip.power_cycle()
    await bench.light.open()
    await bench.light.show(PURPLE)
    assert bench.chip.colours == [(255, 0, 255), (255, 0, 255)]
