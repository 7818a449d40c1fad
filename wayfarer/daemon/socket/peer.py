"""Who is at the other end of a Unix socket."""

from __future__ import annotations

import socket
import struct
from typing import Any, Final

_CREDENTIALS: Final = struct.Struct("iII")  # struct ucred of unix(7): process, user and group


def peer_uid(connection: Any) -> int:
    """Return the user at the other end: of the process that connected or, asked by a client, that began to listen."""
    _, user, _ = _CREDENTIALS.unpack(connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
    return int(user)
