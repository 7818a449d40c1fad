"""What another user of the rover's computer can do: look on and stop the rover, but not start it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.remote.live.daemons import Daemon, poll, running

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")
pytestmark = pytest.mark.process


@pytest.fixture
def daemon() -> Iterator[Daemon]:
    with running("run", "--sim", "--live", "--live-port", "0") as found:
        yield found


def test_token_is_where_the_operator_alone_can_read(daemon: Daemon) -> None:
    poll(daemon.sees)
    token = daemon.url.partition("?token=")[2]
    assert len(token) >= 22, "128 bits"
    assert daemon.ask("status")["live_page"] == daemon.url
    assert (daemon.folder / "control.sock").stat().st_mode & 0o077 == 0
    daemon.ask("mark", text="written")
    poll(lambda: any(record.get("name") == "mark" for record in daemon.log()))
    readable = [*(daemon.folder / "logs").rglob("*.*"), Path(f"/proc/{daemon.process.pid}/cmdline")]
    for path in readable:
        assert token not in path.read_text(encoding="utf-8"), path
    with running("run", "--sim", "--live", "--live-port", "0") as other:
        assert other.url.partition("?token=")[2] != token
