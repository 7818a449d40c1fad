"""The address of a link: ``udpout:HOST:PORT``, ``udpin:HOST:PORT`` or ``serial:DEVICE:BAUD``."""

from __future__ import annotations

import os
import socket
import termios
from collections.abc import Iterable
from ipaddress import ip_address
from typing import NamedTuple

from wayfarer.errors import BadInput

KINDS = ("udpout", "udpin", "serial")
PORTS = range(1, 65_536)
# In baud, and what termios calls them.
BAUDS = {int(name[1:]): getattr(termios, name) for name in dir(termios) if name[:1] == "B" and name[1:].isdecimal()}
FORM = "give udpout:HOST:PORT, udpin:HOST:PORT or serial:DEVICE:BAUD, such as udpout:192.168.1.5:14550"


class Address(NamedTuple):
    """Where the link goes: an IP address and a port, or a device file and a rate in baud."""

    kind: str
    where: str
    number: int

    def __str__(self) -> str:
        where = f"[{self.where}]" if self.kind != "serial" and ":" in self.where else self.where
        return f"{self.kind}:{where}:{self.number}"


def parse_address(text: str) -> Address:
    """Return the address that a text names; the name of a host is looked up.

    Raises:
        BadInput: it is none, or there is no such host; the text says what to do.
    """
    kind, _, rest = text.partition(":")
    where, _, digits = rest.rpartition(":")
    allowed = BAUDS.keys() - {0} if kind == "serial" else PORTS
    if kind not in KINDS or not where:
        raise BadInput(f"--mavlink {text}: no address of a link; {FORM}")
    if not (digits.isascii() and digits.isdecimal() and int(digits[:8]) in allowed):
        number = "rate in baud" if kind == "serial" else "port"
        raise BadInput(f"--mavlink {text}: '{digits}' is no {number}; {FORM}")
    if kind == "serial":
        return Address(kind, where, int(digits))
    return Address(kind, _ip_address(where.removeprefix("[").removesuffix("]")), int(digits))


def check_not_a_part(address: Address, devices: Iterable[str]) -> None:
    """Refuse a serial line that a part of the rover is on: what a motor board is sent could turn the wheels.

    Asked at each opening: an adapter that is plugged in again may get the name that another one had.

    Args:
        address: of the link.
        devices: the device files of the rover's parts.

    Raises:
        BadInput: the text names the device.
    """
    if address.kind == "serial" and os.path.realpath(address.where) in map(os.path.realpath, devices):
        raise BadInput(
            f"--mavlink {address}: a part of the rover is on {address.where}; name the radio's device, best by"
            " /dev/serial/by-id"
        )


def is_this_computer(host: str) -> bool:
    """Return whether an IP address is one that only programs on this computer can send from."""
    return ip_address(host.partition("%")[0]).is_loopback


def _ip_address(host: str) -> str:
    try:
        return str(socket.getaddrinfo(host, None, type=socket.SOCK_DGRAM)[0][4][0])
    except (OSError, UnicodeError):
        raise BadInput(
            f"--mavlink: no host {host} is known; give its IP address, which needs neither network nor name server now"
        ) from None
