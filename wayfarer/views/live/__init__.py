"""The live page: a run shown in a browser while it lasts, and the few things that a person may ask for there."""

from __future__ import annotations

HOST = "127.0.0.1"
# Like 8080, which the servers of other software take so often; 8765 is Foxglove's.
PORT = 8088
