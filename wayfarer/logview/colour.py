"""Colour on a terminal, where it means something."""

from __future__ import annotations

import os
import sys
from typing import TextIO

# The terminal's colours (SGR codes), by the tone of a text; they follow the user's colour scheme.
COLOURS = {
    "quiet": "2", "phase": "36", "person": "1", "good": "32", "warning": "33", "fault": "1;31", "end": "1;32",
}  # fmt: skip


def painted(text: str, tone: str, stream: TextIO | None = None) -> str:
    """Return a text in the colour of its tone, if ``stream`` (None: stdout) is a terminal whose owner wants colours.

    ``NO_COLOR`` (no-color.org) and ``TERM=dumb`` say that nobody does.
    """
    wanted = (stream or sys.stdout).isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return f"\x1b[{COLOURS[tone]}m{text}\x1b[0m" if wanted and tone in COLOURS else text
