"""Real ports: a UDP socket and a serial line, on the loop."""

from __future__ import annotations

import asyncio
import os
import socket
import tty
from pathlib import Path

import pytest

from tests.views.mavlink.station import Encoder, heartbeat
from wayfarer.commissioning.checks.system import device_files
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput
from wayfarer.views.mavlink.address import Address, check_not_a_part, parse_address
from wayfarer.views.mavlink.ports import Port, SerialPort, UdpPort, open_port


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
     "udpin:1.2.3.4:-1", "serial:/dev/ttyUSB0", "serial:/dev/ttyUSB0:9", "udpout:no.such.invalid:1"],
)  # fmt: skip
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="give"):
        parse_address(text)


def test_line_of_the_motor_board_is_no_link() -> None:
    rover = load_rover("forestrover")
    board = str(rover.parts["motors"]["port"])
    with pytest.raises(BadInput, match="a part of the rover"):
        open_port(Address("serial", board, 57600), device_files(rover))
    check_not_a_part(Address("serial", "/dev/ttyUSB7", 57600), device_files(rover))


def sequences(port: Port) -> list[tuple[int, bool]]:
    return [(frame.sequence, local) for frame, local in port.read(0.0)]


async def test_udpin_has_one_station_at_a_time() -> None:
    port = UdpPort(Address("udpin", "127.0.0.1", 0))
    here = port._socket.getsockname()
    arrived = asyncio.Event()
    port.listen(arrived.set)
    encoder = Encoder()
    first, second = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    with first, second:
        for each in (first, second):
            each.settimeout(0.0)
            each.bind(("127.0.0.1", 0))

        async def sends(station: socket.socket) -> list[tuple[int, bool]]:
            arrived.clear()
            station.sendto(encoder.frame(heartbeat()), here)
            async with asyncio.timeout(5.0):
                await arrived.wait()
            return sequences(port)

        port.write(b"nobody is there")
        assert await sends(first) == [(0, True)]
        port.believe()
        await sends(second)
        port.believe()
        port.write(b"to the first")
        assert first.recv(100) == b"to the first"
        with pytest.raises(BlockingIOError):
            second.recv(100)
        await sends(second)
        port.answer(b"not to the station alone")
        assert second.recv(100) == b"not to the station alone"
        await sends(first)
        port.answer(b"the station hears the rest")
        with pytest.raises(BlockingIOError):
            first.recv(100)
        port.forget()
        await sends(second)
        port.believe()
        port.write(b"to the second")
        assert second.recv(100) == b"to the second"
    port.close()
    port.close()


async def test_udpout_hears_its_station_alone_and_bears_that_nobody_listens() -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        station.bind(("127.0.0.1", 0))
        port = UdpPort(Address("udpout", *station.getsockname()))
        here = port._socket.getsockname()
        other.sendto(Encoder().frame(heartbeat()), here)
        assert sequences(port) == []
        station.sendto(Encoder().frame(heartbeat()), here)
        assert sequences(port) == [(0, True)]
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
    assert found + sequences(port) == [(0, False), (1, False)]
    for _ in range(2_000):
        port.write(b"x" * 100)  # nobody reads
    assert len(port._unsent) <= 100
    assert os.read(radio, 1_000_000).startswith(b"xxx")
    os.close(radio)
    with pytest.raises(OSError):
        sequences(port)
        sequences(port)
    port.close()


def test_device_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError):
        open_port(Address("serial", str(tmp_path / "ttyUSB0"), 57600), ())
