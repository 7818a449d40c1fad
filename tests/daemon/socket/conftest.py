"""Fixtures of the control socket's tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.daemon.socket.fake_daemon import FakeDaemon


@pytest.fixture
def path() -> Iterator[Path]:
    """A place for a socket; short, because a Unix socket's path has 107 bytes at most."""
    with TemporaryDirectory(prefix="wayfarer-", dir="/tmp") as folder:
        yield Path(folder) / "control.sock"


@pytest.fixture
async def daemon() -> FakeDaemon:
    return FakeDaemon()
