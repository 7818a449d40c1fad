"""Processes that end badly while they write a log; ``test_writer_thread`` starts and kills them.

``python -m tests.fieldlog.doomed write LOGS`` writes until it is killed and says on stdout, line by line, up to which
number the disk has everything; ``hang RUN`` ends while its disk does not answer.
"""

# ruff: noqa: TID251 - a process that is to be killed lives in real time
from __future__ import annotations

import sys
import threading
import time
from itertools import count
from pathlib import Path

from tests.fieldlog.lines import event, run_record, tick
from wayfarer.config.rover_file import LogSettings
from wayfarer.fieldlog import writer_thread
from wayfarer.fieldlog.folders import new_run_folder
from wayfarer.fieldlog.writer import RunFiles
from wayfarer.fieldlog.writer_thread import WriterThread


class TellingFiles(RunFiles):
    """Says what was synced."""

    taken = 0

    def bulk(self, line: bytes) -> None:
        """Take a line."""
        self.taken += 1
        super().bulk(line)

    def urgent(self, line: bytes) -> None:
        """Take a line."""
        self.taken += 1
        super().urgent(line)

    def sync(self) -> None:
        """Sync, and say up to where."""
        super().sync()
        print(self.taken, flush=True)


class HangingFiles(RunFiles):
    """On a disk that never answers again."""

    def flush(self) -> None:
        """Wait for ever."""
        threading.Event().wait()


def write(logs: Path) -> None:
    """Write a log in small parts, as fast as it goes."""
    writer_thread.WRITE_S = 0.001
    log = WriterThread(TellingFiles(new_run_folder(logs), LogSettings(part_mb=0.01, free_mb=0.0)))
    log.open(run_record)
    for number in count(1):
        if number % 30:
            log.bulk(tick(number))
        else:
            log.urgent(event(number))
        time.sleep(0.0002)


def hang(run: Path) -> None:
    """Write a line that never arrives, and end."""
    writer_thread.CLOSE_S = 0.1
    log = WriterThread(HangingFiles(run))
    log.open(run_record)
    log.urgent(event(1))
    log.close()


if __name__ == "__main__":
    {"write": write, "hang": hang}[sys.argv[1]](Path(sys.argv[2]))
