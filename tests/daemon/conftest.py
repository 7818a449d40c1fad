"""Fixtures of the daemon's tests."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.daemon.left_turning import AHEAD, bench
from tests.daemon.played import Run
from tests.kit.rover import Rig


class Listener:
    """Stands in for systemd at the other end of NOTIFY_SOCKET."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(address)
        self.socket.setblocking(False)

    def heard(self) -> list[str]:
        messages = []
        while True:
            try:
                messages.append(self.socket.recv(4096).decode())
            except BlockingIOError:
                return messages


@pytest.fixture
def listener(tmp_path: Path) -> Iterator[Listener]:
    listener = Listener(str(tmp_path / "notify"))
    yield listener
    listener.socket.close()


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return Run(Rig(tmp_path))


@pytest.fixture
def path() -> Iterator[Path]:
    """A place for a socket; short, because a Unix socket's path has 107 bytes at most."""
    with TemporaryDirectory(prefix="wayfarer-", dir="/tmp") as folder:
        yield Path(folder) / "control.sock"


@pytest.fixture
def left_turning(monkeypatch: pytest.MonkeyPatch, path: Path) -> None:
    """The bench's wheels turn. Daemons of this machine are not looked for, and what ends is not waited for long."""
    monkeypatch.setattr("wayfarer.daemon.stop_motors.AGAIN_S", 0.1)
    monkeypatch.setattr("wayfarer.daemon.socket.paths.known_sockets", lambda: [path])
    monkeypatch.setattr("wayfarer.daemon.socket.paths.known_folders", lambda: [path.parent])
    bench.reset()
    assert bench.by_i2c.commanded == pytest.approx(AHEAD, abs=0.01)
    assert bench.by_serial.commanded == AHEAD


@pytest.fixture
def rover_file(tmp_path: Path) -> Path:
    return tmp_path / "rover.toml"
