"""MAVLink 2 frames in what arrives: where they begin and end, and whether they are whole. Pure.

A frame (https://mavlink.io/en/guide/serialization.html): marker, payload length, two bytes of flags, sequence number,
system, component, three bytes of message number, payload, checksum, and if the first flag says so a signature of 13
bytes, which nobody looks at: there is nothing that only some may ask for. MAVLink 1 is not read.

pymavlink's own parser is not used: after a stray marker it skips as many bytes as the next byte says, with all good
frames in them (10 of 20 were lost after the two bytes FD FF). Here only the marker is skipped.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from pymavlink.dialects.v20 import common

MARKER = 0xFD
HEADER_BYTES, CHECKSUM_BYTES, SIGNATURE_BYTES = 10, 2, 13
LONGEST_BYTES = HEADER_BYTES + 255 + CHECKSUM_BYTES + SIGNATURE_BYTES
SIGNED = 0x01  # the only flag that a reader must know
# Looked at in one turn of the loop; a station puts a frame or a few into a datagram.
INPUT_BYTES = 2_048
WHOLE_WITHIN_S = 0.1  # the longest frame takes 0.05 s at 57,600 baud


class FrameReader:
    """Finds the frames in a stream, or in datagrams. Never holds more than ``LONGEST_BYTES`` between two calls.

    Each frame that it yields has a right checksum, and its message is one of the dialect ``common``.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._since_s = 0.0

    def feed(self, data: bytes, now_s: float) -> Iterator[bytes]:
        """Yield the frames that bytes of a stream complete; at most ``INPUT_BYTES`` of them are looked at."""
        if self._rest and now_s - self._since_s > WHOLE_WITHIN_S:
            yield from self._found(self._rest, now_s, at_end=True)  # no frame takes so long: the marker was a stray one
        yield from self._found(self._rest + data[:INPUT_BYTES], now_s, at_end=False)

    def datagram(self, data: bytes) -> Iterator[bytes]:
        """Yield the frames of a datagram, which never go on in the next one."""
        yield from self._found(data[:INPUT_BYTES], 0.0, at_end=True)

    def _found(self, data: bytes, now_s: float, *, at_end: bool) -> Iterator[bytes]:
        place, was_waiting, self._rest = data.find(MARKER), bool(self._rest), b""
        while place >= 0:
            length = _length(data, place)
            if length is None or place + length > len(data):
                if not at_end:
                    self._rest = data[place:]
                    self._since_s = self._since_s if was_waiting and place == 0 else now_s
                    return
                length = 0
            frame = data[place : place + length]
            if is_whole := length > 0 and _is_whole(frame):
                yield frame
            place = data.find(MARKER, place + (length if is_whole else 1))


def _length(data: bytes, place: int) -> int | None:
    """Return how long the frame that begins here would be; None if too little is there to tell."""
    if len(data) < place + 3:
        return None
    signature = SIGNATURE_BYTES if data[place + 2] & SIGNED else 0
    return HEADER_BYTES + data[place + 1] + CHECKSUM_BYTES + signature


def _is_whole(frame: bytes) -> bool:
    """Return whether the checksum is right; a message that the dialect does not have cannot be checked."""
    message = common.mavlink_map.get(int.from_bytes(frame[7:10], "little"))
    if message is None or frame[2] & ~SIGNED:
        return False
    end = HEADER_BYTES + frame[1]
    (checksum,) = struct.unpack_from("<H", frame, end)
    return bool(common.x25crc(frame[1:end] + bytes([message.crc_extra])).crc == checksum)
