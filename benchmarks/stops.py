"""Are the wheels still stopped, and as soon as before? The tests of stops over simulated chips, with real processes.

They judge; this prints beside each group how many of its tests passed and the times that they measured. Of kills and
brown-outs, which strike at random instants, there are more than in the tests' own run.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys

from benchmarks.figures import print_table

KILLS = 20  # about three seconds each
GROUPS = {
    "stop bench: signals, suspension, a person who holds the key": ("test_stop_owners.py", "test_signals.py"),
    "brown-out of the board, death of the computer": ("test_brown_out.py",),
    "kills at random instants": ("test_sigkill.py",),
    "stop-motors, other files and other users": ("test_stop_recorded.py",),
    "no memory or descriptor left, disks that hang for ever": ("test_stops_get_in.py",),
    "floods of socket and page": ("test_floods.py",),
}
MEASURED = re.compile(r"(?:stood after|stop after|stopped) ([\d.]+) s")
COUNT = re.compile(r"(\d+) (passed|failed|error|skipped|rerun)")


def print_stops(kills: int = KILLS) -> int:
    """Run the tests, print a Markdown table, and return the exit code: 1 if a test failed."""
    rows, failed = [], 0
    for name, files in GROUPS.items():
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-s",
            "-n",
            "0",
            "-p",
            "no:cacheprovider",
            "-m",
            "process or long",
        ]
        done = subprocess.run(
            [*command, *(f"tests/system/{file}" for file in files)],
            env={**os.environ, "KILLS": str(kills)}, capture_output=True, text=True, check=False,
        )  # fmt: skip
        lines = done.stdout.rstrip().splitlines()
        counts = ", ".join(f"{count} {what}" for count, what in COUNT.findall(lines[-1] if lines else ""))
        stood_s = sorted(map(float, MEASURED.findall(done.stdout)))
        times = f"{stood_s[len(stood_s) // 2]:.3f}, {stood_s[-1]:.3f}" if stood_s else ""
        rows.append((name, counts, times))
        if done.returncode:
            failed = 1
            print(done.stdout[-4000:], done.stderr[-1000:], sep="\n")
    print_table(("what", "tests", "wheels stopped after s: median, most"), rows)
    return failed
