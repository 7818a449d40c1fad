"""What the tests of real processes measure with finds what it is to find: else they could not fail."""

from __future__ import annotations

import threading
from math import inf
from pathlib import Path

import pytest

from tests.system.hil_setup import BUSY
from tests.system.measures import (
    Commands,
    after_death,
    cut_off,
    first_stop,
    numbered_twice,
    read_back,
    spans,
    stop_after,
)
from wayfarer.drivers.threaded import Worker
from wayfarer.errors import NotResponding

HEADER = '{"record":"run","t_s":0.0,"schema":2}\n'
TICKS = "".join(f'{{"record":"tick","n":{n},"t_s":{n / 20}}}\n' for n in range(1, 5))
OUTCOME = '{"record":"outcome","n":5,"t_s":0.25,"reason":"requested"}\n'
DRIVE: Commands = [(1.0, 0.3, 0.0), (1.0, 0.3, 0.3), (1.1, 0.3, 0.3), (1.4, 0.0, 0.0)]
AGAIN: Commands = [(2.0, 0.0, 0.1), (2.2, 0.0, 0.0), (2.3, 0.0, 0.0)]


async def test_what_a_late_transfer_is_told_as_is_known() -> None:
    worker, freed = Worker("bus", 0.01), threading.Event()
    for _ in range(2):  # the first ends late, the second finds it hanging
        with pytest.raises(NotResponding, match=BUSY):
            await worker.call(freed.wait)
    freed.set()
    await worker.close()


def test_stop_is_the_first_command_after_the_last_motion_or_after_a_time() -> None:
    assert stop_after(DRIVE) == (1.1, 1.4)
    assert stop_after(DRIVE + AGAIN) == (2.0, 2.2)
    assert first_stop(DRIVE + AGAIN, 1.0) == (1.1, 1.4)
    assert spans(DRIVE + AGAIN[:1]) == [(1.0, 1.4), (2.0, inf)]


@pytest.mark.parametrize(
    ("commands", "died_s", "found"),
    [
        (DRIVE, 1.15, (pytest.approx(0.3), pytest.approx(0.25))),
        (DRIVE, 1.5, (None, None)),
        (DRIVE, 0.9, (None, None)),
        (DRIVE[:-1], 1.15, (inf, inf)),  # nobody stopped them
    ],
)
def test_stop_after_a_death_counts_from_the_last_command_and_from_the_death(
    commands: Commands, died_s: float, found: tuple[float | None, float | None]
) -> None:
    assert after_death(commands, died_s) == found


def run_of(logs: Path, text: str, name: str = "00001-20261121T061405Z") -> Path:
    run = logs / name
    run.mkdir(parents=True)
    (run / "run.jsonl").write_text(text, encoding="utf-8")
    return run


def test_log_that_a_kill_cut_short_reads_back_to_its_last_whole_tick_and_one_with_a_hole_does_not(
    tmp_path: Path,
) -> None:
    found = read_back(run_of(tmp_path, f'{HEADER}{TICKS}{{"record":"tick","n":5'))
    assert (found.last_tick_s, found.torn, found.ended) == (0.2, True, False)
    hole = TICKS.replace('"n":2,', '"n":12,')
    for told, text in {"missing": HEADER + hole, "no record": f"{HEADER}nonsense\n{TICKS}"}.items():
        with pytest.raises(AssertionError, match=told):
            read_back(run_of(tmp_path / told, text))


def test_mission_without_an_end_was_cut_off_and_runs_that_share_a_number_are_found(tmp_path: Path) -> None:
    run = run_of(tmp_path, HEADER + TICKS)
    assert (cut_off(tmp_path), numbered_twice(tmp_path)) == (None, [])
    for ended, expected in (("null", run.name), ('"mission_time"', None)):
        told = f'{{"run": "{run.name}", "mission_ended": {ended}}}'
        (tmp_path / ".last_mission.json").write_text(told, encoding="utf-8")
        assert cut_off(tmp_path) == expected
    run_of(tmp_path, HEADER + TICKS, "00001-20261121T061406Z")
    assert numbered_twice(tmp_path) == ["2 runs have the number 1"]
