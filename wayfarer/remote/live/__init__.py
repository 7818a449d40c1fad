"""The live page: a running rover in a browser, with buttons to hold, resume, mark and stop."""

from __future__ import annotations

HOST = "127.0.0.1"
# Like 8080, which the servers of other software take so often.
PORT = 8088
