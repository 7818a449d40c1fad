"""What the index tells of a run beyond its two ends, found in the bytes of its log: ticks are not parsed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from wayfarer.errors import BadInput
from wayfarer.fieldlog.fields import safe_text
from wayfarer.fieldlog.lines import LINE_BYTES, LogLines
from wayfarer.fieldlog.reader import log_segments
from wayfarer.files import open_regular

# Parts of lines as ``lines.sealed`` writes them.
MARK = b'"name":"mark"'
# The second is of a tick that saw nothing. The length is bounded: a line may be made to be searched for hours.
ANOMALIES = re.compile(rb'"anomalies":\[([^]]{0,200})\]|"heading_deg":null,"phase":')
BLOCK_BYTES = 4_000_000
MOST_BYTES = 2_000_000_000  # of a run: twice ``log.run_mb``


class RunFindings(NamedTuple):
    """How many anomalies began, as ``RunFold`` counts them, and the texts of a person's marks, in their order."""

    anomalies: int = 0
    marks: tuple[str, ...] = ()


def findings_of(run: Path) -> RunFindings | None:
    """Return what is found in a run's log, damaged or not; None where it cannot be read, or is too large to search."""
    began, marks, left_bytes = _Began(), list[str](), MOST_BYTES
    try:
        for segment in log_segments(run):
            with open_regular(segment) as file:
                for block in _blocks(file):
                    left_bytes -= len(block)
                    if left_bytes < 0:
                        return None
                    began.take(block)
                    marks += _marks(block)
    except (BadInput, OSError):
        return None
    return RunFindings(began.count, tuple(marks))


class _Began:
    """Counts the anomalies that a tick has and the tick before it had not."""

    def __init__(self) -> None:
        self.count = 0
        self._before = b""

    def take(self, block: bytes) -> None:
        for now in ANOMALIES.findall(block):
            if now != self._before:
                self.count += len(set(now.split(b",")) - {b"", *self._before.split(b",")})
                self._before = now


def _blocks(file: BinaryIO) -> Iterator[bytes]:
    """Give the content of a file in blocks of whole lines."""
    rest = b""
    while read := file.read(BLOCK_BYTES):
        whole, end, rest = (rest + read).rpartition(b"\n")
        yield whole + end
        rest = b"" if len(rest) > LINE_BYTES else rest  # no record


def _marks(block: bytes) -> Iterator[str]:
    at = block.find(MARK)
    while at >= 0:
        begin, end = block.rfind(b"\n", 0, at) + 1, block.find(b"\n", at) + 1
        record = LogLines().take(block[begin:end])
        if isinstance(record, dict) and record.get("name") == "mark":
            yield safe_text(record, "text") or "mark"
        at = block.find(MARK, end)
