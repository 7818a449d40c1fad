"""The simulated BNO055 answers as its data sheet says, on both lines, and Adafruit's library understands it.

The bytes were worked out from the data sheet by hand; Adafruit's library decodes them as their comments say.
"""

from __future__ import annotations

from math import hypot
from struct import unpack
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.chips.bench import Clock, Held
from wayfarer.errors import NotResponding
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.bno055 import AXES, CONFIG, IMU, MODE, NDOF, OFFSETS, PAGE, TRIGGER, UNITS, BNO055Chip

ATTITUDES = (st.integers(0, 3599), st.integers(-890, 890), st.integers(-1800, 1800))


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def chip(clock: Clock) -> BNO055Chip:
    return BNO055Chip(Held(1730), clock)


def registers(chip: BNO055Chip, start: int, count: int) -> bytes:
    chip.write(bytes((start,)))
    return chip.read(count)


def fusing(chip: BNO055Chip, clock: Clock, mode: int = NDOF) -> BNO055Chip:
    chip.write(bytes((MODE, mode)))
    clock.t_s += 0.007
    return chip


# -- registers -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("attitude", "start", "block"),
    [
        ((1730, 0, 0), 0x1A, "D0 0A 00 00 00 00"),
        ((3599, -50, 50), 0x1A, "7E 16 50 00 50 00"),  # as in Android the pitch is turned round
        ((0, -125, -125), 0x1A, "00 00 38 FF C8 00"),
        ((900, 0, 0), 0x20, "41 2D 00 00 00 00 BF D2"),
        ((0, 0, 100), 0x2E, "56 FF 00 00 C6 03"),
        ((0, 0, 0), 0x2E, "00 00 00 00 D5 03"),
    ],
)
def test_fusion_is_as_in_the_data_sheet(attitude: tuple[int, int, int], start: int, block: str, clock: Clock) -> None:
    chip = fusing(BNO055Chip(Held(*attitude), clock), clock)
    expected = bytes.fromhex(block)
    assert registers(chip, start, len(expected)) == expected


@given(*ATTITUDES)
def test_quaternion_and_gravity_are_of_one_attitude(heading: int, pitch: int, roll: int) -> None:
    clock = Clock()
    block = registers(fusing(BNO055Chip(Held(heading, pitch, roll), clock), clock), 0x20, 20)
    w, x, y, z = (each / 16384 for each in unpack("<4h", block[:8]))
    down = unpack("<3h", block[14:])
    assert hypot(w, x, y, z) == pytest.approx(1.0, abs=2e-4)
    up = (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    assert [each / 981 for each in down] == pytest.approx(up, abs=2e-3)


def test_identities_state_and_what_is_set_at_power_up(chip: BNO055Chip, clock: Clock) -> None:
    assert registers(chip, 0x00, 4).hex(" ") == "a0 fb 32 0f"
    assert registers(chip, 0x39, 10).hex(" ") == "00 00 80 00 00 00 00 00 24 00"
    fusing(chip, clock)
    assert registers(chip, 0x35, 6).hex(" ") == "ff 0f 00 00 05 00"


def test_sensors_are_noisy_unless_they_are_frozen(chip: BNO055Chip, clock: Clock) -> None:
    fusing(chip, clock)
    assert registers(chip, 0x08, 18) != registers(chip, 0x08, 18)
    chip.frozen = True
    assert registers(chip, 0x08, 18) == registers(chip, 0x08, 18)


@pytest.mark.parametrize(("start", "count", "samples"), [(0x00, 8, 0), (0x08, 18, 0), (0x1A, 41, 1), (0x34, 1, 0)])
def test_one_sample_for_each_read_of_the_fusion(start: int, count: int, samples: int, clock: Clock) -> None:
    sense = Held()
    registers(fusing(BNO055Chip(sense, clock), clock), start, count)
    assert sense.asked_s == [clock.t_s] * samples


def test_settings_are_taken_in_the_mode_config_only_and_axes_only_if_they_are_three(
    chip: BNO055Chip, clock: Clock
) -> None:
    chip.write(bytes((AXES, 0x21, 0x04)))
    chip.write(bytes((AXES, 0x20)))  # x twice
    assert registers(chip, AXES, 2).hex(" ") == "21 04"
    fusing(chip, clock)
    chip.write(bytes((UNITS, 0x00)))
    assert registers(chip, UNITS, 1) == b"\x80"
    chip.write(bytes((MODE, CONFIG)))
    chip.write(bytes((UNITS, 0x00)))
    assert registers(chip, UNITS, 1) == b"\x80", "it takes 19 ms to get there"
    clock.t_s += 0.019
    chip.write(bytes((UNITS, 0x00)))
    assert registers(chip, UNITS, 1) == b"\x00"


def test_reset_makes_it_mute_and_it_forgets(chip: BNO055Chip, clock: Clock) -> None:
    chip.write(bytes((AXES, 0x21, 0x04)))
    fusing(chip, clock)
    chip.write(bytes((TRIGGER, 0x20)))
    with pytest.raises(NotResponding):
        registers(chip, 0x00, 1)
    assert chip.receive(b"\xaa\x01\x00\x01") == b""
    clock.t_s += 0.65
    assert registers(chip, 0x35, 14).hex(" ") == "00 0f 00 00 00 00 80 00 00 00 00 00 24 00"


def test_radius_of_zero_stops_the_fusion(chip: BNO055Chip, clock: Clock) -> None:
    chip.write(bytes((OFFSETS, *bytes(22))))
    assert registers(fusing(chip, clock), 0x39, 2) == bytes((1, 9))


@pytest.mark.parametrize("data", [b"", b"\x6b", b"\x00\x01", b"\x1a\x00\x00", b"\x3d\x01", b"\x3b\x04"])
def test_writes_that_it_does_not_know_are_refused(data: bytes, chip: BNO055Chip) -> None:
    with pytest.raises(ChipMisuse):
        chip.write(data)


def test_reads_beyond_the_page_are_refused(chip: BNO055Chip) -> None:
    chip.write(b"\x6a")
    with pytest.raises(ChipMisuse, match="read 2 bytes from 6a on page 0"):
        chip.read(2)


# -- the serial line -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("AA 01 00 01", "BB 01 A0"),
        ("AA 00 3D 01 0C", "EE 01"),
        ("AA 01 1A 06", "BB 06 D0 0A 00 00 00 00"),
        ("AA 01 6A 02", "EE 04"),
        ("AA 00 1A 01 00", "EE 05"),
        ("AA 01 00 00", "EE 09"),
        ("AA 01 00 81", "EE 08"),
        ("00 AA 01 00 01", "EE 06 BB 01 A0"),
    ],
)
@pytest.mark.parametrize("whole", [True, False])
def test_commands_on_the_serial_line(chip: BNO055Chip, clock: Clock, command: str, answer: str, whole: bool) -> None:
    fusing(chip, clock)
    data = bytes.fromhex(command)
    pieces = [data] if whole else [bytes((byte,)) for byte in data]
    assert b"".join(map(chip.receive, pieces)) == bytes.fromhex(answer)


def test_busy_chip_refuses_and_does_nothing(chip: BNO055Chip) -> None:
    chip.busy = 1
    assert chip.receive(bytes.fromhex("AA 00 3D 01 0C")) == b"\xee\x07"
    assert chip.receive(bytes.fromhex("AA 01 3D 01")) == b"\xbb\x01\x00"


# -- Adafruit's library ----------------------------------------------------------------------------------------------


class I2C:
    """The part of a busio bus that Adafruit's library uses."""

    def __init__(self, chip: BNO055Chip) -> None:
        self.chip = chip

    def try_lock(self) -> bool:
        return True

    def unlock(self) -> None:
        pass

    def _transfer(self, use: Any) -> Any:
        try:
            return use()
        except NotResponding as error:
            raise OSError(str(error)) from None

    def writeto(self, _address: int, data: Any, *, start: int = 0, end: int | None = None) -> None:
        sent = bytes(data[start:end])
        if sent:  # its probe writes nothing
            self._transfer(lambda: self.chip.write(sent))

    def writeto_then_readfrom(
        self, address: int, out: Any, into: Any, *, out_start: int = 0, out_end: int | None = None,
        in_start: int = 0, in_end: int | None = None,
    ) -> None:  # fmt: skip
        self.writeto(address, out, start=out_start, end=out_end)
        stop = len(into) if in_end is None else in_end
        into[in_start:stop] = self._transfer(lambda: self.chip.read(stop - in_start))


class Uart:
    """The part of a busio port that Adafruit's library uses."""

    baudrate = 9600

    def __init__(self, chip: BNO055Chip) -> None:
        self.chip, self._came = chip, b""

    @property
    def in_waiting(self) -> int:
        return len(self._came)

    def write(self, data: bytes) -> None:
        assert self.baudrate == 115_200
        self._came += self.chip.receive(data)

    def read(self, count: int) -> bytes:
        came, self._came = self._came[:count], self._came[count:]
        return came


@pytest.fixture(params=["i2c", "uart"])
def library(request: pytest.FixtureRequest, chip: BNO055Chip, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return Adafruit's driver of the chip, which it has reset."""
    adafruit = pytest.importorskip("adafruit_bno055", reason="Adafruit's library is not installed")

    def sleep(seconds: float) -> None:
        clock.t_s += seconds

    def monotonic() -> float:
        clock.t_s += 0.001
        return clock.t_s

    class Time:
        pass

    time = Time()
    time.sleep, time.monotonic = sleep, monotonic  # type: ignore[attr-defined]
    monkeypatch.setattr(adafruit, "time", time)
    return adafruit.BNO055_I2C(I2C(chip)) if request.param == "i2c" else adafruit.BNO055_UART(Uart(chip))


def test_adafruit_s_library_sets_it_up_and_reads_what_it_feels(library: Any, chip: BNO055Chip, clock: Clock) -> None:
    assert library.mode == NDOF
    assert library.euler == (173.0, 0.0, 0.0)
    assert library.gravity == pytest.approx((0.0, 0.0, 9.81))
    assert library.quaternion == pytest.approx((0.0610, 0.0, 0.0, -0.9981), abs=1e-4)
    assert library.acceleration == pytest.approx((0.0, 0.0, 9.81), abs=0.02)
    assert library.temperature == 21
    assert library.calibration_status == (0, 0, 0, 0), "it has reset the part"
    chip.calibration = 0x3C
    assert library.calibration_status == (0, 3, 3, 0)


def test_adafruit_s_library_changes_mode_and_offsets(library: Any, chip: BNO055Chip, clock: Clock) -> None:
    library.mode = IMU
    assert chip.registers[MODE] == IMU
    library.mode = CONFIG
    library.offsets_magnetometer = (-100, 7, 300)
    assert chip.registers[0x5B:0x61] == bytes.fromhex("9C FF 07 00 2C 01")
    assert library.offsets_magnetometer == (-100, 7, 300)
    assert library.radius_magnetometer == 480


def test_page_of_the_sensors_settings_hides_the_identity(chip: BNO055Chip) -> None:
    chip.write(bytes((PAGE, 1)))
    assert registers(chip, 0x00, 1) != b"\xa0"
    chip.write(bytes((PAGE, 0)))
    assert registers(chip, 0x00, 1) == b"\xa0"
