"""Whose frames are believed, and our own time."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.views.mavlink.station import KEY, NOW_S, Encoder, heartbeat
from wayfarer.errors import BadConfig
from wayfarer.views.mavlink.frames import Frame
from wayfarer.views.mavlink.signing import (
    MOST_TICKS,
    STREAMS,
    TICKS_PER_S,
    Signing,
    TimeFile,
    read_key,
    signing_ticks,
)

NOW = signing_ticks(NOW_S)


def frame(encoder: Encoder) -> Frame:
    return Frame(encoder.frame(heartbeat()))


def test_frame_with_the_key_is_believed_once() -> None:
    signing, sent = Signing(KEY, 0, NOW_S), frame(Encoder(KEY))
    assert [signing.is_genuine(sent), signing.is_genuine(sent)] == [True, False]


def test_unsigned_wrongly_signed_and_changed_frames_are_not_believed() -> None:
    signing = Signing(KEY, 0, NOW_S)
    changed = bytearray(frame(Encoder(KEY)).data)
    changed[5] = 254  # another sender
    assert not any(
        signing.is_genuine(each) for each in (frame(Encoder()), frame(Encoder(bytes(32), NOW)), Frame(bytes(changed)))
    )


def test_forged_frame_from_the_future_does_not_shut_out_the_station() -> None:
    signing, station = Signing(KEY, 0, NOW_S), Encoder(KEY)
    assert signing.is_genuine(frame(station))
    assert not signing.is_genuine(frame(Encoder(bytes(32), MOST_TICKS - 9)))  # of the same sender and link
    assert signing.is_genuine(frame(station))


@pytest.mark.parametrize(("behind_s", "believed"), [(59, True), (61, False), (-10_000, True)])
def test_new_sender_may_be_a_minute_behind_us_and_ahead_as_far_as_it_likes(behind_s: int, believed: bool) -> None:
    assert Signing(KEY, 0, NOW_S).is_genuine(frame(Encoder(KEY, NOW - behind_s * TICKS_PER_S))) is believed


def test_our_time_goes_on_where_the_clock_stands_back_and_follows_the_station() -> None:
    signing = Signing(KEY, 0, NOW_S)
    first = signing.now_ticks(NOW_S, 50.0)
    assert signing.now_ticks(0.0, 50.0) == first + 1  # the clock was set back to 1970
    assert signing.now_ticks(0.0, 60.0) == first + 1 + 10 * TICKS_PER_S  # idle for 10 s
    assert signing.is_genuine(frame(Encoder(KEY, NOW + 1_000 * TICKS_PER_S)))
    assert signing.now_ticks(NOW_S, 60.0) > NOW + 1_000 * TICKS_PER_S


def test_restart_with_a_wrong_clock_believes_no_recording_and_our_time_does_not_go_back(tmp_path: Path) -> None:
    before, recorded, kept = Signing(KEY, 0, NOW_S), frame(Encoder(KEY)), TimeFile(tmp_path / "state" / "mavlink_time")
    assert kept.read() == 0
    assert before.is_genuine(recorded)
    kept.write(before.reserve())
    after = Signing(KEY, kept.read(), 0.0)
    assert not after.is_genuine(recorded)
    assert after.now_ticks(0.0, 1.0) > before.now_ticks(NOW_S, 1.0)


@pytest.mark.parametrize("content", [b"", b"nonsense", b"-5", b"9" * 40])
def test_damaged_time_file_counts_as_none(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "time").write_bytes(content)
    assert TimeFile(tmp_path / "time").read() == 0


def test_senders_that_are_remembered_are_bounded() -> None:
    signing = Signing(KEY, 0, NOW_S)
    believed = [signing.is_genuine(frame(Encoder(KEY, system=number))) for number in range(1, 255)]
    assert sum(believed) == STREAMS


def test_key_is_what_stations_make_of_the_passphrase(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text("a passphrase for tests\n")
    path.chmod(0o600)
    assert read_key(path) == KEY


@pytest.mark.parametrize(
    ("content", "mode", "why"),
    [
        ("a passphrase for tests", 0o640, "chmod 600"),
        ("too short", 0o600, "16 characters"),
        (None, 0, "cannot be read"),
    ],
)
def test_key_that_cannot_be_used_is_refused_with_what_to_do(
    tmp_path: Path, content: str | None, mode: int, why: str
) -> None:
    path = tmp_path / "key"
    if content is not None:
        path.write_text(content)
        path.chmod(mode)
    with pytest.raises(BadConfig, match=why):
        read_key(path)
