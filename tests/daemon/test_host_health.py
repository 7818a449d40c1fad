"""The computer's own health: what a Raspberry Pi says, and what another computer does not."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from wayfarer.commissioning.checks.system import THROTTLED
from wayfarer.daemon.storage import CPU_TEMPERATURE, Watch, health, watching


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


def test_watch_calls_at_once_and_again_and_ends_when_it_is_left() -> None:
    enough = threading.Semaphore(0)

    def call() -> None:
        enough.release()
        raise RuntimeError("Event loop is closed")

    with watching(Watch("watch", 0.01, call), Watch("another watch", 60.0, call)):
        for _ in range(4):
            assert enough.acquire(timeout=5.0)
    for thread in [each for each in threading.enumerate() if each.name in {"watch", "another watch"}]:
        thread.join(5.0)
        assert not thread.is_alive()


def test_card_that_hangs_does_not_hold_up_the_power_flags() -> None:
    answers, polled = threading.Event(), threading.Semaphore(0)
    with watching(Watch("card", 0.01, lambda: assert_set(answers)), Watch("power", 0.01, polled.release)):
        for _ in range(3):
            assert polled.acquire(timeout=5.0)
        answers.set()


def assert_set(event: threading.Event) -> None:
    assert event.wait(5.0)
