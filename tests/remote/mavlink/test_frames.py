"""Frames in what arrives: garbage loses none of them, and nothing grows."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import common

from tests.remote.mavlink.station import Encoder, heartbeat, stick
from wayfarer.remote.mavlink.link import INPUT_BYTES, LONGEST_BYTES, FrameReader


def read(data: bytes, size: int, gap_s: float = 0.001) -> list[int]:
    """The sequence numbers of the frames in a stream that arrives in pieces."""
    reader, found = FrameReader(), []
    for place, begin in enumerate(range(0, len(data), size)):
        found += [frame[4] for frame in reader.feed(data[begin : begin + size], place * gap_s)]
    return found


@pytest.mark.parametrize("size", [1, 7, 64, INPUT_BYTES])
@pytest.mark.parametrize("signs", [False, True])
def test_frames_are_found_however_the_stream_is_cut(size: int, signs: bool) -> None:
    encoder = Encoder(signs=signs)
    stream = b"".join(encoder.frame(heartbeat()) for _ in range(20))
    assert read(stream, size) == list(range(20))


def test_stray_markers_lose_no_frame_though_pymavlinks_own_parser_loses_ten() -> None:
    encoder = Encoder()
    stream = b"\xfd\xff" + b"".join(encoder.frame(stick(1000, 0)) for _ in range(20))
    theirs = common.MAVLink(None)
    theirs.robust_parsing = True
    kept = sum(each.get_type() == "MANUAL_CONTROL" for each in theirs.parse_buffer(stream) or [])
    assert kept < 15
    assert read(stream, 10) == list(range(20))


def test_frame_behind_a_stray_marker_is_read_once_no_frame_could_take_so_long() -> None:
    reader, encoder = FrameReader(), Encoder()
    assert not list(reader.feed(b"\xfd\xff" + encoder.frame(heartbeat()), 0.0))
    assert not list(reader.feed(encoder.frame(heartbeat()), 0.06))
    assert [frame[4] for frame in reader.feed(encoder.frame(heartbeat()), 0.12)] == [0, 1, 2]


def test_frames_that_are_damaged_of_version_1_or_with_unknown_flags_are_not_read() -> None:
    good = Encoder().frame(heartbeat())
    flags = bytearray(good)
    flags[2] = 0x02
    bad = bytearray(good)
    bad[12] ^= 1
    unknown = bytearray(good)
    unknown[9] = 0xFF  # a message that the dialect does not have
    for data in (flags, bad, unknown, good[:-1], Encoder().frame(heartbeat(), force_mavlink1=True)):
        assert not list(FrameReader().datagram(bytes(data)))


def test_reader_holds_no_more_than_a_frame_and_a_datagram_leaves_nothing() -> None:
    reader = FrameReader()
    for data in (b"\xfd" * 5_000, b"\xfd\xff\x01" * 3_000, bytes(range(256)) * 30):
        assert not list(reader.feed(data, 0.0))
        assert len(reader._rest) < LONGEST_BYTES
    assert not list(FrameReader().datagram(b"\xfd\xff"))
