"""A ground station: a stream that is garbled, and whole frames whose fields say anything, from near or far."""

from __future__ import annotations

import asyncio
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from tests.fuzz.damage import bytes_of
from tests.fuzz.target import Case, Target, Try
from tests.remote.mavlink.station import Encoder, arming, heartbeat, kinds, linked, mode, stick
from tests.virtual import run_virtually
from wayfarer.remote.mavlink.link import LONGEST_BYTES, FrameReader

SPOKEN = [
    Encoder(signs=signs).frame(message)
    for signs in (False, True)
    for message in (heartbeat(), arming(1.0), mode(4), stick(9, -9))
]
WORDS = [b"\xfd", b"\xfd\xff", b"\xfd\x00\x01", b"\xfe\x09"]


@contextmanager
def _read() -> Iterator[Try]:
    def attempt(pieces: list[bytes]) -> str:
        reader, found = FrameReader(), 0
        for place, piece in enumerate(pieces):
            found += len(list(reader.feed(piece, 0.06 * place)))
            assert len(reader._rest) < LONGEST_BYTES
        return f"{min(found, 3)} frames"

    yield attempt


STREAM = Target("mavlink-stream", st.lists(bytes_of(SPOKEN, WORDS), max_size=4), _read, quick=30)


def _frame(number: int, payload: bytes, signed: bool) -> bytes:
    """Return a frame whose checksum is right, whatever is in it."""
    kind = common.mavlink_map[number]

    message = common.MAVLink_message(number, kind.msgname)
    message.pack = lambda mavlink, **_: message._pack(mavlink, kind.crc_extra, payload or b"\0")
    return Encoder(signs=signed).frame(message)


FRAMES = st.lists(
    st.tuples(
        st.sampled_from(sorted(common.mavlink_map)) | st.sampled_from([11, 20, 21, 23, 43, 69, 75, 76, 109]),
        st.binary(max_size=40) | st.just(bytes([1] * 40)) | st.just(b"\xff" * 40),
        st.booleans(),
    ),
    min_size=1,
    max_size=8,
)


async def _talked(*, is_near: bool, spoken: Case) -> str:
    with pytest.MonkeyPatch.context() as monkeypatch:
        async with linked(monkeypatch) as link:
            link.port.is_near = is_near
            for each in spoken:
                link.port.receive(_frame(*each))
                await asyncio.sleep(1.0)
            heard = link.heard()
            assert kinds(heard)["HEARTBEAT"] >= len(spoken) - 1
            assert sum(map(len, link.port.sent)) < 3_000 * (len(spoken) + 1)
            assert {each.partition(":")[0] for each in link.rover.asked} <= {"hold", "disarm", "link_lost"}
            assert is_near or not {"hold", "disarm"} & set(link.rover.asked)
            return " ".join(sorted({each.get_type() for each in heard} & {"COMMAND_ACK", "PARAM_VALUE", "STATUSTEXT"}))


@contextmanager
def _linked() -> Iterator[Try]:
    errors: list[str] = []
    logger = SimpleNamespace(exception=lambda *_: errors.append(traceback.format_exc()))
    with pytest.MonkeyPatch.context() as monkeypatch:
        for module in ("link", "ground_station"):
            monkeypatch.setattr(f"wayfarer.remote.mavlink.{module}._log", logger)

        def attempt(case: Case) -> str:
            is_near, spoken = case
            errors.clear()
            said = run_virtually(_talked(is_near=is_near, spoken=spoken))
            assert not errors, errors
            return said

        yield attempt


STATION = Target("mavlink-station", st.tuples(st.booleans(), FRAMES), _linked, quick=20)
