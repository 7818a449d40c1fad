"""Many missions in one daemon leave nothing behind, and a replay follows all of them.

A thousand are ``python -m benchmarks missions``.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.missions import growth, missions
from tests.kit.logs import read_log
from wayfarer.fieldlog.folders import newest_run
from wayfarer.fieldlog.replay import replay

MISSIONS = 20


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"):
        monkeypatch.delenv(name, raising=False)
    with tempfile.TemporaryDirectory(prefix="wf-") as short:
        yield Path(short)


def test_missions_in_one_daemon_leave_nothing_behind(folder: Path) -> None:
    samples = missions(folder, MISSIONS, idle_s=1.0)
    assert growth(samples, objects=2000.0) == []
    run = newest_run(folder / "logs")
    assert run is not None
    told = [record for record in read_log(run) if record.get("name") == "mission_ended"]
    assert [record["mission"] for record in told] == list(range(1, len(told) + 1))
    assert [record["mission_ended"] for record in told[:3]] == ["mission_distance"] * 2 + ["requested by a person"]
    assert len(told) == MISSIONS
    replayed = replay(run)
    assert (replayed.difference, replayed.cut_elapsed_s) == (None, None)
    assert replayed.ticks > 20 * MISSIONS
