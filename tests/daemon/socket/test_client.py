"""One question, one answer; and a line for the person if there is none."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import CLOCK_BOOTTIME, clock_gettime
from typing import Any

import pytest

from tests.daemon.socket.fake_daemon import FakeDaemon, serve, until
from wayfarer.daemon.socket import client
from wayfarer.daemon.socket.client import NoDaemon, ask
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.errors import BadInput, WayfarerError

STATUS = {"do": "status"}


@contextmanager
def something_else(path: Path, says: bytes | None) -> Iterator[list[OSError]]:
    """Listen as no daemon does: answer these bytes and close, or with None never accept; yields what went wrong."""
    errors: list[OSError] = []

    def speak() -> None:
        connection, _ = listening.accept()
        with connection:
            connection.recv(1000)
            try:
                connection.sendall(says or b"")
            except OSError as error:
                errors.append(error)

    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen(0)
        speaker = threading.Thread(target=speak)
        if says is not None:
            speaker.start()
        yield errors
        if says is not None:
            speaker.join()


async def test_answer_is_the_details(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        assert await asyncio.to_thread(ask, STATUS, path) == {"mode": "disarmed"}
        assert await asyncio.to_thread(ask, {"do": "arm", "heading_deg": None}, path) == {"start_delay_s": 10.0}
    assert daemon.told == [("status",), ("arm", None)]


async def test_what_starts_wheels_is_sent_with_the_time_of_asking(path: Path, daemon: FakeDaemon) -> None:
    """Not that of connecting: the daemon may be suspended, or its queue full."""
    began_s = clock_gettime(CLOCK_BOOTTIME)
    async with serve(daemon, path):
        for request in ({"do": "arm"}, {"do": "resume"}, {"do": "manual_begin", "driver": "page"}):
            await asyncio.to_thread(ask, request, path)
        await asyncio.to_thread(ask, {"do": "resume", "asked_s": 1.5}, path)
    times_s = [asked.at_s for asked in daemon.asked]
    assert began_s < times_s[0] < times_s[1] < times_s[2] < clock_gettime(CLOCK_BOOTTIME)
    assert times_s[3] == 1.5, "a program that has waited itself"


async def test_refusal_is_raised_with_its_reason(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        with pytest.raises(RequestRefused, match=r"^nothing to hold: arm first$"):
            await asyncio.to_thread(ask, {"do": "hold"}, path)


async def test_client_that_is_pushed_out_hears_why(path: Path, daemon: FakeDaemon) -> None:
    daemon.waits.clear()
    async with serve(daemon, path, clients=1):
        pushed_out = asyncio.create_task(asyncio.to_thread(ask, {"do": "arm"}, path))
        await until(lambda: daemon.told)
        assert await asyncio.to_thread(ask, STATUS, path) == {"mode": "disarmed"}
        with pytest.raises(RequestRefused, match="too many clients"):
            await pushed_out


async def test_daemon_is_found_where_it_may_be(path: Path, daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch) -> None:
    stale = path.with_name("stale.sock")
    with socket.socket(socket.AF_UNIX) as killed:
        killed.bind(str(stale))
    places = [path.parent / "nowhere" / "control.sock", stale, path]
    monkeypatch.setattr(client, "known_sockets", lambda: places)
    async with serve(daemon, path):
        assert await asyncio.to_thread(ask, STATUS) == {"mode": "disarmed"}


def test_text_that_is_no_utf_8_is_refused_in_a_line(path: Path) -> None:
    with pytest.raises(BadInput, match=r"not text in UTF-8: .*bad \\udcff"):
        ask({"do": "mark", "text": "bad \udcff"}, path)


@pytest.mark.parametrize("killed", [False, True])
def test_no_socket_or_that_of_a_killed_daemon_means_no_daemon(path: Path, killed: bool) -> None:
    if killed:
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(str(path))
    with pytest.raises(NoDaemon, match=rf"no wayfarer daemon is running \(nobody listens at {path}\): start it with"):
        ask(STATUS, path)


def test_path_that_no_socket_can_have_is_the_users_to_mend(path: Path) -> None:
    with pytest.raises(BadInput, match=r"cannot be the control socket: .*too long"):
        ask(STATUS, path.parent / ("x" * 108))


@pytest.fixture
def barred(path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A socket of another user."""
    place = path.with_name("barred.sock")

    class Barred(socket.socket):
        def connect(self, address: Any) -> None:
            if address == str(place):
                raise PermissionError(13, "Permission denied")
            super().connect(address)

    monkeypatch.setattr(socket, "socket", Barred)
    return place


async def test_own_daemon_is_found_beside_the_service_of_another_user(
    path: Path, barred: Path, daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "known_sockets", lambda: [barred, path])
    async with serve(daemon, path):
        assert await asyncio.to_thread(ask, STATUS) == {"mode": "disarmed"}
    with pytest.raises(WayfarerError, match=f"{barred}: belongs to another user: use sudo"):
        await asyncio.to_thread(ask, STATUS)


def test_variable_that_is_missing_is_told_of_where_no_daemon_is_found(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "known_sockets", lambda: [path])
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    with pytest.raises(NoDaemon, match=rf"\(nobody listens at {path}; XDG_RUNTIME_DIR is not set\): start it with"):
        ask(STATUS)


@pytest.mark.parametrize("heading_deg", [float("nan"), float("inf"), 360.0, "north"])
def test_wrong_request_is_not_sent(path: Path, heading_deg: object) -> None:
    with pytest.raises(BadInput, match="heading_deg must be a number of degrees"):
        ask({"do": "arm", "heading_deg": heading_deg}, path)


def test_daemon_that_hangs_is_reported_in_time(path: Path) -> None:
    with (
        something_else(path, None),
        pytest.raises(WayfarerError, match=r"did not answer within 0\.05 s, .* switch off"),
    ):
        ask(STATUS, path, timeout_s=0.05)


def test_daemon_that_does_not_even_accept_is_reported_in_time(path: Path) -> None:
    with something_else(path, None), socket.socket(socket.AF_UNIX) as waiting:
        waiting.connect(str(path))
        with pytest.raises(WayfarerError, match="accepts no connection; it hangs, or is flooded"):
            ask(STATUS, path, timeout_s=0.05)


@pytest.mark.parametrize(
    "says",
    [
        b"",
        b"hello\n",
        b"HTTP/1.1 400 Bad Request\r\n",
        b"{}\n",
        b'{"ok": false}\n',
        b'{"ok": false, "why": ""}\n',
        b'{"ok": false, "why": ["arm"]}\n',
        b'{"ok": 1}\n',
        b'{"ok": tr',
        b"\0" * 99,
    ],
)
def test_something_else_at_the_socket_is_reported(path: Path, says: bytes) -> None:
    told = (
        "the program that answers there is not a wayfarer daemon: b" if says else "without an answer: it may be ending"
    )
    with something_else(path, says), pytest.raises(WayfarerError, match=told):
        ask(STATUS, path)


def test_answer_counts_though_the_daemon_says_at_once_why_it_closes(path: Path) -> None:
    with something_else(path, b'{"ok":true,"n":1}\n{"ok":false,"why":"dropped"}\n'):
        assert ask(STATUS, path) == {"n": 1}


def test_answer_without_end_is_cut_off(path: Path) -> None:
    with (
        something_else(path, b"x" * 10_000_000) as errors,
        pytest.raises(WayfarerError, match="is not a wayfarer daemon"),
    ):
        ask(STATUS, path)
    assert len(errors) == 1


async def test_answer_of_many_pieces_is_put_together(path: Path, daemon: FakeDaemon) -> None:
    daemon.answers = {"text": "x" * 65_000}
    async with serve(daemon, path):
        assert await asyncio.to_thread(ask, STATUS, path) == daemon.answers
