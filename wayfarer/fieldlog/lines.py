"""Lines of a log: each ends with its checksum, so a line that changed after it was written is known by itself.

A line is one JSON object. Its last key is ``crc``: the CRC-32 of all bytes before that key, eight hexadecimal digits. A
log of schema 2 has none, and its lines are read without.
"""

from __future__ import annotations

from zlib import crc32

import orjson

from wayfarer.fieldlog.kinds import is_record, needs_checksums, wrong_key
from wayfarer.fieldlog.schema import Record

LINE_BYTES = 1_000_000  # far more than any record: the header of a simulated forest has 20,000
CRC_KEY = b',"crc":"'
CRC_BYTES = len(CRC_KEY) + len(b'01234567"}')  # at the end of each line


def sealed(record: Record) -> bytes:
    """Return the line of a record, with its checksum and without its end of line; what is no JSON is told by its repr.

    Raises:
        TypeError: a key is no text, or a whole number has more than 64 bits.
    """
    body = orjson.dumps(record, default=repr)[:-1]  # no record is empty, so the key follows another
    return body + b',"crc":"%08x"}' % crc32(body)


def sealed_at(line: bytes, record: Record) -> bytes:
    """Return the line of a record at the time of the line that it stands before."""
    times = orjson.loads(line)
    return sealed(record | {key: times.get(key) for key in ("t_s", "t_wall")})


class LogLines:
    """Takes the lines of one log in their order, and tells which are records in their place.

    The log may begin in any line, so that each file, and the end of a file, can be read alone. ``missing`` counts the
    numbers of records that were skipped.
    """

    def __init__(self) -> None:
        self.missing = 0
        self._highest = 0
        self._has_checksums = False  # known from the first line that has one, or from a header of schema 3

    def take(self, line: bytes) -> Record | str:
        """Return the record of the next line, without its checksum, or which field of ``Damage`` counts the line."""
        if b"\0" in line:
            return "nul"
        if not line.endswith(b"\n"):
            return "oversized" if len(line) >= LINE_BYTES else "torn"
        body, end = line[: -CRC_BYTES - 1], line[-CRC_BYTES - 1 :]
        has_checksum = end.startswith(CRC_KEY)
        if has_checksum and end != b'%b%08x"}\n' % (CRC_KEY, crc32(body)):
            return "changed"
        try:
            record = orjson.loads(line)
        except ValueError:
            return "garbled"
        if not is_record(record):
            return "garbled"
        self._has_checksums = self._has_checksums or has_checksum or needs_checksums(record)
        if has_checksum:
            del record["crc"]
        elif self._has_checksums:  # the key itself was damaged
            return "changed"
        if wrong_key(record) is not None:
            return "wrong"
        return record if self._goes_on(record) else "disordered"

    def _goes_on(self, record: Record) -> bool:
        """Return whether a record has a larger number than all before it: else it is there twice, or was moved.

        Headers and ``log_gap`` have no number: the files are divided, and lose lines, where no number is known.
        """
        number = record.get("n")
        if number is None:
            return True
        if number <= self._highest:
            return False
        self.missing += number - self._highest - 1
        self._highest = number
        return True
