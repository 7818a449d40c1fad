"""A run in Foxglove: as an MCAP file, or live over a WebSocket. One table of channels serves both."""

from __future__ import annotations

PORT = 8765  # where Foxglove looks first
