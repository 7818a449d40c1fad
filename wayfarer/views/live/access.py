"""Access control: host, origin and token checks. Pure: a request comes in, a refusal or nothing out.

A viewer on the rover's own computer needs no token; others need the token in the address that is printed at the start.
Web pages of other sites, which could send requests from an allowed viewer's browser, are refused: a page on another
site by its ``Origin``, a name that was made to point here (DNS rebinding) by its ``Host``. No proxy is supported,
because behind one every viewer would look local.
"""

from __future__ import annotations

from collections.abc import Mapping
from hmac import compare_digest
from ipaddress import IPv6Address, ip_address
from urllib.parse import urlsplit

from wayfarer.daemon.socket.protocol import Refused

OF_PROXIES = ("Forwarded", "Via", "X-Forwarded-For", "X-Real-IP")


class Access:
    """Checks requests. Viewers on other computers must give ``token``."""

    def __init__(self, token: str) -> None:
        self._token = _bytes(token)

    def check_page(self, peer: str, headers: Mapping[str, str], token: str) -> None:
        """Allow a request for the page; ``token`` is what it gave, perhaps empty.

        Raises:
            Refused: the text says why.
        """
        if any(header in headers for header in OF_PROXIES):
            raise Refused("this page does not work through a proxy: open it at the address that wayfarer printed")
        if is_local(peer):
            name = host_name(headers.get("Host", "")) or ""
            if name != "localhost" and not is_local(name):
                raise Refused("on this computer the page is at localhost or 127.0.0.1, and at no other name")
        elif not compare_digest(_bytes(token), self._token):
            raise Refused("open the page at the complete address that wayfarer printed at its start, with the token")

    def check_socket(self, peer: str, headers: Mapping[str, str], token: str) -> None:
        """Allow a WebSocket connection.

        Raises:
            Refused: as ``check_page``, or it does not come from this server's page.
        """
        self.check_page(peer, headers, token)
        if headers.get("Origin") != f"http://{headers.get('Host')}":
            raise Refused("only wayfarer's own page may connect")


def is_local(peer: str) -> bool:
    """Return whether an address is a loopback address; a text that is no address is not."""
    try:
        address = ip_address(peer.partition("%")[0])
    except ValueError:
        return False
    if isinstance(address, IPv6Address) and address.ipv4_mapped is not None:
        return address.ipv4_mapped.is_loopback
    return address.is_loopback


def _bytes(token: str) -> bytes:
    return token.encode(errors="surrogatepass")  # a header's bytes that are no UTF-8 become surrogates


def host_name(host: str) -> str | None:
    """Return the name in a ``Host`` header, without the port; None where there is none."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None
