from __future__ import annotations

import fcntl
import shutil
from pathlib import Path

import pytest

from tests.browser import browser_page, chromium
from tests.reports.campaigns import run_campaign, some_forests

__all__ = ["browser_page", "chromium"]  # fixtures for the tests here


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """A small campaign of real trials, with its forests; nobody may change it. One worker runs it for all of them."""
    folder = tmp_path_factory.getbasetemp()
    folder = (folder if worker_id == "master" else folder.parent) / "finished"
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "ran").exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            run_campaign(folder / "out", forests=some_forests(folder / "given.jsonl"))
            (folder / "ran").touch()
    return folder / "out"
