"""One file of a log. Lines are appended completely or not at all, and a removed file is noticed."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from wayfarer.files.atomic_file import sync_folder

# Appending: whatever else happens to the file, a line never lands in the middle of it.
FLAGS = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC


class Segment:
    """Makes a new file that begins with a header, and appends to it; what fails raises ``OSError``.

    ``lines`` and ``size`` count the whole lines in it and their bytes, the header's included. Once it is no longer
    ``fit``, it cannot be trusted with more lines: a write or its repair failed, or the file is not where it was made.

    Raises:
        OSError: it cannot be made, or exists; nothing is left of it then.
    """

    def __init__(self, path: Path, header: bytes) -> None:
        self._path = path
        self.lines = self.size = 0
        self.fit = True
        self._file = os.open(path, FLAGS, 0o644)
        try:
            self.append([header])
            self.sync()
        except OSError:
            self.close()
            with suppress(OSError):
                path.unlink()
            raise
        sync_folder(path.parent)

    def append(self, lines: Iterable[bytes]) -> None:
        """Append lines, each without its end. Where this fails, those that went in whole stay."""
        data = memoryview(b"".join(line + b"\n" for line in lines))
        done = 0
        try:
            while done < len(data):
                done += os.write(self._file, data[done:])
        except OSError:
            self._keep(bytes(data[:done]))
            raise
        self._count(bytes(data))

    def sync(self) -> None:
        """Return when all is on the disk, and the file at its path is still this one, unchanged by other programs."""
        try:
            os.fdatasync(self._file)
            ours, there = os.fstat(self._file), self._path.stat()
            if not os.path.samestat(ours, there) or there.st_size != self.size:
                raise OSError(errno.ESTALE, "File was changed by another program")
        except OSError:
            self.fit = False
            raise

    def close(self) -> None:
        """Close the file; safe twice."""
        file, self._file = self._file, -1
        if file >= 0:
            with suppress(OSError):
                os.close(file)

    def _keep(self, written: bytes) -> None:
        """Keep the whole lines of what was written, and take away the beginning of the next."""
        whole = written[: written.rfind(b"\n") + 1]
        self._count(whole)
        if len(whole) < len(written):
            try:
                os.ftruncate(self._file, self.size)
            except OSError:
                self.fit = False

    def _count(self, data: bytes) -> None:
        self.size += len(data)
        self.lines += data.count(b"\n")
