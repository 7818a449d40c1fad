"""A running daemon imports nothing more: a module from a slow card would block the loop, and with it a stop."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from wayfarer.config.rover_path import SHIPPED

# A daemon in the main thread, and its client in another, which sees what was imported while it asked.
PROGRAM = """
import json, os, sys, threading, time
from pathlib import Path
from wayfarer import cli
from wayfarer.daemon.socket.client import ask
from wayfarer.errors import WayfarerError

def client():
    while not Path(os.environ["RUNTIME_DIRECTORY"], "control.sock").exists():
        time.sleep(0.05)
    time.sleep(2.0)  # the parts are open, and it ticks
    before, answers = set(sys.modules), []
    for request in json.loads(sys.argv[1]):
        try:
            answers.append(ask(request).get("mode"))
        except WayfarerError as error:
            answers.append(str(error))
        time.sleep(0.3)
    print(json.dumps([answers, sorted(set(sys.modules) - before)]), flush=True)
    ask({"do": "stop"})

threading.excepthook = lambda error: os._exit(3)
threading.Thread(target=client, daemon=True).start()
cli.run(sys.argv[2:])
"""
ARM = {"do": "arm", "heading_deg": 0.0}
BY_HAND = {"do": "manual_begin", "driver": "test"}
STATUS = {"do": "status"}


@pytest.mark.process
@pytest.mark.parametrize(
    ("requests", "answers", "reason"),
    [
        ([ARM, STATUS, {"do": "disarm"}], ["arming", "arming", "disarmed"], "simulated chips"),
        ([BY_HAND, STATUS], ["manual", "manual"], "simulated chips"),
        ([ARM, STATUS], ["not armed: deadman proved", "disarmed"], ""),
    ],
    ids=["arm", "drive by hand", "refused"],
)
def test_first_request_of_a_running_daemon_imports_nothing(
    tmp_path: Path, requests: list[dict[str, object]], answers: list[str], reason: str
) -> None:
    text = (SHIPPED / "forestrover.toml").read_text(encoding="utf-8")
    text = text.replace("[safety]\n", '[safety]\ndeadman_unproved_because = "' + reason + '"\n')
    file = tmp_path / "rover.toml"
    file.write_text(f'buses = "examples.simulated_chips:buses"\n{text}', encoding="utf-8")
    (tmp_path / "session").mkdir(mode=0o700)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps(requests), "run", "--manual", "--rover", str(file),
         "--log-dir", str(tmp_path / "logs")],
        env={**os.environ, "RUNTIME_DIRECTORY": str(tmp_path / "session"), "HOME": str(tmp_path)},
        cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=30, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    answered, imported = json.loads(done.stdout.splitlines()[0])
    assert [told in answer for told, answer in zip(answers, answered, strict=True)] == [True] * len(answers), answered
    assert imported == []
