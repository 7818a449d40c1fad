"""Frames in what arrives, addresses and ports: garbage loses no frame, nothing grows, and nothing waits."""

from __future__ import annotations

import asyncio
import os
import socket
import tty
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from tests.remote.mavlink.station import Encoder, arming, heartbeat, stick
from wayfarer.commissioning.checks.system import device_files
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput, NotThereYet
from wayfarer.remote.mavlink.link import (
    INPUT_BYTES,
    LONGEST_BYTES,
    Address,
    FrameReader,
    Link,
    SerialPort,
    UdpPort,
    check_not_a_part,
    is_this_computer,
    open_port,
    parse_address,
)


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


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("udpout:192.168.1.5:14550", Address("udpout", "192.168.1.5", 14550)),
        ("udpin:[::1]:14550", Address("udpin", "::1", 14550)),
        ("serial:/dev/serial/by-id/usb-radio:0:57600", Address("serial", "/dev/serial/by-id/usb-radio:0", 57600)),
    ],
)
def test_address_is_read_and_told_as_it_was_given(text: str, address: Address) -> None:
    assert parse_address(text) == address
    assert str(address) == text


@pytest.mark.parametrize(
    "text",
    ["", "udpout", "tcp:1.2.3.4:5", "udpout:1.2.3.4", "udpout::14550", "udpout:1.2.3.4:0", "udpout:1.2.3.4:70000",
     "udpin:1.2.3.4:-1", "serial:/dev/ttyUSB0", "serial:/dev/ttyUSB0:9", "udpout:a..b:1"],
)  # fmt: skip
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="give"):
        parse_address(text)


def test_host_that_is_not_known_may_be_known_later() -> None:
    with pytest.raises(NotThereYet, match="give its IP address"):
        parse_address("udpout:no.such.invalid:1")


def test_line_of_the_motor_board_is_no_link() -> None:
    rover = load_rover("forestrover")
    board = str(rover.parts["motors"]["port"])
    with pytest.raises(BadInput, match="a part of the rover"):
        open_port(Address("serial", board, 57600), device_files(rover))
    check_not_a_part(Address("serial", "/dev/ttyUSB7", 57600), device_files(rover))


def sequences(port: UdpPort | SerialPort) -> list[tuple[int, bool]]:
    """The sequence numbers of the frames that arrived, each with whether it is of this computer."""
    return [(frame[4], is_near) for frame, is_near in port.read(0.0)]


@pytest.mark.parametrize(
    ("host", "is_near"),
    [
        ("127.0.0.1", True), ("127.1.2.3", True), ("::1", True), ("::ffff:127.0.0.1", True),
        ("192.168.1.5", False), ("::ffff:192.168.1.5", False), ("fe80::1%eth0", False), ("0.0.0.0", False),
    ],
)  # fmt: skip
def test_only_loopback_is_this_computer(host: str, is_near: bool) -> None:
    assert is_this_computer(host) is is_near


class Udp:
    """A port at ``udpin``, and stations that send to it, of this computer or, as far as it can tell, of another."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, is_near: bool) -> None:
        monkeypatch.setattr("wayfarer.remote.mavlink.link.is_this_computer", lambda _: is_near)
        self.port = UdpPort(Address("udpin", "127.0.0.1", 0))
        self.arrived = asyncio.Event()
        self.port.listen(self.arrived.set)
        self.encoder = Encoder()

    async def hears(self, station: socket.socket) -> bool:
        """Whether the port hears a heartbeat of a station."""
        self.arrived.clear()
        station.sendto(self.encoder.frame(heartbeat()), self.port._socket.getsockname())
        async with asyncio.timeout(5.0):
            await self.arrived.wait()
        return bool(sequences(self.port))


@pytest.fixture
def stations() -> Iterator[list[socket.socket]]:
    """The first and the third are on one computer, the second on another."""
    with ExitStack() as opened:
        sockets = [opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(3)]
        for each, host in zip(sockets, ("127.0.0.1", "127.0.0.2", "127.0.0.1"), strict=True):
            each.settimeout(0.0)
            each.bind((host, 0))
        yield sockets


@pytest.mark.parametrize("is_near", [True, False])
async def test_udpin_serves_one_station_at_a_time_and_hears_no_other_computer_then(
    monkeypatch: pytest.MonkeyPatch, stations: list[socket.socket], is_near: bool
) -> None:
    first, second, moved = stations
    udp = Udp(monkeypatch, is_near=is_near)
    port = udp.port
    port.write(b"nobody is there")
    assert await udp.hears(first)
    assert port.serve()
    assert await udp.hears(second) is is_near
    port.write(b"to the first")
    assert first.recv(100) == b"to the first"
    with pytest.raises(BlockingIOError):
        second.recv(100)
    assert await udp.hears(moved)
    assert port.serve()
    port.write(b"where it is now")
    assert moved.recv(100) == b"where it is now"
    port.forget()
    assert await udp.hears(second)
    assert port.serve()
    port.write(b"to the second")
    assert second.recv(100) == b"to the second"
    port.close()
    port.close()


async def test_udpout_serves_the_named_station_alone_and_bears_that_nobody_listens(
    monkeypatch: pytest.MonkeyPatch, stations: list[socket.socket]
) -> None:
    named, other, moved = stations
    port = UdpPort(Address("udpout", *named.getsockname()))
    port.write(b"the rover is there")
    _, here = named.recvfrom(100)
    named.sendto(Encoder().frame(heartbeat()), ("127.0.0.1", here[1]))
    assert sequences(port) == [(0, True)]
    assert port.serve()
    other.sendto(Encoder().frame(heartbeat()), ("127.0.0.1", here[1]))
    assert sequences(port) == [(0, True)], "a program of this computer may stop the rover"
    assert not port.serve()
    monkeypatch.setattr("wayfarer.remote.mavlink.link.is_this_computer", lambda _: False)
    other.sendto(Encoder().frame(heartbeat()), ("127.0.0.1", here[1]))
    assert sequences(port) == []
    moved.sendto(Encoder().frame(heartbeat()), ("127.0.0.1", here[1]))
    assert sequences(port) == [(0, False)], "a station need not speak from where it listens"
    assert port.serve()
    port.write(b"where it listens")
    assert named.recv(100) == b"where it listens"
    port.forget()
    named.close()
    for _ in range(3):
        port.write(b"the station has gone")
        assert sequences(port) == []
    port.close()


async def test_serial_line_carries_frames_drops_what_does_not_fit_and_notices_that_it_was_unplugged() -> None:
    radio, line = os.openpty()
    tty.setraw(radio)
    port = SerialPort(Address("serial", os.ttyname(line), 57600))
    os.close(line)
    os.set_blocking(radio, False)
    encoder = Encoder()
    data = encoder.frame(heartbeat()) + encoder.frame(heartbeat())
    os.write(radio, data[:30])
    found = sequences(port)
    os.write(radio, data[30:])
    assert found + sequences(port) == [(0, True), (1, True)]
    for _ in range(2_000):
        port.write(b"x" * 100)  # nobody reads
    assert len(port._unsent) <= 100
    assert os.read(radio, 1_000_000).startswith(b"xxx")
    os.close(radio)
    with pytest.raises(OSError):
        sequences(port)
        sequences(port)
    port.close()


async def test_frame_behind_a_stray_marker_is_read_without_another_byte() -> None:
    radio, line = os.openpty()
    tty.setraw(radio)
    port = SerialPort(Address("serial", os.ttyname(line), 57600))
    os.close(line)
    os.write(radio, b"\xfd\xff" + Encoder().frame(heartbeat()))
    assert [list(port.read(now_s)) for now_s in (0.0, 0.05)] == [[], []]
    assert [frame[4] for frame, _ in port.read(0.15)] == [0]
    assert not list(port.read(0.2)), "once"
    port.close()
    os.close(radio)


def test_device_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError):
        open_port(Address("serial", str(tmp_path / "ttyUSB0"), 57600), ())


async def test_station_that_comes_back_from_another_port_stops_the_rover_at_once_and_is_served_soon(
    monkeypatch: pytest.MonkeyPatch, stations: list[socket.socket]
) -> None:
    first, _, moved = stations
    monkeypatch.setattr("wayfarer.remote.mavlink.link.is_this_computer", lambda _: False)
    monkeypatch.setattr("wayfarer.remote.mavlink.link.MOVED_S", 0.2)
    taken: list[str] = []
    link = Link(Address("udpin", "127.0.0.1", 0), 1, (), lambda message, _: taken.append(message.get_type()))
    running = asyncio.create_task(link.run())
    await asyncio.sleep(0.05)
    assert isinstance(link._port, UdpPort)
    here, encoder = link._port._socket.getsockname(), Encoder()
    first.sendto(encoder.frame(heartbeat()), here)
    await asyncio.sleep(0.05)
    assert link.is_served
    moved.sendto(encoder.frame(arming(0.0)), here)
    await asyncio.sleep(0.05)
    assert taken == ["HEARTBEAT", "COMMAND_LONG"]
    for _ in range(10):
        moved.sendto(encoder.frame(heartbeat()), here)
        await asyncio.sleep(0.05)
    link.send(heartbeat())
    assert moved.recv(100)
    with pytest.raises(BlockingIOError):
        first.recv(100)
    running.cancel()
    await asyncio.wait([running])
