"""Fixtures of the control socket's tests."""

from __future__ import annotations

import pytest

from tests.daemon.socket.fake_daemon import FakeDaemon


@pytest.fixture
async def daemon() -> FakeDaemon:
    return FakeDaemon()
