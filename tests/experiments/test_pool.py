"""Where tasks run, beside what campaigns show (``test_run``): nobody else's processes, and what the system refuses."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.experiments import fake_trials
from tests.experiments.fake_trials import campaign_of
from wayfarer.errors import BadInput, TrialNotRun
from wayfarer.experiments.pool import LARGEST_CHUNK, LAST_SINGLY, cores, in_chunks, run_tasks
from wayfarer.experiments.results import Results
from wayfarer.experiments.run import TrialRunner, run


def squares(tasks: Sequence[int], **options: Any) -> list[int]:
    return sorted(run_tasks(abs, tasks, stop=threading.Event(), **options))


@given(st.integers(0, 300), st.integers(1, 8))
def test_every_task_is_in_one_chunk_and_the_last_ones_come_singly(number: int, jobs: int) -> None:
    tasks = range(2 * number)
    chunks = list(in_chunks(tasks, jobs, LARGEST_CHUNK))
    assert [task for chunk in chunks for task in chunk] == [*tasks]
    sizes = [len(chunk) for chunk in chunks]
    assert set(sizes) <= {1, LARGEST_CHUNK}
    assert sizes == sorted(sizes, reverse=True)
    assert sizes.count(1) >= min(len(tasks), LAST_SINGLY * jobs)


@pytest.mark.process
@pytest.mark.parametrize("end", ["well", "error"])
def test_nobodys_children_are_ended(end: str) -> None:
    gate = get_context("spawn").Event()
    children = [get_context("spawn").Process(target=gate.wait) for _ in range(2)]
    children[0].start()

    def progress(_: object) -> None:
        if children[1].pid is None:
            children[1].start()
        if end == "error":
            raise RuntimeError("of who looks on")

    try:
        run(Results(campaign_of(8)), jobs=2, run_trial=fake_trials.quick, progress=progress)
    except RuntimeError:
        assert end == "error"
    assert all(child.is_alive() for child in children)
    gate.set()
    for child in children:
        child.join()
    assert [child.exitcode for child in children] == [0, 0]


class OfTheScript:
    """As a class that a script defines."""

    def __call__(self, spec: Any) -> Any:
        return fake_trials.quick(spec)


@pytest.mark.process
def test_main_is_hidden_from_no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(OfTheScript, "__module__", "__main__")
    monkeypatch.setattr(sys.modules["__main__"], "OfTheScript", OfTheScript, raising=False)
    over, failed = threading.Event(), list[Exception]()

    def pickles() -> None:
        while not over.is_set():
            try:
                pickle.dumps(OfTheScript())
            except pickle.PicklingError as error:
                failed.append(error)

    thread = threading.Thread(target=pickles)
    thread.start()
    try:
        run(Results(campaign_of(100)), jobs=2, run_trial=fake_trials.quick)
    finally:
        over.set()
        thread.join()
    assert failed == []
    with pytest.raises(BadInput, match="do not have what this script defines: put it in a separate file"):
        run(Results(campaign_of(2)), jobs=2, run_trial=OfTheScript())


def test_what_cannot_be_sent_is_refused_before_anything_is_begun() -> None:
    with pytest.raises(BadInput, match=r"a trial cannot be sent to another process: .*; use jobs=1"):
        run(Results(campaign_of(2)), jobs=2, run_trial=lambda spec: fake_trials.quick(spec))


@pytest.mark.process
@pytest.mark.parametrize(("given", "where"), [(0, "this process"), (1, "1 processes")])
def test_system_that_starts_no_more_processes_is_a_sentence(
    monkeypatch: pytest.MonkeyPatch, given: int, where: str
) -> None:
    start, started = subprocess.Popen, list[object]()

    def popen(*args: Any, **options: Any) -> Any:
        if len(started) >= given:
            raise BlockingIOError(11, "Resource temporarily unavailable")
        started.append(args)
        return start(*args, **options)

    monkeypatch.setattr(subprocess, "Popen", popen)
    said: list[str] = []
    assert squares(range(5), jobs=3, notice=said.append) == [0, 1, 2, 3, 4]
    assert said == [
        f"the system starts no more processes (Resource temporarily unavailable): the trials run in {where}"
    ]
    with pytest.warns(UserWarning, match="the system starts no more processes"):
        squares(range(5), jobs=3)


def test_runner_is_small_when_it_is_sent() -> None:
    """It goes to each worker."""
    assert len(pickle.dumps(TrialRunner(campaign_of(1_000_000)))) < 10_000


QUOTAS = [
    ("0::/a/b\n", {"a/cpu.max": "50000 100000\n", "a/b/cpu.max": "max 100000\n"}, 1),
    ("0::/a/b\n", {"a/cpu.max": "max 100000\n"}, 4),
    ("0::/../elsewhere\n", {"cpu.max": "150000 100000\n"}, 2),
    ("3:cpu,cpuacct:/docker/x\n0::/\n", {"cpu/cpu.cfs_quota_us": "200000\n", "cpu/cpu.cfs_period_us": "100000\n"}, 2),
    ("3:cpu,cpuacct:/x\n", {"cpu/x/cpu.cfs_quota_us": "-1\n", "cpu/x/cpu.cfs_period_us": "100000\n"}, 4),
    ("nonsense\n", {}, 4),
]


@pytest.mark.parametrize(("membership", "files", "expected"), QUOTAS)
def test_as_many_jobs_as_the_quota_has_cores(
    membership: str, files: dict[str, str], expected: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(4))
    assert cores(tmp_path) == 4, "a system without groups"
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/cgroup").write_text(membership)
    for name, text in files.items():
        path = tmp_path / "sys/fs/cgroup" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert cores(tmp_path) == expected


class Strange(Executor):
    """Somebody's executor: what it does with a submitted task is a function of the future."""

    def __init__(self, answer: Callable[[Future[Any]], object]) -> None:
        self.answer = answer

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.answer(future)
        return future


def refuse(_: Future[Any]) -> None:
    raise OSError("the network\nis gone")


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (refuse, "OSError: the network is gone"),
        (lambda future: future.set_exception(ValueError("odd")), "ValueError: odd"),
        (lambda future: future.set_result("nonsense"), "ValueError: "),
        (Future.cancel, "CancelledError"),  # nobody notifies it, as after shutdown(cancel_futures=True)
    ],
    ids=["refuses", "raises", "nonsense", "cancels"],
)
def test_whatever_an_executor_does_is_an_error_in_a_line(answer: Callable[[Future[Any]], object], said: str) -> None:
    with pytest.raises(TrialNotRun, match=rf"^trial 0 of forest-pledge could not be run: {said}[^\n]*; correct that"):
        run(Results(campaign_of(9)), executor=Strange(answer), run_trial=fake_trials.quick)


def test_executor_that_is_shut_down_meanwhile_ends_the_campaign_and_keeps_what_is_done(tmp_path: Path) -> None:
    executor = ThreadPoolExecutor(1)
    campaign, seen = campaign_of(99), list[object]()

    def progress(done: object) -> None:
        seen.append(done)
        executor.shutdown(wait=False, cancel_futures=True)

    with Results.kept(campaign, tmp_path / "out") as results, pytest.raises(TrialNotRun, match="are kept in"):
        run(results, executor=executor, run_trial=fake_trials.quick, progress=progress)
    assert 1 <= len(seen) == len(Results.open(tmp_path / "out", unfinished=True).rows) < 99


class OfNoError(BaseException):
    """As ``asyncio.CancelledError``, or what a test framework raises."""


def raises_what_is_no_error(_: Any) -> Any:
    raise OfNoError("of mine")


@pytest.mark.process
@pytest.mark.parametrize("jobs", [1, 2])
def test_an_algorithm_may_raise_what_is_no_error(jobs: int) -> None:
    with pytest.raises(TrialNotRun, match=r"could not be run: OfNoError: of mine \(test_pool.py:"):
        run(Results(campaign_of(4)), jobs=jobs, run_trial=raises_what_is_no_error)


@pytest.mark.process
@pytest.mark.parametrize("closed", ["<&-", ">&-", "<&- >&-", "<&- >&- 2>&-"])
def test_closed_standard_streams_disturb_no_worker(tmp_path: Path, closed: str) -> None:
    sim = "sim --trials 4 --budget-m 3 --jobs 2 --out out"
    command = [shutil.which("sh") or "sh", "-c", f"{sys.executable} -m wayfarer {sim} {closed}"]
    assert subprocess.run(command, cwd=tmp_path, stdout=subprocess.DEVNULL, check=False).returncode == 0
    assert len(Results.open(tmp_path / "out").rows) == 4
