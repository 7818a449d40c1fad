"""The computer's own health: what a Raspberry Pi says, and what another computer does not."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from wayfarer.commissioning.checks.system import THROTTLED
from wayfarer.daemon import storage
from wayfarer.daemon.storage import CPU_TEMPERATURE, health, monitor_host_health


def write(root: Path, path: str, text: str) -> None:
    (root / path.lstrip("/")).parent.mkdir(parents=True, exist_ok=True)
    (root / path.lstrip("/")).write_text(text)


def test_a_pi_tells_of_heat_and_power(tmp_path: Path) -> None:
    write(tmp_path, CPU_TEMPERATURE, "61341\n")
    write(tmp_path, THROTTLED, "50005\n")
    found = health(tmp_path, tmp_path)
    assert (found["cpu_c"], found["throttled"]) == (61.341, "50005")
    assert isinstance(found["disk_free_mb"], float)


@pytest.mark.parametrize("text", ["", "hot", "\xff"])
def test_what_is_not_told_is_none(tmp_path: Path, text: str) -> None:
    write(tmp_path, CPU_TEMPERATURE, text)
    found = health(tmp_path / "gone", tmp_path)
    assert (found["cpu_c"], found["throttled"], found["disk_free_mb"]) == (None, None, None)


def test_watch_tells_at_once_and_ends_when_it_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "EVERY_S", 0.01)
    monkeypatch.setattr(storage, "POWER_EVERY_S", 0.01)
    write(tmp_path, THROTTLED, "50005\n")
    told: list[float | str | None] = []
    enough = threading.Semaphore(0)

    def take(found: float | str | None) -> None:
        told.append(found)
        if told.count(found) == 3:
            enough.release()
            raise RuntimeError("Event loop is closed")

    with monitor_host_health(tmp_path, lambda found, _: take(found["throttled"]), take, root=tmp_path):
        assert enough.acquire(timeout=5.0)
        assert enough.acquire(timeout=5.0)
    assert {"50005", 0x50005} <= set(told)
    for thread in [each for each in threading.enumerate() if each.name in {"computer watch", "power watch"}]:
        thread.join(5.0)
        assert not thread.is_alive()


def test_card_that_hangs_does_not_hold_up_the_power_flags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "POWER_EVERY_S", 0.01)
    write(tmp_path, THROTTLED, "1\n")
    answers, polled = threading.Event(), threading.Semaphore(0)

    def hang() -> None:
        answers.wait(5.0)

    with monitor_host_health(tmp_path, lambda *_: hang(), lambda _: polled.release(), root=tmp_path):
        for _ in range(3):
            assert polled.acquire(timeout=5.0)
        answers.set()
