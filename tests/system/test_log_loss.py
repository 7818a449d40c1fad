"""What a killed process and a power cut cost of a log: 0.2 s and a second, at random instants of a real process.

More often: ``KILLS=100 pytest -n 0 -s tests/system/test_log_loss.py``.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

import pytest

from tests.children import child
from tests.fieldlog.disks import ext4_image, mounted

KILLS = int(os.environ.get("KILLS", "8"))
KILLED_LOSES_S, CUT_LOSES_S = 0.2, 1.0
TICK_S = 0.005  # far more often than a rover, so that a loss is measured finely
BUSY_S = 0.1  # how late a thread may be on a computer that does other things
LIVES_S = 1.5
# Writes a tick all the time, and now and then an event; ``t_s`` is the time at which the log took it.
WRITES = f"""
import sys, time
from pathlib import Path
from random import Random
from wayfarer.config.rover_file import LogSettings
from wayfarer.fieldlog.sink import Sink
log = Sink(Path(sys.argv[1]), LogSettings(part_mb=1, free_mb=0), print, time.monotonic)
log.open(lambda part: b'{{"record":"run","t_s":%f,"part":%d}}' % (time.monotonic(), part))
rng = Random(int(sys.argv[2]))
while True:
    log.put(b'{{"record":"tick","t_s":%f}}' % time.monotonic(), urgent=rng.random() < 0.002)
    time.sleep({TICK_S})
"""


@contextmanager
def writing(run: Path, seed: int) -> Iterator[subprocess.Popen[bytes]]:
    """Have a process write a log, and wait until it does."""
    with child([sys.executable, "-c", WRITES, run, str(seed)], stdout=subprocess.DEVNULL) as process:
        ends_s = time.monotonic() + 30.0
        while last_s(run) is None:
            assert time.monotonic() < ends_s
            time.sleep(0.01)
        yield process


def last_s(run: Path) -> float | None:
    """Return the time of the last record in a log; each line but the very last must be whole."""
    parts = sorted(run.glob("run.*.jsonl"))
    lines = [line for part in parts for line in part.read_bytes().splitlines(keepends=True)]
    if lines and not lines[-1].endswith(b"\n"):
        lines.pop()
    times_s = [json.loads(line)["t_s"] for line in lines]
    return times_s[-1] if times_s else None


def told(what: str, losses_s: list[float]) -> float:
    """Return the largest loss, and print it."""
    mean_s = sum(losses_s) / len(losses_s)
    print(f"{what}: {len(losses_s)} times, at most {max(losses_s):.3f} s of log lost, {mean_s:.3f} s on average")
    return max(losses_s)


@pytest.mark.process
def test_killed_process_loses_a_fifth_of_a_second(tmp_path: Path) -> None:
    rng, losses_s = Random(45), list[float]()
    for number in range(KILLS):
        with writing(tmp_path / str(number), number) as process:
            time.sleep(rng.uniform(0.0, LIVES_S))
            killed_s = time.monotonic()
            process.send_signal(signal.SIGKILL)
            process.wait()
        last = last_s(tmp_path / str(number))
        assert last is not None
        losses_s.append(killed_s - last)
    assert told("SIGKILL", losses_s) <= KILLED_LOSES_S + BUSY_S


@pytest.mark.process
def test_power_cut_loses_a_second(tmp_path: Path) -> None:
    """What the disk has at an instant is what is in its image then: all else is in the computer's memory."""
    image, rng, losses_s = ext4_image(tmp_path / "image"), Random(45), list[float]()
    with mounted(image, tmp_path / "card") as mounts:
        if not mounts:
            pytest.skip("mounting an image takes root and a loop device")
        for number in range(KILLS):
            run = tmp_path / "card" / str(number)
            with writing(run, number) as process:
                time.sleep(rng.uniform(0.0, LIVES_S))
                process.send_signal(signal.SIGSTOP)
                cut_s = time.monotonic()
                shutil.copyfile(image, tmp_path / "cut")
            shutil.rmtree(run)
            with mounted(tmp_path / "cut", tmp_path / "found"):
                last = last_s(tmp_path / "found" / run.name)
            assert last is not None
            losses_s.append(cut_s - last)
    assert told("power cut", losses_s) <= CUT_LOSES_S + BUSY_S
