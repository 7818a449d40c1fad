"""The server answers to whom it should, and goes on; the fuzzer's target ``server`` sends it whatever may come."""

from __future__ import annotations

import asyncio
import os
import socket
from functools import partial
from pathlib import Path
from stat import S_IMODE

import pytest

from tests.daemon.socket.fake_daemon import ARM, STATUS, FakeDaemon, RawClient, answers, serve, until
from wayfarer.daemon.socket.protocol import Details, RequestRefused
from wayfarer.errors import BadInput, NotResponding
from wayfarer.safety.permission import Asked

# -- answering -----------------------------------------------------------------------------------------------------


async def test_command_is_answered_with_its_details(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as client:
        assert await client.reply_to(STATUS) == {"ok": True, "mode": "disarmed"}
        assert await client.reply_to(b'{"do": "goal", "heading_deg": 10, "north": "true"}\n') == {"ok": True}
    assert daemon.told == [("status",), ("goal", 6.5)]


async def test_lines_sent_together_are_answered_in_order(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as client:
        client.writer.write(b"".join(b'{"do": "mark", "text": "%d"}\n' % number for number in range(100)))
        assert [await client.reply() for _ in range(100)] == [{"ok": True}] * 100
    assert daemon.told == [("mark", str(number)) for number in range(100)]


@pytest.mark.parametrize(
    "error", [RequestRefused("nothing to hold: arm first"), NotResponding("motor board: no answer")]
)
async def test_refusal_or_error_for_a_person_says_why_and_the_connection_stays(
    path: Path, daemon: FakeDaemon, error: Exception
) -> None:
    daemon.fails_with = error
    async with serve(daemon, path), RawClient(path) as client:
        assert await client.reply_to(b'{"do": "hold"}\n') == {"ok": False, "why": str(error)}
        assert (await client.reply_to(STATUS))["ok"]
    assert daemon.errors == []


async def test_bug_in_a_command_is_reported_and_the_server_goes_on(path: Path, daemon: FakeDaemon) -> None:
    daemon.fails_with = ZeroDivisionError("x" * 1000)
    async with serve(daemon, path), RawClient(path) as client:
        reply = await client.reply_to(b'{"do": "hold"}\n')
        assert (await client.reply_to(STATUS))["ok"]
    assert reply["ok"] is False
    assert "an error inside wayfarer (ZeroDivisionError: xxx" in reply["why"]
    assert len(reply["why"]) < 300
    assert daemon.errors == [daemon.fails_with]


async def test_details_that_are_no_json_are_reported_as_a_bug(path: Path, daemon: FakeDaemon) -> None:
    daemon.answers = {"mode": object()}
    async with serve(daemon, path), RawClient(path) as client:
        assert (await client.reply_to(STATUS))["ok"] is False
    assert [type(error).__name__ for error in daemon.errors] == ["TypeError"]


@pytest.mark.parametrize("leaves", ["close", "abort", "write_eof"])
async def test_arming_is_given_up_at_once_when_its_client_leaves(path: Path, daemon: FakeDaemon, leaves: str) -> None:
    """Also one that ceases to send: who waits for no answer has gone."""
    daemon.waits.clear()
    async with serve(daemon, path), RawClient(path) as client:
        client.writer.write(ARM)
        await until(lambda: daemon.told)
        assert daemon.asked[0].is_there()
        getattr(client.writer.transport, leaves)()
        await until(lambda: ("gave up",) in daemon.told)
        assert not daemon.asked[0].is_there()
        assert await answers(path)


async def test_who_has_gone_before_the_request_is_read_is_not_there(path: Path, daemon: FakeDaemon) -> None:
    """The bytes of a command that was interrupted wait in the buffer of a daemon that was suspended."""
    noted: list[bool] = []

    async def resume(asked: Asked) -> Details:
        noted.append(asked.is_there())
        return {}

    daemon.resume = resume  # type: ignore[method-assign]
    async with serve(daemon, path):
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(str(path))
            line.sendall(b'{"do": "resume", "asked_s": 1}\n')
        await until(lambda: noted)
    assert noted == [False]


async def test_stop_of_a_client_that_has_gone_is_obeyed(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        for verb in ("disarm", "stop"):
            with socket.socket(socket.AF_UNIX) as line:
                line.connect(str(path))
                line.sendall(b'{"do": "%s"}\n' % verb.encode())
            await until(partial(daemon.told.__contains__, (verb,)))


async def test_stop_does_not_queue_behind_a_slow_arm(path: Path, daemon: FakeDaemon) -> None:
    daemon.waits.clear()
    async with serve(daemon, path), RawClient(path) as one, RawClient(path) as other:
        one.writer.write(ARM)
        await until(lambda: daemon.told)
        assert await other.reply_to(b'{"do": "stop"}\n') == {"ok": True}
        daemon.waits.set()
        assert await one.reply() == {"ok": True, "start_delay_s": 10.0}


async def test_flood_of_many_clients_gets_one_answer_in_each_turn_of_the_loop(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as one, RawClient(path) as two, RawClient(path) as three:
        for client in (one, two, three):
            client.writer.write(STATUS * 300)
        await until(lambda: daemon.told)
        before, turns = len(daemon.told), 0
        while len(daemon.told) < 300:
            await asyncio.sleep(0)
            turns += 1
        assert turns >= 300 - before


async def test_flood_of_one_client_keeps_no_other_waiting(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as loud, RawClient(path) as other:
        loud.writer.write(STATUS * 1000)
        await until(lambda: daemon.told)
        other.writer.write(b'{"do": "stop"}\n')
        await until(lambda: ("stop",) in daemon.told)
        assert daemon.told.index(("stop",)) < 500


# -- who may ask ---------------------------------------------------------------------------------------------------


def mode_of(path: Path) -> int:
    return S_IMODE(path.stat().st_mode)


async def test_socket_is_the_owners_alone(path: Path, daemon: FakeDaemon) -> None:
    before = os.umask(0)
    try:
        async with serve(daemon, path):
            assert mode_of(path) == 0o600
    finally:
        os.umask(before)


# -- begin and end -------------------------------------------------------------------------------------------------


async def test_end_of_the_server_closes_its_clients(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        clients = [await RawClient(path).__aenter__() for _ in range(2)]
        for client in clients:
            assert (await client.reply_to(b'{"do": "stop"}\n'))["ok"]
    for client in clients:
        assert await client.is_closed()
        await client.__aexit__()


async def test_reply_to_stop_arrives_though_the_server_ends(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        client = await RawClient(path).__aenter__()
        client.writer.write(b'{"do": "stop"}\n')
        await until(lambda: daemon.told)
    assert await client.reply() == {"ok": True}
    await client.__aexit__()


@pytest.mark.parametrize(
    ("name", "reason"), [("nowhere/control.sock", "No such file"), ("x" * 108, "too long"), ("taken", "in use")]
)
async def test_socket_that_cannot_be_made_is_the_users_to_mend(
    path: Path, daemon: FakeDaemon, name: str, reason: str
) -> None:
    (path.parent / "taken").touch()
    with pytest.raises(BadInput, match=f"the control socket cannot be made: .*{reason}"):
        await serve(daemon, path.parent / name).__aenter__()
