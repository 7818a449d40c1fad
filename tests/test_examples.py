"""The examples run as they stand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example: Path) -> None:
    done = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, check=True)
    assert done.stdout
    assert not done.stderr


def test_escape_handler_alone_goes_through_a_whole_episode() -> None:
    example = next(path for path in EXAMPLES if path.stem == "escape_handler_alone")
    done = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, check=True)
    events = [line.split()[2] for line in done.stdout.splitlines()]
    assert events == ["follow.anomaly", "back_off.done", "turn_away.done", "probe.realigned"]
