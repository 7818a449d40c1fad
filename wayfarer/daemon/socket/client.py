"""Client of the control socket: requests and their answers, one at a time.

It uses plain blocking sockets, so that a command such as ``stop`` need not start an event loop first.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from time import CLOCK_BOOTTIME, clock_gettime
from typing import Any

import msgspec

from wayfarer.daemon.socket.paths import known_sockets, no_session
from wayfarer.daemon.socket.protocol import REPLY_BYTES, STARTING, RequestRefused, check, read_line
from wayfarer.errors import BadInput, WayfarerError


class NoDaemon(WayfarerError):
    """No daemon listens on the socket, or there is no socket."""


def ask(request: Mapping[str, object], path: Path | None = None, timeout_s: float = 5.0) -> dict[str, Any]:
    """Ask the daemon to do something and return the details of its reply; see ``protocol`` for both.

    What starts wheels is asked now: ``asked_s`` need not be given.

    Args:
        request: such as ``{"do": "arm", "heading_deg": 12.5}``; None for a value is the same as leaving it out.
        path: the daemon's socket; without it the first of ``paths.known_sockets`` where a daemon listens.
        timeout_s: the longest wait for the connection, and again for the reply.

    Raises:
        BadInput: the request is wrong; nothing was sent.
        NoDaemon: no daemon is running.
        RequestRefused: the daemon says no; the text says why.
        WayfarerError: the socket belongs to another user, or no healthy daemon answers there.
    """
    line = _line_of(request)  # a wrong request is refused also if no daemon runs
    with socket.socket(socket.AF_UNIX) as connection:
        _limit_waiting(connection, timeout_s)
        place = _connect(connection, path)
        try:
            reply = _exchange(connection, line)
        except BlockingIOError:
            raise WayfarerError(
                f"{place}: the daemon did not answer within {timeout_s:g} s, so it may hang: if the rover moves,"
                " switch off its motors, then restart the daemon"
            ) from None
        except OSError as error:
            raise WayfarerError(f"{place}: the daemon closed the connection ({error.strerror}): see its log") from None
        return _read_reply(place, reply)


def _line_of(request: Mapping[str, object]) -> bytes:
    """Return a request as it is sent, with the time of now if it starts wheels and does not say when it was asked.

    Raises:
        BadInput: it is wrong.
    """
    if request.get("do") in STARTING:
        request = {"asked_s": clock_gettime(CLOCK_BOOTTIME), **request}
    check(request)
    try:
        return msgspec.json.encode(dict(request)) + b"\n"
    except UnicodeEncodeError:  # half a character: a terminal passes on invalid UTF-8 this way
        raise BadInput(f"the request is not text in UTF-8: {dict(request)!a}") from None


def _limit_waiting(connection: socket.socket, timeout_s: float) -> None:
    """Let the kernel limit each wait.

    Python's own timeouts cannot be used: with them, connecting fails at once if the daemon's queue is full.
    """
    seconds, fraction_s = divmod(timeout_s, 1.0)
    wait = struct.pack("ll", int(seconds), int(fraction_s * 1e6))  # struct timeval
    for direction in (socket.SO_SNDTIMEO, socket.SO_RCVTIMEO):
        connection.setsockopt(socket.SOL_SOCKET, direction, wait)


def _connect(connection: socket.socket, path: Path | None) -> Path:
    tried: list[str] = []
    barred: Path | None = None
    for place in [path] if path else known_sockets():
        try:
            connection.connect(str(place))
        except (FileNotFoundError, NotADirectoryError, ConnectionRefusedError):  # the last: left by a killed daemon
            tried.append(str(place))
        except PermissionError:  # perhaps the service's, while the user's own daemon is wanted
            barred = barred or place
        except BlockingIOError:
            raise WayfarerError(f"{place}: the daemon accepts no connection; it hangs, or is flooded") from None
        except OSError as error:
            raise BadInput(f"{place}: cannot be the control socket: {error.strerror or error}") from None
        else:
            return place
    if barred:
        raise WayfarerError(f"{barred}: belongs to another user: use sudo, or that user's account")
    also = f"; {why}" if path is None and (why := no_session()) else ""
    raise NoDaemon(
        f"no wayfarer daemon is running (nobody listens at {' or '.join(tried)}{also}): start it with 'wayfarer run'"
    )


def _exchange(connection: socket.socket, line: bytes) -> bytes:
    with suppress(BrokenPipeError, ConnectionResetError):  # rejected before the request was read; the reply says why
        connection.sendall(line)
    reply = b""
    while not reply.endswith(b"\n") and len(reply) <= REPLY_BYTES:
        received = connection.recv(REPLY_BYTES)
        if not received:
            break
        reply += received
    return reply


def _read_reply(place: Path, reply: bytes) -> dict[str, Any]:
    if not reply:
        raise WayfarerError(f"{place}: the daemon closed the connection without an answer: it may be ending just now")
    try:
        details: dict[str, Any] = read_line(reply.partition(b"\n")[0])  # a second line says why the daemon closed
        if details.pop("ok") is True:
            return details
        why = details["why"]
    except (BadInput, KeyError):
        why = None
    if not isinstance(why, str) or not why.strip():
        raise WayfarerError(f"{place}: the program that answers there is not a wayfarer daemon: {reply[:40]!r}")
    raise RequestRefused(why)
