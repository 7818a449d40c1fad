"""A campaign with a driver and an algorithm in files of one's own: every worker has them, and a log leads to them."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import pytest

from tests.config.test_own_file import HANDLER
from tests.conftest import Run, refusal
from tests.experiments.dask_processes import DaskProcesses
from tests.simhal import third_party_compass
from tests.simhal.commands import succeed
from wayfarer.config.rover_path import SHIPPED
from wayfarer.errors import BadInput
from wayfarer.experiments.checks import make_campaign
from wayfarer.experiments.pool import TaskFailed, run_tasks
from wayfarer.experiments.recorded import SETTINGS
from wayfarer.experiments.results import TRIALS, Results
from wayfarer.experiments.run import TrialRunner


@pytest.fixture
def rover(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A rover file whose compass, with its chip, and an algorithm are in files beside it, and nothing is here."""
    folder = tmp_path / "rover"
    folder.mkdir()
    source = Path(third_party_compass.__file__).read_text(encoding="utf-8")
    (folder / "xc9.py").write_text(source.replace("tests.simhal.third_party_compass:", "xc9.py:"), encoding="utf-8")
    (folder / "spiral.py").write_text(HANDLER, encoding="utf-8")
    table = (
        (SHIPPED / "minirover.toml")
        .read_text(encoding="utf-8")
        .replace('driver = "cmps14"', 'driver = "xc9.py:LooseXC9"')
    )
    (folder / "rover.toml").write_text(table.replace("address = 0x60", "address = 0x1E"), encoding="utf-8")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr(sys, "path", [*sys.path])
    return folder / "rover.toml"


def campaign(rover: Path, out: Path, jobs: int = 1, cluster: str = "") -> list[object]:
    where = ["--cluster", cluster] if cluster else ["--jobs", jobs]
    return ["sim", "--rover", rover, "--algorithm", "spiral.py:Spiral", "--depth", "bus", "--trials", 8,
            "--budget-m", 5, "--out", out, *where]  # fmt: skip


@pytest.mark.process
def test_several_processes_and_a_cluster_give_the_bytes_of_one(rover: Path, tmp_path: Path, run: Run) -> None:
    succeed(run, *campaign(rover, tmp_path / "one"))
    one = (tmp_path / "one" / TRIALS).read_bytes()
    assert one.count(b"spiral.py:Spiral,") == 8
    succeed(run, *campaign(rover, tmp_path / "two", jobs=2))
    assert (tmp_path / "two" / TRIALS).read_bytes() == one
    (tmp_path / "dask").mkdir()
    with DaskProcesses(tmp_path / "dask") as dask:
        dask.worker()
        succeed(run, *campaign(rover, tmp_path / "far", cluster=dask.address))
    assert (tmp_path / "far" / TRIALS).read_bytes() == one
    settings = {(tmp_path / each / SETTINGS).read_bytes() for each in ("one", "two", "far")}
    assert len(settings) == 1


@pytest.mark.process
def test_worker_refuses_a_file_that_was_edited_after_the_campaign_began(rover: Path) -> None:
    plan = make_campaign({"algorithms": "spiral.py", "rover": str(rover), "trials": 4, "budget_m": 1.0})
    (rover.parent / "spiral.py").write_text(HANDLER + "# edited\n", encoding="utf-8")
    with pytest.raises(TaskFailed) as caught:
        list(run_tasks(TrialRunner(plan), Results(plan).missing(), jobs=2, stop=threading.Event()))
    assert isinstance(caught.value.error, BadInput)
    assert "spiral.py is not the file that the campaign began with" in caught.value.why


def test_run_s_log_leads_its_replay_to_the_file(rover: Path, tmp_path: Path, run: Run) -> None:
    log = tmp_path / "log"
    succeed(run, "sim", "--rover", rover, "--algorithm", "spiral.py", "--budget-m", 3, "--trial", 1, "--log-dir", log)
    assert "names code to run, 'spiral.py'" in refusal(run, "replay", log)
    assert "decisions as logged" in succeed(run, "replay", log, "--allow-code")
    (rover.parent / "spiral.py").unlink()
    assert f"spiral.py; looked in {rover.parent}" in refusal(run, "replay", log, "--allow-code")
