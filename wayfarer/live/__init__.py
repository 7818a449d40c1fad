"""The live page: a run shown in a browser while it lasts, and the few things that a person may ask for there."""

from __future__ import annotations

from importlib.util import find_spec

from wayfarer.errors import WayfarerError

HOST = "127.0.0.1"
# Like 8080, which the servers of other software take so often; 8765 is Foxglove's.
PORT = 8088


def require_live_extra() -> None:
    """Refuse to go on without what the page's server needs; call it before ``live.server`` is imported.

    Raises:
        WayfarerError: a package is missing; the text says how to install it.
    """
    if find_spec("aiohttp") is None:
        remedy = "pip install '.[live]' in wayfarer's checkout"
        raise WayfarerError(f"the live page needs aiohttp, which is not installed: {remedy}")
