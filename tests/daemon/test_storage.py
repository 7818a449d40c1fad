"""The storage side of a daemon: trouble is told once in a run and shown while it lasts; runs go only while disarmed."""

from __future__ import annotations

from pathlib import Path

import pytest

from wayfarer.commissioning.checks.system import CardHealth
from wayfarer.config.rover_file import LogSettings
from wayfarer.control.run_log import RunLog
from wayfarer.daemon.storage import Storage
from wayfarer.fieldlog.retention import Pruned
from wayfarer.fieldlog.sink import Sink
from wayfarer.waiting_thread import OneCall

WELL, IN_MEMORY = CardHealth(False, ""), CardHealth(False, "tmpfs")


class Site(RunLog):
    """The storage of a run, and what it has logged."""

    def __init__(self, logs: Path) -> None:
        self.events: list[tuple[str, dict[str, object]]] = []
        self.armed = False
        self.sink = Sink(logs / "00009-20261121T061405Z")
        self.storage = Storage(
            logs / "00009-20261121T061405Z",
            LogSettings(keep_mb=10),
            self.sink,
            self,
            lambda: not self.armed,
        )

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take what is told."""
        self.events.append((name, details))


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path)


def test_trouble_of_the_card_is_told_once_and_shown_while_it_lasts(site: Site) -> None:
    for health, shown in ((WELL, 0), (IN_MEMORY, 1), (WELL, 0), (IN_MEMORY, 1)):
        site.storage.take_health(1.0, health)
        assert len(site.storage.status()["storage_warnings"]) == shown
    ((name, details),) = site.events
    assert name == "card"
    assert "in memory (tmpfs)" in str(details["text"])


def test_slowest_write_since_the_last_look_is_told(site: Site) -> None:
    site.sink._slowest_s = 2.5
    assert site.storage.take_health(1.0, WELL) == 2500.0
    (told,) = site.storage.status()["storage_warnings"]
    assert told.startswith("it took 2.5 s to store records: it is worn")
    assert site.storage.take_health(11.0, WELL) == 0.0
    assert site.storage.status()["storage_warnings"] == []


def test_old_runs_are_deleted_while_disarmed_only(site: Site, tmp_path: Path) -> None:
    for number in (1, 9):
        run = tmp_path / f"{number:05d}-20261121T061405Z"
        run.mkdir()
        with (run / "run.00001.jsonl").open("wb") as file:
            file.truncate(9_000_000)
    site.armed = True
    assert site.storage.delete_old_runs() is None
    site.armed = False
    pruned = site.storage.delete_old_runs()
    assert pruned is not None
    assert pruned.deleted == ("00001-20261121T061405Z",)


def test_run_that_was_marked_is_kept_and_it_is_shown_while_it_cannot_be(site: Site, tmp_path: Path) -> None:
    def keep() -> list[str]:
        site.storage.keep()
        site.storage._keeping.join(5.0)
        warnings: list[str] = site.storage.status()["storage_warnings"]
        return warnings

    (warning,) = keep()
    assert warning.startswith("this run can be deleted, although it was marked: ")
    run = tmp_path / "00009-20261121T061405Z"
    run.mkdir()
    assert keep() == []
    assert [path.name for path in run.iterdir()] == ["keep"]


def test_run_that_no_thread_can_keep_is_told_and_the_mark_counts(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_: OneCall) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(OneCall, "start", fails)
    site.storage.keep()
    (warning,) = site.storage.status()["storage_warnings"]
    assert warning.endswith("although it was marked: can't start new thread")


def test_what_was_deleted_is_counted_and_each_reason_for_what_was_not_is_told_once(site: Site) -> None:
    for _ in range(2):
        site.storage.take_pruned(1.0, Pruned(("00001-x",), 50.0, 70.0, "no room in the shed"))
    assert site.storage.status()["runs_deleted"] == 2
    assert site.storage.status()["storage_warnings"] == ["no room in the shed"]
    assert [name for name, _ in site.events] == ["runs_deleted", "runs_not_deleted", "runs_deleted"]
    site.storage.take_pruned(2.0, Pruned((), 0.0, 70.0))
    assert site.storage.status()["storage_warnings"] == []
