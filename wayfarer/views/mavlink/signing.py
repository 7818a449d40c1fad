"""MAVLink 2 signing (https://mavlink.io/en/guide/message_signing.html): whose frames are believed, and our own time.

A signature is a link number, a time in 10 us since 2015 and 6 bytes of a SHA-256 over key, frame and time. A frame is
believed if the hash is right and the time is later than that of the frame before it from the same sender and link.
The hash is checked first: pymavlink remembers the time of a frame before it looks at the hash, so that one forged frame
from the future shuts out the real station (its ``check_signature``).

Our own time never goes back, over restarts either: a part of it is reserved ahead in a file (``TimeFile``).
"""

from __future__ import annotations

import hashlib
import hmac
import stat
from pathlib import Path

from wayfarer.errors import BadConfig
from wayfarer.fieldlog.clock import CLOCK_SET_S
from wayfarer.files import atomic_file, open_regular
from wayfarer.views.mavlink.frames import SIGNATURE_BYTES, Frame

EPOCH_S = 1_420_070_400  # 2015-01-01, from which signing counts
TICKS_PER_S = 100_000
MOST_TICKS = 2**48 - 1
# A new sender may be this far behind us (the specification's minute).
BEHIND_TICKS = 60 * TICKS_PER_S
STREAMS = 32  # senders and links; only a holder of the key makes one
PASSPHRASE_LEAST, PASSPHRASE_MOST = 16, 1_000  # characters; bytes
RESERVED_S = 600.0  # ahead, in the file, which is written twice in this time: twelve times an hour


def signing_ticks(wall_s: float) -> int:
    """Return the signing time of a wall time in seconds since 1970; 0 before 2015."""
    return min(MOST_TICKS, max(0, int((wall_s - EPOCH_S) * TICKS_PER_S)))


def read_key(path: Path) -> bytes:
    """Return the 32 bytes that sign, of a file with a passphrase, as all ground stations make them: its SHA-256.

    Raises:
        BadConfig: the file cannot be read, others may read it, or it is too short.
    """
    try:
        with open_regular(path) as file:
            mode = stat.S_IMODE(path.stat().st_mode)
            passphrase = file.read(PASSPHRASE_MOST).strip()
    except OSError as error:
        raise BadConfig(f"key 'mavlink.key_file' = {path}: cannot be read: {error.strerror}") from None
    if mode & 0o077:
        raise BadConfig(f"key 'mavlink.key_file' = {path}: other users may read it (mode {mode:04o}): chmod 600 {path}")
    if len(passphrase.decode(errors="replace")) < PASSPHRASE_LEAST:
        raise BadConfig(
            f"key 'mavlink.key_file' = {path}: a passphrase needs {PASSPHRASE_LEAST} characters or more, because who"
            " records one signed message can try passphrases for ever: openssl rand -base64 24"
        )
    return hashlib.sha256(passphrase).digest()


class TimeFile:
    """Keeps in a file which signing time was used, as decimal digits; a lost or damaged one counts as 0."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> int:
        """Return the time that a run before this one had reserved."""
        try:
            with open_regular(self._path) as file:
                digits = file.read(20).strip()
        except OSError:
            return 0
        ticks = int(digits) if digits.isdigit() else 0
        return ticks if ticks <= MOST_TICKS else 0

    def write(self, ticks: int) -> None:
        """Write a time; blocks until it is on the disk.

        Raises:
            OSError: it cannot be written.
            BadInput: something that is no file stands there.
        """
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(self._path, mode=0o600) as file:
            file.write(b"%d\n" % ticks)


class Signing:
    """The key, the times of all senders, and our own time.

    Args:
        key: the 32 bytes that sign.
        reserved_ticks: the time that an earlier run had reserved: nothing before it is believed.
        wall_s: the wall clock, seconds since 1970.
    """

    def __init__(self, key: bytes, reserved_ticks: int, wall_s: float) -> None:
        self.key = key
        self._ticks = max(reserved_ticks, signing_ticks(wall_s))
        clock_floor = signing_ticks(wall_s) - BEHIND_TICKS if wall_s >= CLOCK_SET_S else 0
        self._floor = max(reserved_ticks, clock_floor)
        self._told_s: float | None = None
        self._streams: dict[bytes, int] = {}

    def has_key(self, frame: Frame) -> bool:
        """Return whether somebody with the key has signed this frame, now or long ago."""
        if not frame.is_signed:
            return False
        digest = hashlib.sha256(self.key + frame.data[:-6]).digest()[:6]
        return hmac.compare_digest(digest, frame.data[-6:])

    def is_genuine(self, frame: Frame) -> bool:
        """Return whether somebody with the key has sent this frame, and now; if so its time counts as used."""
        if not self.has_key(frame):
            return False
        signature = frame.data[-SIGNATURE_BYTES:]
        stream, ticks = signature[:1] + frame.data[5:7], int.from_bytes(signature[1:7], "little")
        last = self._streams.get(stream)
        if last is None and len(self._streams) >= STREAMS:
            return False
        if ticks <= (max(self._floor, self._ticks - BEHIND_TICKS) if last is None else last):
            return False
        self._streams[stream] = ticks
        self._ticks = max(self._ticks, ticks)
        return True

    def reserve(self) -> int:
        """Return a time ahead of our own, for the file: what a run after this one begins with."""
        return min(MOST_TICKS, self._ticks + int(RESERVED_S * TICKS_PER_S))

    def now_ticks(self, wall_s: float, t_s: float) -> int:
        """Return the time to sign with: of the clock, or of the station if it is ahead; never twice the same.

        It goes on with ``t_s``, seconds of a clock that never goes back, also where the wall clock stands behind it.
        """
        passed = 0 if self._told_s is None else int((t_s - self._told_s) * TICKS_PER_S)
        self._told_s = t_s
        self._ticks = min(MOST_TICKS, max(self._ticks + max(1, passed), signing_ticks(wall_s)))
        return self._ticks
