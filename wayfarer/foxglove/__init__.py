"""A run in Foxglove: a log as an MCAP file, or live over a WebSocket. One table of channels serves both."""

from __future__ import annotations

from importlib.util import find_spec

from wayfarer.errors import WayfarerError


def require_foxglove_extra() -> None:
    """Refuse to go on without Foxglove's SDK; call it before any other module of this package is imported.

    Raises:
        WayfarerError: it is missing; the text says how to install it.
    """
    if find_spec("foxglove") is None:
        remedy = "pip install '.[foxglove]' in wayfarer's checkout"
        raise WayfarerError(f"Foxglove needs foxglove-sdk, which is not installed: {remedy}")
