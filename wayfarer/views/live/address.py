"""Address of the live page: binds its socket early, and makes the URL to open."""

from __future__ import annotations

import errno
import os
import socket
from ipaddress import ip_address

from wayfarer.errors import BadInput

# Of a connection, in bytes: as much is read in one turn of the loop, and two-byte frames take their time. The kernel
# doubles it (socket(7)), so that the longest message fits.
RECEIVED_BYTES = 8_192

_SOMEWHERE = ("192.0.2.1", 9)  # reserved for documentation (RFC 5737); nothing is sent there


def bind(host: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Raises:
        BadInput: there is no such address here, or the port is taken; the text says what to do.
    """
    if not host:
        raise BadInput("--live-host is empty: give an address of this computer, such as 0.0.0.0 for all of them")
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        both = family is socket.AF_INET6 and socket.has_dualstack_ipv6()
        bound = socket.create_server(address, family=family, dualstack_ipv6=both)
    except UnicodeError:
        raise BadInput(f"{host} is not a host name: choose an address of this one with --live-host") from None
    except OSError as error:
        raise BadInput(_why_not(host, port, error)) from None
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVED_BYTES)  # connections inherit it
    return bound


def _why_not(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        why, remedy = "is in use, perhaps by another wayfarer", "choose another port with --live-port"
    elif error.errno == errno.EACCES:
        why, remedy = "is for root only", "choose a port from 1024 up with --live-port"
    else:
        why, remedy = (
            f"cannot be used: {error.strerror or error}",
            "choose an address of this computer with --live-host",
        )
    return f"port {port} on {host} {why}: {remedy}"


def address_to_open(bound: socket.socket, token: str) -> str:
    """Return the page's address; ``token`` may be empty."""
    host, port = bound.getsockname()[:2]
    if ip_address(host).is_unspecified:
        host = _own_address()
    return f"http://{_bracketed(host)}:{port}/{token and f'?token={token}'}"


def _own_address() -> str:
    """Return this computer's address on the network that most traffic would take, or its name where there is none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_SOMEWHERE)
        except OSError:
            return os.uname().nodename
        return str(probe.getsockname()[0])


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
