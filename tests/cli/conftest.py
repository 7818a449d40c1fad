"""Fixtures shared by the tests of the commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.experiments import fake_trials


@pytest.fixture
def own_folders(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keep away from daemons and calibrations of this machine; return the folder for sockets and state."""
    folder = tmp_path_factory.mktemp("own")
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(folder))
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    for place in ("SYSTEM_FOLDER", "SESSIONS_FOLDER"):  # a real rover must not be armed
        monkeypatch.setattr(f"wayfarer.daemon.socket.paths.{place}", folder / "none")
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setenv("STATE_DIRECTORY", str(folder / "state"))
    return folder


@pytest.fixture
def quick_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process's trials end at once; only for ``--jobs 1``."""
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", fake_trials.quick)
