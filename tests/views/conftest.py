"""What tests of several views share: a browser, and the log of a whole trial."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import browser_page, chromium
from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.simhal.world.generate import generate_forest

__all__ = ["browser_page", "chromium"]


@pytest.fixture(scope="session")
def trial_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a simulated trial with a few episodes; only to be read."""
    folder = tmp_path_factory.mktemp("trial")
    run_trial(TrialSpec(3, "forest-pledge", generate_forest(1, 0, 0), 5, load_rover("sim"), budget_m=25.0), folder)
    return folder
