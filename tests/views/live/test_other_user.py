"""What another user of the rover's computer can do: look on and stop the rover, but not start it."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.views.live.daemons import Daemon, poll, running

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")
pytestmark = pytest.mark.process

# Asks what a page can ask for, as the user nobody where this one is root; prints the replies, as a line of JSON.
VISIT = """
import asyncio, json, os, sys
import aiohttp
origin, query, *requests = sys.argv[1:]
if os.geteuid() == 0:
    os.setgroups([])
    os.setuid(65534)

async def visit():
    replies, asked, asked_s = [], 0, None
    async with aiohttp.ClientSession() as client:
        async with client.ws_connect(f"{origin}/ws{query}", headers={"Origin": origin}) as connection:
            async for message in connection:
                for piece in json.loads(message.data):
                    asked_s = piece.get("state", {}).get("now_s", asked_s)
                    replies += [piece["reply"]] if "reply" in piece else []
                if len(replies) == len(requests):
                    return replies
                if asked_s is not None and asked == len(replies):
                    shown = {"asked_s": asked_s} if requests[asked] == "resume" else {}
                    await connection.send_json({"do": requests[asked], **shown})
                    asked += 1

print(json.dumps(asyncio.run(visit())))
"""


@pytest.fixture
def daemon() -> Iterator[Daemon]:
    with running("run", "--sim", "--live", "--live-port", "0") as found:
        yield found


def visit(daemon: Daemon, query: str, *requests: str) -> list[dict[str, Any]]:
    command = [sys.executable, "-c", VISIT, daemon.origin, query, *requests]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=30.0)
    assert done.returncode == 0, done.stderr
    replies: list[dict[str, Any]] = json.loads(done.stdout)
    return replies


def test_resume_needs_what_only_the_operator_can_read(daemon: Daemon) -> None:
    daemon.arm()
    poll(lambda: daemon.ask("status")["mode"] == "armed")
    held, resumed = visit(daemon, "", "hold", "resume")
    assert (held["ok"], resumed["ok"]) == (True, False)
    assert "needs the token" in resumed["why"]
    assert daemon.ask("status")["held"] is True
    (resumed,) = visit(daemon, daemon.ask("status")["live_page"].removeprefix(f"{daemon.origin}/"), "resume")
    assert resumed["ok"]
    assert daemon.ask("status")["held"] is False


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
