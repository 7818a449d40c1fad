"""What the index tells of a run beyond its two ends, found in the bytes of its log: ticks are not parsed."""

from __future__ import annotations

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
BACKED_OFF = b'.anomaly","wanted_left":'  # the end of a tick's "why": an anomaly ended a phase
BLOCK_BYTES = 4_000_000
MOST_BYTES = 2_000_000_000  # of a run: twice ``log.run_mb``


class RunFindings(NamedTuple):
    """How often a rover backed off from an anomaly, and the texts of a person's marks, in their order."""

    backed_off: int = 0
    marks: tuple[str, ...] = ()


def findings_of(run: Path) -> RunFindings | None:
    """Return what is found in a run's log, damaged or not; None where it cannot be read, or is too large to search."""
    backed_off, marks, left_bytes = 0, list[str](), MOST_BYTES
    try:
        for segment in log_segments(run):
            with open_regular(segment) as file:
                for block in _blocks(file):
                    left_bytes -= len(block)
                    if left_bytes < 0:
                        return None
                    backed_off += block.count(BACKED_OFF)
                    marks += _marks(block)
    except (BadInput, OSError):
        return None
    return RunFindings(backed_off, tuple(marks))


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
