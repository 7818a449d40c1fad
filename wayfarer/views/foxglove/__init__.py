"""A run in Foxglove: as an MCAP file, or live over a WebSocket. One table of channels serves both."""

from __future__ import annotations

HOST = "127.0.0.1"  # anybody who can reach it can watch
PORT = 8765  # where Foxglove looks first
