from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import browser_page, chromium
from tests.experiments.report.campaigns import run_campaign, some_forests

__all__ = ["browser_page", "chromium"]  # fixtures for the tests here


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small campaign of real trials, with its forests; nobody may change it."""
    folder = tmp_path_factory.mktemp("campaign")
    run_campaign(folder / "out", forests=some_forests(folder / "given.jsonl"))
    return folder / "out"
