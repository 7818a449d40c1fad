"""What the tests of real processes measure with: wheels, logs of killed runs, and how evenly the loop ticks."""

from __future__ import annotations

import os
import subprocess
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.children import child
from tests.system.hil_setup import BUSY
from tests.system.jitter import jitter
from tests.system.killer import after_death
from tests.system.log_recovery import cut_off, numbered_twice, read_back
from tests.system.subprocesses import DAEMON_PRIORITY, STARTING_NICENESS, put_first, python, starting
from tests.system.wheel_history import Commands, first_stop, spans, stop_after, told_to_turn
from wayfarer.drivers.threaded import Worker
from wayfarer.errors import NotResponding

HEADER = '{"record":"run","t_s":0.0,"schema":2}\n'
TICKS = "".join(f'{{"record":"tick","n":{n},"t_s":{n / 20}}}\n' for n in range(1, 5))
OUTCOME = '{"record":"outcome","n":5,"t_s":0.25,"reason":"requested"}\n'


# -- a computer that is too busy for a bench ---------------------------------------------------------------------------


async def test_what_a_late_transfer_is_told_as_is_known() -> None:
    worker, freed = Worker("bus", 0.01), threading.Event()
    for _ in range(2):  # the first ends late, the second finds it hanging
        with pytest.raises(NotResponding, match=BUSY):
            await worker.call(freed.wait)
    freed.set()
    await worker.close()


# -- what comes before others ------------------------------------------------------------------------------------------


rooted = pytest.mark.skipif(os.geteuid() != 0, reason="only root may put a process first")


@rooted
def test_process_that_starts_comes_before_ordinary_ones_and_after_those_that_run() -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with starting(), child(python("input()"), stdin=subprocess.PIPE) as process:
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == STARTING_NICENESS
        assert os.sched_getscheduler(process.pid) == os.SCHED_OTHER
        process.communicate(b"\n")
    assert os.getpriority(os.PRIO_PROCESS, 0) == before


@rooted
def test_process_comes_first_with_its_threads_and_its_children() -> None:
    code = "import subprocess, threading, sys; threading.Thread(target=sys.stdin.read).start(); "
    starts_another = "child = subprocess.Popen([sys.executable, '-c', 'input()']); print(child.pid, flush=True)"
    with child(python(code + starts_another), stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        pids = [process.pid, int(process.stdout.readline())]
        put_first(process.pid)
        threads = [int(thread.name) for pid in pids for thread in Path(f"/proc/{pid}/task").iterdir()]
        assert len(threads) > 2
        assert {os.sched_getscheduler(thread) for thread in threads} == {os.SCHED_RR}
        assert {os.sched_getparam(thread).sched_priority for thread in threads} == {DAEMON_PRIORITY}


def test_process_that_has_ended_or_is_another_users_is_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    with child(python("")) as process:
        process.wait()
    put_first(process.pid)
    asked: list[int] = []

    def refused(thread: int, *_: object) -> None:
        asked.append(thread)
        raise (PermissionError, ProcessLookupError)[len(asked) % 2]

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    with ThreadPoolExecutor(1) as pool:
        pool.submit(int).result()
        put_first(os.getpid())
        assert len(asked) > 1, "one that cannot be put first keeps no other back"


# -- what wheels were told ---------------------------------------------------------------------------------------------

DRIVE: Commands = [(1.0, 0.3, 0.0), (1.0, 0.3, 0.3), (1.1, 0.3, 0.3), (1.4, 0.0, 0.0)]


def test_stop_is_the_first_command_after_the_last_motion() -> None:
    assert stop_after(DRIVE) == (1.1, 1.4)
    assert stop_after([*DRIVE, (2.0, 0.0, 0.1), (2.2, 0.0, 0.0), (2.3, 0.0, 0.0)]) == (2.0, 2.2)


def test_first_stop_after_a_time_is_found_though_wheels_turn_again() -> None:
    assert first_stop([*DRIVE, (2.0, 0.2, 0.1), (2.2, 0.0, 0.0)], 1.0) == (1.1, 1.4)


def test_spans_of_motion_are_those_between_stops() -> None:
    assert spans([*DRIVE, (2.0, 0.0, 0.1)]) == [(1.0, 1.4), (2.0, float("inf"))]
    assert told_to_turn(DRIVE)
    assert not told_to_turn(DRIVE[-1:])


@pytest.mark.parametrize(
    ("died_s", "found"),
    [
        (1.15, (pytest.approx(0.3), pytest.approx(0.25))),
        (1.5, (None, None)),
        (0.9, (None, None)),
    ],
)
def test_stop_after_a_death_counts_from_the_last_command_and_from_the_death(
    died_s: float, found: tuple[float | None, float | None]
) -> None:
    assert after_death(DRIVE, died_s) == found


def test_wheels_that_nobody_stops_are_stopped_never() -> None:
    assert after_death(DRIVE[:-1], 1.15) == (float("inf"), float("inf"))


# -- what a killed run left ------------------------------------------------------------------------------------------


def run_of(logs: Path, text: str, name: str = "00001-20261121T061405Z") -> Path:
    run = logs / name
    run.mkdir(parents=True)
    (run / "run.jsonl").write_text(text, encoding="utf-8")
    return run


def test_log_that_a_kill_cut_short_reads_back_to_its_last_whole_tick(tmp_path: Path) -> None:
    found = read_back(run_of(tmp_path, f'{HEADER}{TICKS}{{"record":"tick","n":5'))
    assert (found.last_tick_s, found.torn, found.ended) == (0.2, True, False)


def test_record_that_is_missing_or_garbled_before_the_end_is_a_problem(tmp_path: Path) -> None:
    hole = TICKS.replace('"n":2,', '"n":12,')
    for told, text in {"missing": HEADER + hole, "no record": f"{HEADER}nonsense\n{TICKS}"}.items():
        with pytest.raises(AssertionError, match=told):
            read_back(run_of(tmp_path / told, text))


def test_run_without_a_log_or_with_an_outcome_has_lost_nothing(tmp_path: Path) -> None:
    (tmp_path / "00001-20261121T061405Z").mkdir()
    assert read_back(tmp_path / "00001-20261121T061405Z") == (None, False, False, False)
    run = run_of(tmp_path, HEADER + TICKS + OUTCOME, "00002-20261121T061405Z")
    assert read_back(run).ended
    assert cut_off(tmp_path) is None


def test_newest_run_without_an_outcome_was_cut_off(tmp_path: Path) -> None:
    assert cut_off(tmp_path) is None
    run_of(tmp_path, HEADER + TICKS + OUTCOME)
    run = run_of(tmp_path, HEADER + TICKS, "00002-20261121T061405Z")
    assert cut_off(tmp_path) == run.name


def test_runs_that_share_a_number_are_found(tmp_path: Path) -> None:
    for name in ("00001-20261121T061405Z", "00002-20261121T061405Z", "00002-20261121T061406Z"):
        run_of(tmp_path, HEADER, name)
    assert numbered_twice(tmp_path) == ["2 runs have the number 2"]


# -- ticks ----------------------------------------------------------------------------------------


def test_jitter_is_how_far_ticks_are_from_their_period() -> None:
    even = [number * 0.05 for number in range(101)]
    late = [t_s + 0.02 * (number == 50) for number, t_s in enumerate(even)]
    assert jitter(even, 0.0, 5.0) == pytest.approx((0.0, 0.0, 0.0))
    assert jitter(late, 0.0, 5.0) == pytest.approx((0.0, 0.0, 0.02))


def test_loop_that_hardly_ticks_has_no_jitter_to_speak_of() -> None:
    with pytest.raises(ValueError, match="only 3 ticks"):
        jitter([0.0, 1.0, 2.0], 0.0, 5.0)
