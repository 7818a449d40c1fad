"""Access control: host, origin and token checks. Pure: a request comes in, a refusal or nothing out.

On the rover's own computer everybody may; others need the token that is in the address printed at the start. What
remains to be kept out are web pages from elsewhere, which make the browser of somebody who may send what they like: a
page on another site, told apart by ``Origin``, and one whose name was made to lead here (DNS rebinding), told apart by
``Host``. A proxy would make everybody look local: none is supported.
"""

from __future__ import annotations

from collections.abc import Mapping
from hmac import compare_digest
from ipaddress import IPv6Address, ip_address
from urllib.parse import urlsplit

from wayfarer.daemon.socket.protocol import Refused

OF_PROXIES = ("Forwarded", "Via", "X-Forwarded-For", "X-Real-IP")


class Access:
    """Judges requests. ``token`` is what those must know who are not on this computer."""

    def __init__(self, token: str) -> None:
        self._token = _bytes(token)

    def check_page(self, peer: str, headers: Mapping[str, str], token: str) -> None:
        """Let somebody see the page, who gave ``token``, perhaps empty.

        Raises:
            Refused: the text says why.
        """
        if any(header in headers for header in OF_PROXIES):
            raise Refused("this page works through no proxy: open it at the address that wayfarer printed")
        if is_local(peer):
            name = host_name(headers.get("Host", "")) or ""
            if name != "localhost" and not is_local(name):
                raise Refused("on this computer the page is at localhost or 127.0.0.1, and at no other name")
        elif not compare_digest(_bytes(token), self._token):
            raise Refused(
                "open the page at the whole address that wayfarer printed when it was started, token included"
            )

    def check_socket(self, peer: str, headers: Mapping[str, str], token: str) -> None:
        """Let a page connect.

        Raises:
            Refused: as ``check_page``, or the page is not this server's own.
        """
        self.check_page(peer, headers, token)
        if headers.get("Origin") != f"http://{headers.get('Host')}":
            raise Refused("only wayfarer's own page may connect")


def is_local(peer: str) -> bool:
    """Tell whether an address is this computer's own for itself; what is no address is not."""
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
