"""Access control: host, origin and token checks. Pure: a request comes in, a refusal or what it may do out.

The token is in the address that is printed at the start. On the rover's own computer every user may watch and stop
the rover without it, but only those who have it may start the wheels; on other computers nothing works without it. The
page itself, which says nothing of the rover, is for everybody: it brings the token when it connects. It keeps it where
only a page from this very port can read it. A cookie would be sent to every port of this computer, also to a server
of another user.

Web pages of other sites, which could send requests from an allowed viewer's browser, are refused: a page on another
site by its ``Origin``, a name that was made to point here (DNS rebinding) by its ``Host``. No proxy is supported,
because behind one every viewer would look local.
"""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Mapping
from hmac import compare_digest
from ipaddress import IPv6Address, ip_address
from urllib.parse import urlsplit

from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.errors import BadInput, NotThereYet

# Of a connection, in bytes: as much is read in one turn of the loop, and two-byte frames take their time. The kernel
# doubles it (socket(7)), so that the longest message fits.
RECEIVED_BYTES = 8_192

OF_PROXIES = ("Forwarded", "Via", "X-Forwarded-For", "X-Real-IP")

_SOMEWHERE = ("192.0.2.1", 9)  # reserved for documentation (RFC 5737); nothing is sent there


def bind(host: str, port: int) -> socket.socket:
    """Return a socket that listens; ``NotThereYet`` if it may be had later, ``BadInput`` if it never can."""
    if not host:
        raise BadInput("--live-host is empty: give an address of this computer, such as 0.0.0.0 for all of them")
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        both = family is socket.AF_INET6 and socket.has_dualstack_ipv6()
        bound = socket.create_server(address, family=family, dualstack_ipv6=both)
    except UnicodeError:
        raise BadInput(f"{host} is not a host name: choose an address of this one with --live-host") from None
    except OSError as error:
        kind = BadInput if error.errno == errno.EACCES else NotThereYet
        raise kind(_why_not(host, port, error)) from None
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVED_BYTES)  # connections inherit it
    return bound


def _why_not(host: str, port: int, error: OSError) -> str:
    why = {
        errno.EADDRINUSE: "is in use, perhaps by another wayfarer: choose another port with --live-port",
        errno.EACCES: "is for root only: choose a port from 1024 up with --live-port",
    }
    other = f"cannot be used: {error.strerror or error}: choose an address of this computer with --live-host"
    return f"port {port} on {host} {why.get(error.errno or 0, other)}"


def address_to_open(bound: socket.socket, token: str) -> str:
    """Return the page's address; ``token`` may be empty."""
    host, port = bound.getsockname()[:2]
    if ip_address(host).is_unspecified:
        host = _own_address()
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/{token and f'?token={token}'}"


def _own_address() -> str:
    """Return this computer's address on the network that most traffic would take, or its name if there is none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_SOMEWHERE)
        except OSError:
            return os.uname().nodename
        return str(probe.getsockname()[0])


class Access:
    """Checks the connections of viewers, who may give ``token``."""

    def __init__(self, token: str) -> None:
        self._token = _bytes(token)

    def check_socket(self, peer: str, headers: Mapping[str, str], token: str) -> bool:
        """Allow a WebSocket connection from an address (``peer``), and return whether it may start the wheels.

        It is refused as by ``check_page``, and if it does not come from this server's page or lacks the token.
        """
        check_page(peer, headers)
        if headers.get("Origin") != f"http://{headers.get('Host')}":
            raise RequestRefused("only wayfarer's own page may connect")
        has_token = compare_digest(_bytes(token), self._token)
        if not has_token and not is_local(peer):
            raise RequestRefused(
                "open the page at the complete address that wayfarer printed at its start, with the token"
            )
        return has_token


def check_page(peer: str, headers: Mapping[str, str]) -> None:
    """Allow a request for the page, or raise ``RequestRefused`` with the reason."""
    if any(header in headers for header in OF_PROXIES):
        raise RequestRefused("this page does not work through a proxy: open it at the address that wayfarer printed")
    if is_local(peer):
        try:
            name = urlsplit(f"//{headers.get('Host', '')}").hostname or ""
        except ValueError:
            name = ""
        if name != "localhost" and not is_local(name):
            raise RequestRefused("on this computer the page is at localhost or 127.0.0.1, and at no other name")


def is_local(peer: str) -> bool:
    """Return whether an address is a loopback address; a text that is not an address is not."""
    try:
        address = ip_address(peer.partition("%")[0])
    except ValueError:
        return False
    if isinstance(address, IPv6Address) and address.ipv4_mapped is not None:
        return address.ipv4_mapped.is_loopback
    return address.is_loopback


def _bytes(token: str) -> bytes:
    return token.encode(errors="surrogatepass")  # bytes that are not UTF-8 become surrogates
