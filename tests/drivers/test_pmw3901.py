"""The PMW3901 driver starts its chip as the table says, tells unknown from still, and never waits for motion."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from struct import pack

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from tests.drivers.test_pmw3901_registers import DARK, LIMIT_COUNTS_S, NORMAL, STANDING
from tests.kit.boards import now_s
from tests.simhal.chips.bench import Driven
from tests.virtual import run_virtually, virtual
from wayfarer.drivers.pmw3901 import PMW3901, Axis, PMW3901Settings
from wayfarer.drivers.pmw3901_registers import FRAME_S, trim
from wayfarer.errors import BadReading, NotResponding, WrongPart
from wayfarer.hal import MotionSensor
from wayfarer.simhal.buses import FakeBuses, FakeSPI, SPIChip
from wayfarer.simhal.chips.pmw3901 import PMW3901Chip
from wayfarer.simhal.sensor_models import FLOW_M_PER_COUNT
from wayfarer.testing import check_motion_sensor


class Canned:
    """A chip that gives the same burst again and again and counts how often; its registers are those of a good one."""

    def __init__(self, burst: bytes) -> None:
        self.burst, self.bursts = burst, 0
        self.behind = PMW3901Chip(Driven(), now_s)

    def exchange(self, data: bytes) -> bytes:
        if data[0] != 0x16:
            return self.behind.exchange(data)
        self.bursts += 1
        return b"\0" + self.burst


class AtLimit(Canned):
    """A chip over ground that goes by as fast as it can see; each frame is counted when it has ended."""

    counted_to_s = 0.0

    def exchange(self, data: bytes) -> bytes:
        if data[0] == 0x16:
            frames, self.counted_to_s = int(now_s() / FRAME_S) - int(self.counted_to_s / FRAME_S), now_s()
            self.burst = NORMAL[:2] + pack("<hh", int(frames * FRAME_S * LIMIT_COUNTS_S), 0) + NORMAL[6:]
        return super().exchange(data)


class LateBus(FakeSPI):
    """A bus that takes its time to reach the chip, and to hand on what it said."""

    before_s = after_s = 0.0

    async def transfer(self, *pieces: bytes) -> tuple[bytes, ...]:
        await asyncio.sleep(self.before_s)
        answers = await super().transfer(*pieces)
        await asyncio.sleep(self.after_s)
        return answers


class Silent:
    """A line that something holds low."""

    def exchange(self, data: bytes) -> bytes:
        return bytes(len(data))


class Stopped(PMW3901Chip):
    """A chip that ignores the write it would start with."""

    def exchange(self, data: bytes) -> bytes:
        return bytes(2) if data == b"\xc0\x80" else super().exchange(data)


def flow_over(chip: SPIChip | None, settings: PMW3901Settings | None = None) -> PMW3901:
    """Return the driver over a bus with that chip, or with none."""
    buses, settings = FakeBuses(), settings or PMW3901Settings()
    if chip is not None:
        buses.spi(settings.bus).attach(chip)
    return PMW3901(settings, buses)


async def opened(chip: SPIChip, settings: PMW3901Settings | None = None) -> PMW3901:
    flow = flow_over(chip, settings)
    await flow.open()
    return flow


def writes_at_start(settings: PMW3901Settings | None = None, **factory: int) -> list[tuple[int, int]]:
    """Return the writes of one opening; ``factory`` names registers of bank 0E, such as ``r67``."""
    chip = PMW3901Chip(Driven(), now_s, factory={(0x0E, int(name[1:], 16)): value for name, value in factory.items()})
    run_virtually(flow_over(chip, settings).open())
    return list(chip.writes)


@pytest.mark.parametrize(
    ("rad_per_count", "mm", "counts_s"), [(0.00213195, 21.3, 3471), (0.00126, 12.6, 5873), (1 / 385, 26.0, 3471)]
)
def test_published_angles_give_the_way_of_100_counts_and_a_limit_never_below_the_data_sheets(
    rad_per_count: float, mm: float, counts_s: float
) -> None:
    settings = PMW3901Settings(rad_per_count=rad_per_count, height_m=0.1)
    assert 100 * settings.m_per_count * 1000 == pytest.approx(mm, abs=0.05)
    assert settings.limit_counts_s == pytest.approx(counts_s, abs=0.5)


LATE_S = st.floats(0.0, 0.2)


@given(st.lists(st.tuples(st.floats(0.001, 0.3), LATE_S, LATE_S), min_size=2, max_size=20))
@virtual
async def test_ground_at_the_speed_limit_is_never_garbage_however_late_bus_and_loop_are(
    reads: list[tuple[float, float, float]],
) -> None:
    """Each read is asked for after a pause, reaches the chip late, and is answered late."""

    buses = FakeBuses()
    bus = buses._spi["/dev/spidev0.1"] = LateBus("/dev/spidev0.1")
    bus.attach(AtLimit(NORMAL))
    flow = PMW3901(PMW3901Settings(), buses)
    await flow.open()
    for pause_s, bus.before_s, bus.after_s in reads:
        await asyncio.sleep(pause_s)
        await flow.read()
    assert flow.error_counts["impossible readings rejected"] == 0


# -- the start-up


def test_start_up_keeps_the_trims_of_a_chip_that_has_some() -> None:
    writes = writes_at_start(r73=0x01)
    assert not {0x70, 0x71} & {register for register, value in writes if value}
    assert (0x51, 0x70) not in writes
    assert len(writes) == len(writes_at_start()) - 6


@pytest.mark.parametrize(
    ("register_67", "led", "written"),
    [(0x80, True, (0x48, 0x04)), (0x7F, True, (0x48, 0x02)), (0x80, True, (0x6F, 0x1C)), (0x80, False, (0x6F, 0x00))],
)
def test_start_up_heeds_bit_7_of_register_67_and_the_led_setting(
    register_67: int, led: bool, written: tuple[int, int]
) -> None:
    assert written in writes_at_start(PMW3901Settings(led=led), r67=register_67)


@pytest.mark.parametrize(
    ("c1", "c1_written"), [(0, 14), (15, 29), (20, 34), (28, 42), (29, 40), (52, 0x3F), (53, 0x3F), (255, 0x3F)]
)
@pytest.mark.parametrize(("c2", "c2_written"), [(0, 0), (1, 0), (100, 0x2D), (255, 114)])
def test_first_trim_grows_by_one_rule_only_and_the_second_shrinks_to_45_percent(
    c1: int, c1_written: int, c2: int, c2_written: int
) -> None:
    assert trim(c1, c2) == ((0x70, c1_written), (0x71, c2_written))


@pytest.mark.parametrize(("needed", "written"), [(1, 1), (3, 3), (9, 3)])
@virtual
async def test_probe_is_repeated_three_times_at_most(needed: int, written: int) -> None:
    chip = PMW3901Chip(Driven(), now_s, probes_needed=needed)
    await flow_over(chip).open()
    assert chip.writes.count((0x43, 0x10)) == written


@pytest.mark.parametrize(("chip", "byte"), [(None, "0xFF"), (Silent(), "0x00")])
@virtual
async def test_silence_names_the_slots_and_the_command_that_switches_spi_on(chip: SPIChip | None, byte: str) -> None:
    said = f"PMW3901 on /dev/spidev0.1: only {byte} comes back.*back is /dev/spidev0.0.*raspi-config nonint do_spi 0"
    with pytest.raises(NotResponding, match=said):
        await flow_over(chip).open()


@pytest.mark.parametrize("factory", [{(0x00, 0x00): 0x42}, {(0x00, 0x5F): 0xBD}])
@virtual
async def test_another_chip_is_a_wrong_part(factory: dict[tuple[int, int], int]) -> None:
    with pytest.raises(WrongPart, match="expected product 0x49 and inverse 0xB6"):
        await flow_over(PMW3901Chip(Driven(), now_s, factory=factory)).open()


@virtual
async def test_chip_that_answers_and_does_not_run_is_refused() -> None:
    with pytest.raises(NotResponding, match="answers but does not run"):
        await flow_over(Stopped(Driven(), now_s)).open()


@pytest.mark.parametrize(("counts", "bank"), [(3000, 0x00), (1, 0x00), (0, 0x0E)])
@virtual
async def test_counts_from_before_an_opening_are_no_motion_also_where_one_broke_off_in_another_bank(
    counts: int, bank: int
) -> None:
    """More than a spike, and nearly nothing, are both no displacement since the reading before: there was none."""
    chip = PMW3901Chip(Driven((counts, 0), (8, 0)), now_s)
    chip.exchange(bytes((0xFF, bank)))
    flow = await opened(chip)
    assert (await flow.read()).quality == 0.0
    await asyncio.sleep(0.05)
    assert (await flow.read()).quality == 0.8


# -- reading


@virtual
async def test_reading_is_one_burst_that_does_not_wait_for_motion() -> None:
    chip = Canned(STANDING)
    flow = await opened(chip)
    await flow.read()
    await asyncio.sleep(0.05)
    asked_s = now_s()
    assert await flow.read() == (asked_s, 0.0, 0.0, 0.8, True)
    assert now_s() == asked_s
    assert chip.bursts == 2


@virtual
async def test_displacement_in_the_dark_is_unknown() -> None:
    flow = await opened(Canned(DARK))
    await flow.read()  # what moved since nobody knows when is unknown anyway
    await asyncio.sleep(0.05)
    assert (await flow.read()).quality == 0.0


@virtual
async def test_displacement_is_that_since_the_read_before() -> None:
    sense = Driven((100, -40), (-7, 3))
    flow = await opened(PMW3901Chip(sense, now_s))
    assert sense.asked_s == []
    readings = []
    for _ in range(3):
        await asyncio.sleep(0.05)
        readings.append((await flow.read())[1:3])
    assert readings == [
        pytest.approx((0.0213195, -0.0085278)),
        pytest.approx((-0.001492365, 0.000639585)),
        (0.0, 0.0),
    ]


@pytest.mark.parametrize(
    ("forward", "right", "mounting"),
    [
        ("-y", "+x", lambda forward, right: (right, -forward)),
        ("+x", "-y", lambda forward, right: (forward, -right)),
        ("-x", "+y", lambda forward, right: (-forward, right)),
        ("+y", "-x", lambda forward, right: (-right, forward)),
    ],
)
@virtual
async def test_mounting_is_undone_by_the_settings(
    forward: Axis, right: Axis, mounting: Callable[[int, int], tuple[int, int]]
) -> None:
    settings = PMW3901Settings(forward=forward, right=right, rad_per_count=0.001, height_m=1.0)
    flow = await opened(PMW3901Chip(Driven((20, 3)), now_s, mounting=mounting), settings)
    assert (await flow.read())[1:3] == pytest.approx((0.020, 0.003))


@virtual
async def test_spike_is_dropped_and_the_next_reading_is_good() -> None:
    flow = await opened(PMW3901Chip(Driven((0, 0), (469, 0), (8, 0)), now_s))
    await flow.read()
    await asyncio.sleep(0.05)
    with pytest.raises(BadReading, match=r"more than 20\d counts in 0.*raise the lens"):
        await flow.read()
    await asyncio.sleep(0.05)
    assert (await flow.read()).forward_m == pytest.approx(8 * 0.000213195)
    assert flow.error_counts == {"impossible readings rejected": 1}


@pytest.mark.parametrize(
    ("counts", "is_limit"), [((0, 0), False), ((100, -150), False), ((0, -166), True), ((174, 3), True)]
)
@virtual
async def test_readings_at_the_speed_that_the_chip_can_follow_are_counted(
    counts: tuple[int, int], is_limit: bool
) -> None:
    """7.4 rad/s are 0.74 m/s at 0.1 m, and 173 counts in 0.05 s."""

    flow = await opened(PMW3901Chip(Driven((0, 0), counts), now_s))
    await flow.read()
    await asyncio.sleep(0.05)
    await flow.read()
    assert flow.error_counts == ({"readings at the speed limit": 1} if is_limit else {})


@virtual
async def test_chip_that_lost_its_settings_is_reported_and_opening_it_again_helps() -> None:
    chip = PMW3901Chip(Driven((8, 0)), now_s)
    flow = await opened(chip)
    chip.power_cycle()
    with pytest.raises(NotResponding, match="has stopped"):
        await flow.read()
    await flow.close()
    await flow.open()
    assert (await flow.read()).forward_m > 0.0


@pytest.mark.parametrize("byte", [0x00, 0xFF])
@virtual
async def test_line_that_goes_dead_is_no_reading(byte: int) -> None:
    chip = Canned(NORMAL)
    flow = await opened(chip)
    chip.burst = bytes((byte,)) * 12
    with pytest.raises(NotResponding, match=f"only 0x{byte:02X} comes back"):
        await flow.read()


# -- the driver among others


@virtual
async def test_driver_keeps_the_promises_of_a_motion_sensor() -> None:
    def factory() -> PMW3901:
        return flow_over(PMW3901Chip(Driven((5, 0), (6, 1), (7, 0)), now_s))

    assert isinstance(factory(), MotionSensor)
    await check_motion_sensor(factory, unreachable=lambda: flow_over(None))


def test_bus_is_asked_for_with_mode_and_speed() -> None:
    asked = []

    class Asked(FakeBuses):
        def spi(self, name: str, *, mode: int = 0, speed_hz: int = 400_000) -> FakeSPI:
            asked.append((name, mode, speed_hz))
            return super().spi(name, mode=mode, speed_hz=speed_hz)

    flow = PMW3901(PMW3901Settings(bus="/dev/spidev0.0", spi_mode=3, speed_hz=200_000), Asked())
    assert asked == [("/dev/spidev0.0", 3, 200_000)]
    assert flow.name == "PMW3901 on /dev/spidev0.0"


def test_default_scale_is_that_of_the_simulated_part() -> None:
    assert PMW3901Settings().m_per_count == pytest.approx(FLOW_M_PER_COUNT, rel=1e-3)


@pytest.mark.parametrize(
    "values",
    [
        {"height_m": 0.079},
        {"spi_mode": 1},
        {"speed_hz": 2_000_001},
        {"rad_per_count": 0.0},
        {"rad_per_count": float("nan")},
        {"squal_full": 0},
        {"forward": "+x", "right": "-x"},
    ],
)
def test_settings_that_cannot_be_are_refused(values: dict[str, object]) -> None:
    validate = TypeAdapter(PMW3901Settings).validate_python
    assert validate({"height_m": 0.08, "spi_mode": 3, "forward": "+x", "right": "-y"}).height_m == 0.08
    with pytest.raises(ValidationError, match="|".join(values)):
        validate(values)
