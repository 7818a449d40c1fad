"""The real daemon is suspended while it drives, and woken: the rover warns before its wheels turn again."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import signal
import time

import pytest

from tests.system.hil_setup import DEADMAN_S, hil_site, wait_for


@pytest.mark.slow
@pytest.mark.parametrize("rover", DEADMAN_S)
@pytest.mark.parametrize("suspended_s", [1.5, 3.0])
def test_wheels_turn_again_a_second_after_the_daemon_is_woken_or_not_at_all(rover: str, suspended_s: float) -> None:
    with hil_site(rover) as where:
        daemon = where.armed()
        daemon.send_signal(signal.SIGSTOP)
        time.sleep(suspended_s)
        woken_s = time.monotonic()
        daemon.send_signal(signal.SIGCONT)
        wait_for("it turns again or is disarmed", lambda: where.turning or where.status()["mode"] == "disarmed")
        turns_s = [t_s - woken_s for t_s, left, right in where.commands(woken_s) if left or right]
        assert not turns_s or turns_s[0] > 0.9
        causes = [record["cause"] for record in where.log() if record.get("name") == "health"]
        assert "resume_warning" in causes or "motors_failed" in causes, "the latter where it slept amid a transfer"
