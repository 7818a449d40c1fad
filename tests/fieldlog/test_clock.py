"""A wall clock that is set by hours changes neither the order of a log nor its numbers, and is written down."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fieldlog.lines import read, standing
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.writer import RunFiles

BOOT_S = 1.7e9  # what a computer without a clock of its own believes until it finds the right time


@pytest.mark.parametrize("step_s", [3 * 3600.0, -3 * 3600.0, 86_400.0 * 400])
def test_clock_that_is_set_is_an_event_between_records_in_their_order(tmp_path: Path, step_s: float) -> None:
    wall_offset_s = BOOT_S
    log = FieldLog(RunFiles(tmp_path), {}, wall=lambda t_s: t_s + wall_offset_s)
    for t_s in (0.0, 0.5, 1.0, 1.5, 2.0):
        if t_s == 1.0:
            wall_offset_s += step_s
        log.tick(standing(t_s))
    log.close("requested", "enough")
    (_, *found), its = read(tmp_path)
    assert [record.get("name", record["record"]) for record in found] == [
        "tick", "tick", "clock_step", "tick", "tick", "tick", "outcome",
    ]  # fmt: skip
    assert [record["n"] for record in found] == [1, 2, 3, 4, 5, 6, 7]
    assert [record["t_s"] for record in found] == [0.0, 0.5, 1.0, 1.0, 1.5, 2.0, 2.0]
    assert found[2]["by_s"] == step_s
    assert [record["t_wall"] - record["t_s"] - BOOT_S for record in found] == [0.0, 0.0, *[step_s] * 5]
    assert its.damage.lines == its.damage.missing == 0


def test_clock_that_is_slewed_is_no_event(tmp_path: Path) -> None:
    log = FieldLog(RunFiles(tmp_path), {}, wall=lambda t_s: BOOT_S + 1.0005 * t_s)
    for second in range(1000):
        log.tick(standing(float(second)))
    log.close("requested", "enough")
    assert {record["record"] for record in read(tmp_path)[0]} == {"run", "tick", "outcome"}
