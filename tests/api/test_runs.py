"""Runs and single trials from Python."""

from __future__ import annotations

import asyncio
import sys
import warnings
from pathlib import Path

import pytest

import wayfarer


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs") / "trial"


@pytest.fixture(scope="module")
def trial(folder: Path) -> wayfarer.Trial:
    return wayfarer.run_trial(7, budget_m=60.0, log_dir=folder)


def test_log_of_a_trial_is_a_run_with_its_ticks_and_events(folder: Path, trial: wayfarer.Trial) -> None:
    run = wayfarer.open_run(folder)
    ticks = run.ticks.to_arrow()
    assert ticks["n"].null_count == 0
    assert (ticks.num_rows - 1, run.summary.ticks) == (trial.row.ticks, trial.row.ticks)  # and one for how it ended
    assert [event["name"] for event in run.events][-1] == "wheels_stopped"
    assert run.events.to_pandas().elapsed_s.is_monotonic_increasing


def test_track_is_the_true_pose_beside_what_the_log_says(folder: Path, trial: wayfarer.Trial) -> None:
    assert trial.outcome == "escaped"
    track = trial.track.to_pandas()
    told = wayfarer.open_run(folder).ticks.to_pandas()
    assert track.t_s.tolist() == told.t_s[:-1].tolist()
    assert track.phase.tolist() == told.phase[:-1].tolist()
    told = told[1:].reset_index()  # the truth is written after a tick, and stands in the row of the next one
    known = told.truth_x_m.notna()
    known.iloc[-1] = False  # that of the end, after the last tick's step
    assert track.x_m[known].tolist() == pytest.approx(told.truth_x_m[known].tolist(), abs=1e-4)
    assert track.heading_deg.between(0, 360).all()


def test_torn_log_gives_its_rows_and_a_warning(folder: Path, trial: wayfarer.Trial, tmp_path: Path) -> None:
    log = (folder / "run.jsonl").read_bytes()
    (tmp_path / "run.jsonl").write_bytes(log[: len(log) // 2])
    with pytest.warns(UserWarning, match="1 line is torn"):
        run = wayfarer.open_run(tmp_path)
    assert run.damage.torn == 1
    assert trial.row.ticks is not None
    assert 0.4 < run.ticks.to_arrow().num_rows / trial.row.ticks < 0.6
    assert run.summary.reason is None
    assert "log 1 line is torn" in repr(run)


def test_ticks_need_no_further_package_where_they_are_iterated(
    folder: Path, trial: wayfarer.Trial, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a rover pyarrow is not installed."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.delitem(sys.modules, "wayfarer.views.export.parquet", raising=False)
    assert [row["phase"] for row in wayfarer.open_run(folder).ticks][-2] == "follow"


def test_whole_log_is_replayed_to_its_end_also_in_a_running_loop(folder: Path, trial: wayfarer.Trial) -> None:
    async def cell() -> wayfarer.Run:
        assert wayfarer.replay(folder).ticks == trial.row.ticks
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
        wayfarer.run_trial(0, "cv-pledge", anomaly_source="motion", rover="minirover", depth="bus")
