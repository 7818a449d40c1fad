"""The process that serves Foxglove: what its clients cannot do to the daemon."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import cast

import pytest

from tests.views.foxglove.logs import tick
from tests.views.foxglove.test_server import UPGRADE, connected
from tests.views.live.daemons import poll, running
from wayfarer.cli.viewer_options import viewers
from wayfarer.daemon.socket.protocol import Commands
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.views.foxglove.live import UNSENT_BYTES, FoxgloveLive
from wayfarer.views.foxglove.server import DESCRIPTORS

pytestmark = pytest.mark.process

COMMANDS = cast(Commands, None)  # a viewer that only shows has no use for them
RUN_ENDS_S = 2.0  # README: after SIGTERM
SAID = (b"", UPGRADE[:40], UPGRADE)  # by clients that say nothing, half a request, and that read nothing


@pytest.fixture
async def live() -> AsyncIterator[FoxgloveLive]:
    shown = viewers(live=False, live_host=None, live_port=None, foxglove=True, foxglove_port=0)
    (made,) = shown.viewers
    assert isinstance(made, FoxgloveLive)
    assert shown.addresses == {"foxglove": made.url}
    async with made.serving(COMMANDS):
        yield made


@pytest.mark.parametrize("end", ["stop", signal.SIGTERM, signal.SIGINT])
def test_no_client_keeps_the_daemon_from_ending(end: str | signal.Signals) -> None:
    with running("run", "--sim", "--foxglove", "--foxglove-port", "0") as daemon:
        daemon.arm()
        clients = [socket.create_connection(("127.0.0.1", daemon.port)) for _ in SAID]
        for client, said in zip(clients, SAID, strict=True):
            client.sendall(said)
        assert clients[-1].recv(12) == b"HTTP/1.1 101"
        if isinstance(end, str):
            daemon.ask(end)
        else:
            daemon.process.send_signal(end)
        assert daemon.process.wait(timeout=RUN_ENDS_S) == 0
        assert daemon.log()[-1]["record"] == "outcome"
        for client in clients:
            client.close()


def test_flood_of_connections_takes_no_descriptor_of_the_daemon_and_viewers_come_back() -> None:
    with running("run", "--sim", "--foxglove", "--foxglove-port", "0") as daemon:
        poll(daemon.sees)
        descriptors = Path(f"/proc/{daemon.process.pid}/fd")
        before = len(list(descriptors.iterdir()))
        clients = []
        for _ in range(2 * DESCRIPTORS):
            try:
                clients.append(socket.create_connection(("127.0.0.1", daemon.port), timeout=5.0))
            except OSError:
                break  # it cannot take more at once
        assert len(clients) > DESCRIPTORS / 2
        assert len(list(descriptors.iterdir())) <= before
        assert daemon.ask("status")["mode"] == "disarmed"
        poll(lambda: lets_in(daemon.port))
        for client in clients:
            client.close()
        daemon.process.kill()
        poll(lambda: not lets_in(daemon.port))  # the process ends with the daemon


def port_of(live: FoxgloveLive) -> int:
    return int(live.url.rpartition(":")[2])


def lets_in(port: int) -> bool:
    """Whether a viewer is shaken hands with."""
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=1.0) as viewer:
            viewer.sendall(UPGRADE)
            return viewer.recv(12) == b"HTTP/1.1 101"
    except OSError:
        return False


async def test_records_reach_a_viewer(live: FoxgloveLive) -> None:
    async with connected(port_of(live)) as client:
        assert "/pose" in await client.see(live, "/pose")


async def test_viewer_that_ceases_to_read_keeps_nothing_from_ending(
    live: FoxgloveLive, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wayfarer.views.foxglove.live.END_S", 30.0)  # a busy computer may need more than it has
    async with AsyncExitStack() as stack:
        mute = await stack.enter_async_context(connected(port_of(live)))
        await mute.see(live, "/pose")
        for number in range(5000):  # far more than the kernel takes for it
            live.show(tick(2000.0 + number))
            await asyncio.sleep(0.0)
        await asyncio.to_thread(live.close)
    assert live._process.returncode == 0, "it ended by itself"
    live.show(tick(1.0))  # after the end: nothing happens


async def test_process_that_hangs_holds_up_neither_a_record_nor_the_end(live: FoxgloveLive) -> None:
    os.kill(live._process.pid, signal.SIGSTOP)
    record = tick(2000.0)
    for _ in range(5000):
        live.show(record)
    assert UNSENT_BYTES <= len(live._unsent) < 2 * UNSENT_BYTES
    await asyncio.to_thread(live.close)
    assert live._process.returncode == -signal.SIGKILL


async def test_process_that_has_ended_is_reported(live: FoxgloveLive) -> None:
    live._process.kill()
    live._process.wait()
    with pytest.raises(WayfarerError, match="has ended"):
        live.show(tick(1.0))


def test_port_in_use_is_one_line_before_anything_runs(taken_port: int) -> None:
    with pytest.raises(BadInput, match=rf"^port {taken_port} on 127\.0\.0\.1 is in use.*--foxglove-port$"):
        FoxgloveLive(port=taken_port)


def test_process_that_does_not_start_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.views.foxglove.live.SERVER", "wayfarer.no_such_module")
    with pytest.raises(WayfarerError, match="did not start"):
        FoxgloveLive(port=0)
