"""The BNO055 driver, on its serial line and on I2C, believes what can be true and notices that the part forgot."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.boards import now_s
from tests.simhal.chips.bench import Held
from tests.virtual import run_virtually, virtual
from wayfarer.angles import wrap180
from wayfarer.drivers.bno055 import BNO055, OPEN_S, BNO055Settings, decode, flaw
from wayfarer.errors import BadReading, NotResponding, PowerLost, WrongPart
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.bno055 import AXES, BOOT_S, MODE, NDOF, NDOF_FMC_OFF, OFFSETS, UNITS, BNO055Chip
from wayfarer.testing import check_compass

Trouble = Callable[[bytes], bytes]

# Worked out by hand from the data sheet: heading 173.0, w 0.7071 and z -0.7071, gravity -1.70, 0, 9.66, levels 0 3 3 0.
USUAL = bytes.fromhex(
    "D0 0A 00 00 00 00  41 2D 00 00 00 00 BF D2  00 00 00 00 00 00  56 FF 00 00 C6 03  15 3C 0F 00 00 05 00 00"
    "00 0C 00 00 01 24 00"
)
I2C, UART = "/dev/i2c-1", "/dev/serial0"
both = pytest.mark.parametrize("line", [I2C, UART])


class Troubled(BNO055Chip):
    """Some of the next answers of more than ``from_bytes`` bytes are corrupted."""

    troubles: tuple[Trouble, ...] = ()
    from_bytes = 40

    def _read(self, register: int, count: int) -> bytes:
        answer = super()._read(register, count)
        if count >= self.from_bytes and self.troubles:
            trouble, *rest = self.troubles
            self.troubles = tuple(rest)
            return trouble(answer)
        return answer


class Bench:
    """A chip on one of both lines, and the driver that speaks to it."""

    def __init__(self, line: str = I2C, attitude: tuple[int, int, int] = (1730, -50, 100), **settings: Any) -> None:
        given = BNO055Settings(port=line if line == UART else "", **settings)
        self.sense = Held(*attitude)
        self.chip = Troubled(self.sense, now_s)
        buses = FakeBuses()
        if line == UART:
            buses.serial(line).attach(self.chip)
        else:
            buses.i2c(given.bus).attach(given.address, self.chip)
        self.compass = BNO055(given, buses)

    async def opened(self) -> BNO055:
        await self.compass.open()
        return self.compass


def with_bytes(position: int, *values: int) -> Trouble:
    return lambda answer: answer[:position] + bytes(values) + answer[position + len(values) :]


def shifted(bits: int) -> Trouble:
    return lambda answer: (int.from_bytes(answer, "big") << bits).to_bytes(len(answer) + 2, "big")[2:]


def lost(_: bytes) -> bytes:
    raise NotResponding("no acknowledgement")


# -- decoding --------------------------------------------------------------------------------------------------------


def test_usual_block_is_decoded() -> None:
    block = decode(USUAL)
    assert flaw(block) is None
    assert (block.heading, block.quaternion, block.levels) == (173 * 16, (11585, 0, 0, -11585), (0, 3, 3, 0))
    assert block.settings == (0x00, 0x0C, 0x00, 0x24, 0x00)
    assert block.tilt_deg == pytest.approx((0.0, 9.98), abs=0.01)


@pytest.mark.parametrize(
    ("block", "why"),
    [
        (with_bytes(0, 0x81, 0x16)(USUAL), "heading 360.1 is beyond 360"),
        (with_bytes(0, 0xFF, 0xFF)(USUAL), "heading 4095.9 is beyond 360"),
        (with_bytes(7, 0x2F)(USUAL), "its quaternion has the length 1.02"),
        (with_bytes(6, *bytes(8))(USUAL), "its quaternion has the length 0.00"),
        (with_bytes(25, 0x04)(USUAL), "its gravity is 12.3 m/s²"),
        (with_bytes(31, 0x01, 0x09)(USUAL), "its fusion does not run: status 1, error 9 (the fusion's configuration"),
        (with_bytes(31, 0x06, 0x00)(USUAL), "its fusion does not run: status 6, error 0 (none)"),
        (bytes(41), "its fusion does not run: status 0"),
        (b"\xff" * 41, "its fusion does not run: status 255, error 255 (0xFF)"),
    ],
)
def test_what_cannot_be_true_is_told(block: bytes, why: str) -> None:
    assert str(flaw(decode(block))).startswith(why)


@given(st.integers(0, 3599), st.integers(-890, 890), st.integers(-1800, 1800), st.integers(1, 16))
def test_what_the_chip_says_can_be_true_and_shifted_by_bits_it_cannot(
    heading: int, pitch: int, roll: int, bits: int
) -> None:
    chip = BNO055Chip(Held(heading, pitch, roll), lambda: 1.0)
    chip.write(bytes((MODE, NDOF)))
    chip._clock = lambda: 2.0
    chip.write(b"\x1a")
    block = chip.read(41)
    assert flaw(decode(block)) is None
    assert flaw(decode(shifted(bits)(block))) is not None


# -- opening ---------------------------------------------------------------------------------------------------------


@both
def test_keeps_what_a_compass_promises(line: str) -> None:
    absent = BNO055Settings(port=line if line == UART else "")
    run_virtually(check_compass(lambda: Bench(line).compass, lambda: BNO055(absent, FakeBuses())))


@both
def test_opening_writes_all_settings_takes_one_sample_and_says_where_it_is(line: str) -> None:
    bench = Bench(line, placement="P0", mode="ndof_fmc_off")

    async def opened() -> None:
        await bench.opened()
        assert now_s() == pytest.approx(OPEN_S)

    run_virtually(opened())
    assert bench.chip.registers[UNITS] == 0x00
    assert bench.chip.registers[MODE] == NDOF_FMC_OFF
    assert bytes(bench.chip.registers[AXES : AXES + 2]) == b"\x21\x04"
    assert len(bench.sense.asked_s) == 1
    assert bench.compass.name == {I2C: "BNO055 at 0x28 on /dev/i2c-1", UART: "BNO055 on /dev/serial0"}[line]


@pytest.mark.parametrize(("line", "hint"), [(I2C, "PS1 and PS0 are low"), (UART, "TX is at RX.*PS1 was high")])
@virtual
async def test_nobody_there_names_the_place_and_the_wiring(line: str, hint: str) -> None:
    compass = BNO055(BNO055Settings(port=line if line == UART else ""), FakeBuses())
    with pytest.raises(NotResponding, match=rf"BNO055 .*{line}: no answer .*check power.*{hint}"):
        await compass.open()


@both
def test_another_part_is_told_and_nothing_is_written_to_it(line: str) -> None:
    bench = Bench(line)
    bench.chip.registers[0:4] = b"\xa0\xfb\x32\x10"
    as_it_was = bytes(bench.chip.registers[UNITS:])
    with pytest.raises(WrongPart, match="expected the identities a0 fb 32 0f of a BNO055, got a0 fb 32 10"):
        run_virtually(bench.opened())
    assert bytes(bench.chip.registers[UNITS:]) == as_it_was


@virtual
async def test_identity_that_was_garbled_once_is_read_again() -> None:
    bench = Bench()
    bench.chip.from_bytes, bench.chip.troubles = 4, (shifted(1),)
    await bench.compass.identify()


@both
def test_frozen_sensors_are_noticed(line: str) -> None:
    bench = Bench(line)
    bench.chip.frozen = True
    with pytest.raises(BadReading, match=r"its sensors send nothing new, they repeat .*; turn its power off and on"):
        run_virtually(bench.opened())


@virtual
async def test_fusion_that_does_not_start_is_told() -> None:
    bench = Bench()
    bench.chip.registers[0x69:0x6B] = bytes(2)
    with pytest.raises(BadReading, match=r"at 0x28 on /dev/i2c-1: .* status 1, error 9 \(the fusion's configuration"):
        await bench.opened()


@virtual
async def test_settings_that_are_not_taken_are_told() -> None:
    bench = Bench(placement="P0")
    bench.chip._set = lambda *_: None if _[0] == AXES else BNO055Chip._set(bench.chip, *_)  # type: ignore[method-assign]
    with pytest.raises(BadReading, match=r"its settings read 00 0C 00 24 04: bytes shifted .*wire its UART"):
        await bench.opened()


# -- reading ---------------------------------------------------------------------------------------------------------


@given(st.integers(0, 3599), st.integers(-890, 890), st.integers(-1799, 1799), st.sampled_from((I2C, UART)))
def test_attitude_comes_through_in_the_part_s_own_steps(heading: int, pitch: int, roll: int, line: str) -> None:
    bench = Bench(line, (heading, pitch, roll))

    async def read() -> Any:
        await bench.opened()
        return await bench.compass.read()

    t_s, heading_deg, pitch_deg, roll_deg, calibration = run_virtually(read())
    assert (t_s, calibration) == (OPEN_S, 3)
    assert 0.0 <= heading_deg < 360.0
    assert abs(wrap180(heading_deg - heading / 10)) <= 1 / 32
    assert pitch_deg == pytest.approx(pitch / 10, abs=0.1)
    sideways = abs(pitch) > 800  # nearly upright, roll is in few hundredths of gravity
    assert abs(wrap180(roll_deg - roll / 10)) < (3.0 if sideways else 0.3)


@virtual
async def test_heading_of_a_full_turn_is_zero() -> None:
    bench = Bench(attitude=(0, 0, 0))
    compass = await bench.opened()
    bench.chip.troubles = (with_bytes(0, 0x80, 0x16), with_bytes(0, 0x7F, 0x16))
    assert (await compass.read()).heading_deg == 0.0
    assert (await compass.read()).heading_deg == 359.9375


@pytest.mark.parametrize(
    ("mounting", "expected"),
    [
        ({}, (173.0, -5.0, 10.0)),
        ({"heading_offset_deg": -180.0}, (353.0, -5.0, 10.0)),
        ({"reverse_pitch": True}, (173.0, 5.0, 10.0)),
        ({"reverse_roll": True}, (173.0, -5.0, -10.0)),
        ({"swap_pitch_roll": True, "reverse_roll": True}, (173.0, 10.0, 5.0)),
    ],
)
@virtual
async def test_mounting_turns_heading_and_tilt(mounting: dict[str, Any], expected: tuple[float, float, float]) -> None:
    reading = await (await Bench(**mounting).opened()).read()
    assert (reading.heading_deg, reading.pitch_deg, reading.roll_deg) == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize(("levels", "told"), [(0x3C, 0), (0xFF, 3), (0x00, 0), (0x02, 2)])
@virtual
async def test_calibration_is_the_magnetometers(levels: int, told: int) -> None:
    bench = Bench()
    bench.chip.calibration = levels
    assert (await (await bench.opened()).read()).calibration == told


@pytest.mark.parametrize("trouble", [lost, shifted(8), shifted(1), lambda _: bytes(41), lambda _: b"\xff" * 41])
@virtual
async def test_one_lost_or_corrupt_block_is_asked_for_again(trouble: Trouble) -> None:
    bench = Bench()
    compass = await bench.opened()
    bench.chip.troubles = (trouble,)
    assert (await compass.read()).heading_deg == 173.0
    await compass.read()
    assert compass.error_counts == ({} if trouble is lost else {"reads retried": 1})


@pytest.mark.parametrize(
    ("troubles", "error", "text"),
    [
        ((lost, lost), NotResponding, "no acknowledgement"),
        ((shifted(8), shifted(8)), BadReading, "BNO055 at 0x28 on /dev/i2c-1: its fusion does not run"),
        ((with_bytes(0, 0xFF, 0xFF),) * 2, BadReading, "beyond 360: bytes .*stretches the I2C clock: wire its UART"),
        ((with_bytes(39, 0x21),) * 2, BadReading, "its settings read 00 0C 00 21 00: bytes shifted"),
    ],
)
@virtual
async def test_two_failures_in_a_row_are_an_error(
    troubles: tuple[Trouble, ...], error: type[Exception], text: str
) -> None:
    bench = Bench()
    compass = await bench.opened()
    bench.chip.troubles = troubles
    with pytest.raises(error, match=text):
        await compass.read()
    assert (await compass.read()).heading_deg == 173.0


@both
def test_part_that_lost_its_power_is_noticed_and_works_again_once_it_is_opened(line: str) -> None:
    bench = Bench(line, placement="P0")

    async def lose_power() -> None:
        compass = await bench.opened()
        bench.chip.power_cycle()
        with pytest.raises(NotResponding):
            await compass.read()
        await asyncio.sleep(BOOT_S)
        with pytest.raises(PowerLost, match="lost its power for a moment"):
            await compass.read()
        await compass.open()
        reading = await compass.read()
        assert (reading.heading_deg, reading.calibration) == (173.0, 0), "what it had learnt of the field is gone"

    run_virtually(lose_power())
    assert bytes(bench.chip.registers[AXES : AXES + 2]) == b"\x21\x04"


# -- calibration -----------------------------------------------------------------------------------------------------


@both
def test_offsets_that_it_learnt_are_told_and_written_again_after_a_loss_of_power(line: str) -> None:
    bench = Bench(line)
    learnt = bytes(range(1, 23))

    async def learn() -> str:
        compass = await bench.opened()
        bench.chip.registers[OFFSETS : OFFSETS + 22] = learnt
        told = await compass.offsets()
        assert (await compass.read()).heading_deg == 173.0, "its fusion runs again"
        return told

    told = run_virtually(learn())
    assert told == learnt.hex()
    again = Bench(line, offsets=told)
    run_virtually(again.opened())
    assert bytes(again.chip.registers[OFFSETS : OFFSETS + 22]) == learnt


@pytest.mark.parametrize("offsets", ["00" * 22, "01" * 20 + "0000", "01" * 21, "01" * 23, "lost"])
def test_offsets_that_would_stop_the_fusion_or_are_none_are_refused(offsets: str) -> None:
    with pytest.raises(ValueError, match=f"offsets '{offsets}'"):
        BNO055Settings(offsets=offsets)


@virtual
async def test_all_levels_are_told() -> None:
    bench = Bench()
    bench.chip.calibration = 0x39
    assert await (await bench.opened()).calibration() == (0, 3, 2, 1)


# -- the serial line -------------------------------------------------------------------------------------------------


@virtual
async def test_busy_part_is_asked_again_for_reads_and_for_writes() -> None:
    bench = Bench(UART)
    bench.chip.busy = 3
    compass = await bench.opened()  # three of four tries of the first read
    for command in range(1, 6):
        bench.chip.busy = command % 4
        await compass.open()
    bench.chip.busy = 4
    with pytest.raises(BadReading, match="BNO055 on /dev/serial0: it refuses: it is busy"):
        await compass.read()
    assert (await compass.read()).heading_deg == 173.0


@virtual
async def test_console_on_the_port_is_told_from_a_part() -> None:
    class Console:
        def receive(self, data: bytes) -> bytes:
            return b"raspberrypi login: "

    buses = FakeBuses()
    buses.serial(UART).attach(Console())
    with pytest.raises(BadReading, match=r"it answered 72 61 73 .*, which a BNO055 never sends; .*console"):
        await BNO055(BNO055Settings(port=UART), buses).open()


@virtual
async def test_answer_that_is_late_or_torn_is_asked_for_again() -> None:
    bench = Bench(UART)
    compass = await bench.opened()
    bench.chip.troubles = (lambda answer: answer[:20],)
    assert (await compass.read()).heading_deg == 173.0
