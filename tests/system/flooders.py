"""What careless or hostile programs of this computer do to a daemon without end, each as a separate process.

::

    python -m tests.system.flooders requests /tmp/wf-1/control.sock
"""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from select import select

from tests.system.subprocesses import starting

PLACES = 16  # of the control socket, and of viewers of the page
KEPT = 40
STATUS = b'{"do": "status"}\n'
KEY = b"dGhlIHNhbXBsZSBub25jZQ=="


@contextmanager
def flooded(kind: str, where: str, processes: int = 2) -> Iterator[None]:
    """Flood a daemon while entered: ``where`` is the path of its socket, or the port of its page."""
    with starting():
        flooders = [subprocess.Popen([sys.executable, "-m", __name__, kind, where]) for _ in range(processes)]
    try:
        yield
    finally:
        for each in flooders:
            each.kill()
            each.wait()


def connected(where: str) -> socket.socket:
    """Return a connection to a socket or a page."""
    if where.isdecimal():
        return socket.create_connection(("127.0.0.1", int(where)), 5.0)
    line = socket.socket(socket.AF_UNIX)
    line.settimeout(5.0)
    line.connect(where)
    return line


def again_and_again(where: str, says: bytes) -> None:
    """Connect, say something, and keep the newest connections."""
    kept: list[socket.socket] = []
    while True:
        with suppress(OSError):
            kept.append(connected(where))
            kept[-1].sendall(says)
        if len(kept) > KEPT:
            kept.pop(0).close()


def without_end(where: str, begins: bytes, says: bytes, *, reads: bool = True) -> None:
    """Say the same on as many connections as there are places, as fast as they take it; connect again if closed."""
    lines: list[socket.socket] = []
    while True:
        with suppress(OSError):
            while len(lines) < PLACES:
                lines.append(connected(where))
                lines[-1].sendall(begins)
                lines[-1].setblocking(False)
        there, open_to, _ = select(lines if reads else [], lines, [], 0.1)
        for line in {*there, *open_to}:
            try:
                if line in there and not line.recv(65_536):
                    raise ConnectionResetError
                if line in open_to:
                    line.send(says)
            except BlockingIOError:
                pass
            except OSError:
                line.close()
                lines.remove(line)


def upgrade(port: str, query: str = "") -> bytes:
    """Return the request of a viewer; without a query it has no token, as every user of this computer may send it."""
    return (
        b"GET /ws%s HTTP/1.1\r\nHost: localhost:%s\r\nOrigin: http://localhost:%s\r\nUpgrade: websocket\r\n"
        b"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: %s\r\n\r\n"
    ) % (query.encode(), port.encode(), port.encode(), KEY)


def message(text: bytes) -> bytes:
    """Return a WebSocket message of a client, masked with zeros."""
    return b"\x81" + bytes([0x80 | len(text)]) + bytes(4) + text


FLOODS: dict[str, Callable[[str], None]] = {
    "requests": lambda where: without_end(where, b"", STATUS * 100),
    "requests without reading": lambda where: without_end(where, b"", STATUS * 100, reads=False),
    "stops": lambda where: without_end(where, b"", b'{"do": "hold"}\n{"do": "disarm"}\n' * 50),
    "lines without end": lambda where: without_end(where, b"", b"x" * 100_000),
    "connections": lambda where: again_and_again(where, b""),
    "half lines": lambda where: again_and_again(where, b'{"do": "st'),
    "new requests": lambda where: again_and_again(where, STATUS),
    "pages": lambda port: again_and_again(port, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    "new viewers": lambda port: again_and_again(port, upgrade(port)),
    "messages": lambda port: without_end(port, upgrade(port), message(b'{"do": "mark", "text": "x"}') * 50),
    "messages without reading": lambda port: without_end(
        port, upgrade(port), message(b'{"do": "arm"}') * 100, reads=False
    ),
}

if __name__ == "__main__":
    FLOODS[sys.argv[1]](sys.argv[2])
