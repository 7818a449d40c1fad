"""Runs and single trials from Python."""

from __future__ import annotations

import asyncio
import warnings
from pathlib import Path

import pytest

import wayfarer


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs") / "trial"


@pytest.fixture(scope="module")
def trial(folder: Path) -> wayfarer.Trial:
    return wayfarer.run_trial(1, budget_m=60.0, log_dir=folder)


def test_log_of_a_trial_is_a_run_with_its_ticks_and_events(folder: Path, trial: wayfarer.Trial) -> None:
    run = wayfarer.open_run(folder)
    ticks, events = list(run.ticks), list(run.events)
    assert None not in {tick["n"] for tick in ticks}
    assert len(ticks) - 1 == run.summary.ticks == len(trial.track)  # and one for how it ended
    assert events[-1]["name"] == "wheels_stopped"
    assert [event["elapsed_s"] for event in events] == sorted(event["elapsed_s"] for event in events)
    assert list(run.events) == events, "they are read again each time"


def test_track_is_the_true_pose_beside_what_the_log_says(folder: Path, trial: wayfarer.Trial) -> None:
    assert trial.outcome == "escaped"
    track, told = trial.track, list(wayfarer.open_run(folder).ticks)
    assert [tick["t_s"] for tick in track] == [tick["t_s"] for tick in told[:-1]]
    assert [tick["phase"] for tick in track] == [tick["phase"] for tick in told[:-1]]
    # The truth is written after a tick, and stands in the row of the next one; that of the end comes after a step more.
    known = [(tick, later) for tick, later in zip(track, told[1:-1], strict=False) if later["truth_x_m"] is not None]
    assert len(known) > 10
    assert [tick["x_m"] for tick, _ in known] == pytest.approx([later["truth_x_m"] for _, later in known], abs=1e-4)
    assert all(0.0 <= tick["heading_deg"] < 360.0 for tick in track)


def test_torn_log_gives_its_rows_and_a_warning(folder: Path, trial: wayfarer.Trial, tmp_path: Path) -> None:
    log = (folder / "run.00001.jsonl").read_bytes()
    (tmp_path / "run.00001.jsonl").write_bytes(log[: len(log) // 2])
    with pytest.warns(UserWarning, match="1 line is torn"):
        run = wayfarer.open_run(tmp_path)
    assert run.damage.torn == 1
    assert 0.4 < len(list(run.ticks)) / len(trial.track) < 0.6
    assert run.summary.reason is None
    assert "log 1 line is torn" in repr(run)


def test_whole_log_is_replayed_to_its_end_also_in_a_running_loop(folder: Path, trial: wayfarer.Trial) -> None:
    async def cell() -> wayfarer.Run:
        assert wayfarer.replay(folder).ticks == len(trial.track)
        return wayfarer.open_run(folder)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = asyncio.run(cell())
    assert wayfarer.replay(run).difference is None
    patient = wayfarer.load_rover("sim").model_copy(update={"control_hz": 10.0})
    assert wayfarer.replay(run, rover=patient).ticks <= wayfarer.replay(run).ticks


def test_what_is_no_run_or_no_trial_is_refused(tmp_path: Path) -> None:
    with pytest.raises(wayfarer.WayfarerError, match="there is no run"):
        wayfarer.open_run(18, log_dir=tmp_path)
    with pytest.raises(wayfarer.WayfarerError, match="counted from 0"):
        wayfarer.run_trial(-1)
    with pytest.raises(wayfarer.WayfarerError, match="runs one algorithm"):
        wayfarer.run_trial(0, "paper")
    with pytest.raises(wayfarer.WayfarerError, match="contact"):
        wayfarer.run_trial(0, "cv-pledge", set={"anomaly_source": "motion"}, rover="minirover", depth="bus")
