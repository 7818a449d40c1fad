"""The simulated RoboClaw takes and gives the bytes that its manual and its maker's library have."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest

from tests.simhal.chips.bench import BoardBench
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.roboclaw import RoboClawChip

AHEAD = "80 22 7F FF 7F FF C7 78"


class Bench(BoardBench[RoboClawChip]):
    def __init__(self, **options: Any) -> None:
        super().__init__(partial(RoboClawChip, **options))

    def send(self, sent: str) -> str:
        return self.chip.receive(bytes.fromhex(sent)).hex(" ").upper()


@pytest.mark.parametrize(
    ("sent", "levels"),
    [
        ("80 22 40 00 C0 00 E0 DF", (16384, -16384)),
        ("80 22 20 00 E0 00 BF EB", (8192, -8192)),
        ("80 22 80 01 80 01 79 A6", (-32767, -32767)),
    ],
)
def test_duties_turn_the_motors_and_are_acknowledged(sent: str, levels: tuple[int, int]) -> None:
    bench = Bench()
    assert bench.send(sent) == "FF"
    assert bench.chip.levels == levels
    assert bench.world.commanded == pytest.approx((levels[0] / 32767, levels[1] / 32767))
    assert bench.send("80 22 00 00 00 00 98 17") == "FF"
    assert bench.chip.levels == (0, 0)


@pytest.mark.parametrize(
    ("set_up", "asked", "answer"),
    [
        ({"status": 0}, "80 5A", "00 00 00 00 87 BC"),
        ({"status": 0x1}, "80 5A", "00 00 00 01 97 9D"),
        ({"status": 0x10000}, "80 5A", "00 01 00 00 B0 8C"),
        ({"status": 0x80000}, "80 5A", "00 08 00 00 2E 1D"),
        ({"status": 0, "status_bytes": 2}, "80 5A", "00 00 44 37"),
        ({"status": 1, "status_bytes": 2}, "80 5A", "00 01 54 16"),
        ({"timeout": 5}, "80 0F", "05 7B C1"),
        ({"counters_began": (-100000, 100000)}, "80 4E", "00 01 86 A0 FF FE 79 60 6E C9"),
        ({"levels": (16384, -16384)}, "80 30", "40 00 C0 00 A0 06"),
        ({}, "80 15", b"USB Roboclaw 2x15a v4.1.34\n\0".hex(" ").upper() + " 34 6A"),
    ],
)
def test_answers_end_with_the_crc_over_question_and_data(set_up: dict[str, Any], asked: str, answer: str) -> None:
    bench = Bench()
    for name, value in set_up.items():
        setattr(bench.chip, name, value)
    assert bench.send(asked) == answer


def test_battery_is_in_tenths_of_a_volt() -> None:
    bench = Bench()
    for volts, answer in ((12.3, "00 7B F8 06"), (24.0, "00 F0 D8 E5")):
        bench.world.battery_v = volts
        assert bench.send("80 18") == answer


def test_currents_are_in_steps_of_ten_milliamperes(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    monkeypatch.setattr(type(bench.world), "motor_load", (0.15, 0.025))
    bench.world.stall_current_a = 10.0
    assert bench.send("80 31") == "00 96 00 19 3B 1E"


def test_timeout_stops_the_motors_at_its_own_time_and_the_next_command_moves_them_again() -> None:
    for feed, stops_s in (("80 18", 0.55), ("", 0.3)):
        bench = Bench()
        assert bench.send("80 0E 03 28 36") == "FF"
        bench.send(AHEAD)
        bench.now_s = 0.25
        bench.send(feed)
        bench.now_s = stops_s - 0.01
        bench.chip.tick()
        assert bench.chip.levels != (0, 0)
        bench.now_s = stops_s + 0.01
        bench.chip.tick()
        assert bench.chip.levels == (0, 0)
        bench.send(AHEAD)
        assert bench.chip.levels != (0, 0)


def test_requests_do_not_feed_it_where_they_are_said_not_to() -> None:
    bench = Bench(fed_by_requests=False)
    bench.send("80 0E 03 28 36")
    bench.send(AHEAD)
    assert bench.chip.stops_by_s == pytest.approx(0.3)
    bench.now_s = 0.25
    bench.send("80 18")
    assert bench.chip.stops_by_s == pytest.approx(0.3)


def test_what_is_not_for_it_or_broken_is_passed_over() -> None:
    bench = Bench()
    for sent in ("87 22 7F FF 7F FF 00 00", "80 22 7F FF 7F FF C7 79", "00 FF 55"):
        assert bench.send(sent) == ""
        assert bench.chip.levels == (0, 0)
    assert bench.chip.dropped == 1
    assert bench.send(AHEAD) == "FF"


def test_pause_of_more_than_ten_milliseconds_in_a_packet_drops_it() -> None:
    bench = Bench()
    for pause_s, took in ((0.009, "FF"), (0.011, "")):
        bench.send("80 22 7F")
        bench.now_s += pause_s
        assert bench.send("FF 7F FF C7 78") == took
    assert bench.send(AHEAD) == "FF"


def test_firmware_4_3_6_does_not_acknowledge_one_byte_of_data_and_takes_it() -> None:
    bench = Bench(acknowledges_one_byte=False)
    assert bench.send("80 0E 05 48 F0") == ""
    assert bench.chip.timeout == 5
    assert bench.send(AHEAD) == "FF"


def test_power_that_is_lost_takes_the_timeout_and_the_duties() -> None:
    bench = Bench()
    bench.send("80 0E 05 48 F0")
    bench.send(AHEAD)
    bench.chip.power_cycle()
    assert (bench.chip.timeout, bench.chip.levels, bench.world.commanded) == (0, (0, 0), (0.0, 0.0))


def test_packet_behind_one_that_broke_off_is_lost_with_it() -> None:
    bench = Bench()
    bench.send("80")
    assert bench.send(AHEAD) == ""
    assert bench.chip.levels == (0, 0)
    bench.now_s += 0.011
    assert bench.send(AHEAD) == "FF"


def test_command_that_the_manual_has_not_is_a_mistake_of_the_driver() -> None:
    with pytest.raises(ChipMisuse, match="command 200"):
        Bench().send("80 C8")
