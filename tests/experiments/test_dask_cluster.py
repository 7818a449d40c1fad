"""Trials on a Dask cluster: real processes where they matter, and what is refused in one line."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Run, refusal
from tests.experiments.dask_processes import STRANGER, UP_S, DaskProcesses, eventually, kill
from tests.experiments.fake_trials import MANY, campaign_of, started
from tests.experiments.test_run import lines_in, run_into
from wayfarer.errors import BadInput
from wayfarer.experiments.results import TRIALS


@pytest.fixture
def dask_cluster() -> Any:
    """The module, which imports Dask."""
    from wayfarer.experiments import dask_cluster

    return dask_cluster


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[DaskProcesses]:
    (tmp_path / "dask").mkdir()
    with DaskProcesses(tmp_path / "dask") as processes:
        yield processes


def ended(process: subprocess.Popen[str]) -> tuple[int, list[str]]:
    """Its exit code, and what it said beside the progress."""
    _, err = process.communicate(timeout=UP_S)
    return process.returncode, [line for line in err.splitlines() if not line.endswith(f"of {MANY} trials")]


@pytest.mark.process
def test_cluster_gives_the_bytes_of_two_jobs_although_a_worker_is_killed(dask: DaskProcesses, tmp_path: Path) -> None:
    doomed, _ = dask.worker(), dask.worker()
    out = tmp_path / "far"
    with started(out, dask.address) as campaign:
        assert eventually(lambda: lines_in(out / TRIALS) > 10)
        kill(doomed)
        assert ended(campaign) == (0, [f"the results are in {out}", f"Next: wayfarer report {out}"])
    two_jobs = run_into(tmp_path / "near", campaign_of(MANY), jobs=2)
    assert (out / TRIALS).read_bytes() == two_jobs
    assert two_jobs.count(b"\n") == MANY + 1


@pytest.mark.long
def test_interrupted_on_one_cluster_it_is_resumed_on_another_after_the_first_was_lost(
    dask: DaskProcesses, tmp_path: Path
) -> None:
    dask.worker()
    out = tmp_path / "out"
    with started(out, dask.address) as campaign:
        assert eventually(lambda: lines_in(out / TRIALS) > 5)
        campaign.send_signal(signal.SIGINT)
        code, (last,) = ended(campaign)
    kept = lines_in(out / TRIALS) - 1
    assert code == 130
    assert last == f"interrupted: {kept} of {MANY} trials are kept in {out}; continue with --resume"
    with started(out, dask.address) as campaign:
        assert eventually(lambda: lines_in(out / TRIALS) > kept + 5)
        kill(dask.scheduler)
        code, said = ended(campaign)
    assert (code, said[0]) == (1, f"{kept} of {MANY} trials are in {out} already")
    assert said[1:] == [
        f"wayfarer: the scheduler at {dask.address} is gone; the results in --out are kept: "
        "add --resume when it is back"
    ]
    assert run_into(out, campaign_of(MANY), resume=True) == run_into(tmp_path / "whole", campaign_of(MANY))


@pytest.mark.long
def test_workers_of_another_version_and_none_at_all_are_one_line(dask: DaskProcesses, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert f"no worker at the scheduler {dask.address}: start some" in refused_by(dask, out)
    dask.worker()
    dask.worker(STRANGER)
    assert "runs wayfarer 0.0.1, and this is wayfarer" in refused_by(dask, out)


def refused_by(dask: DaskProcesses, out: Path) -> str:
    with started(out, dask.address) as campaign:
        code, (said,) = ended(campaign)
    assert code == 2
    assert not out.exists()
    return said


def test_worker_that_came_later_with_another_version_runs_nothing(
    dask_cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Here:
        address = "tcp://10.0.0.9:4000"

    monkeypatch.setattr(dask_cluster, "get_worker", Here)
    with pytest.raises(BadInput, match=r"^worker tcp://10\.0\.0\.9:4000 runs wayfarer .* this is wayfarer 0\.0\.1:"):
        dask_cluster._run_checked("wayfarer 0.0.1", pytest.fail, "it was run")
    assert dask_cluster._run_checked(dask_cluster.version(), max, 3, 4) == 4


def test_version_follows_the_source(dask_cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "__init__.py").write_text("")
    (tmp_path / "rovers").mkdir()
    monkeypatch.setattr("wayfarer.__file__", str(tmp_path / "__init__.py"))
    said: list[str] = []
    for content in ("a = 1", "a = 2", "a = 1"):
        (tmp_path / "rovers" / "sim.toml").write_text(content)
        (tmp_path / "note.txt").write_text(str(len(said)))
        said.append(dask_cluster.version.__wrapped__())
    assert said[0] == said[2] != said[1]


NOBODY = {
    "tcp://127.0.0.1:1": "Connection refused",
    "localhost:1": "Connection refused",
    "nowhere": "missing port",
    "": "missing port",
    "smoke://hill:2": "unknown address scheme",
    "inproc://x": "don't know how",
}


def refused(run: Run, address: str, out: Path) -> str:
    err = refusal(run, "sim", "--trials", 1, "--out", out, "--cluster", address)
    assert err.startswith(f"wayfarer: no Dask scheduler at '{address}': ")
    assert not out.exists()
    return err


@pytest.mark.parametrize(("address", "why"), NOBODY.items())
def test_scheduler_that_is_not_there_is_one_line_before_anything_is_made(
    run: Run, address: str, why: str, tmp_path: Path
) -> None:
    assert why in refused(run, address, tmp_path / "out")


def test_something_else_that_listens_is_no_scheduler(
    run: Run, dask_cluster: Any, taken_port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_cluster, "ANSWER_S", 0.2)
    assert "no answer" in refused(run, f"127.0.0.1:{taken_port}", tmp_path / "out")
