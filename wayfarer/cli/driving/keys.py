"""Driving by the keys of a terminal.

A terminal tells that a key was pressed, and while it is held it repeats it after a pause; it never tells that it was
let go. So a key counts for ``expiry_s`` and no longer: until the repetition begins, the rover stands again for a
moment. Each press, and each repetition, is a new sample; nothing is made up between them.
"""

from __future__ import annotations

import os
import re
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager

from wayfarer.cli.driving.wish import Wish, now_s
from wayfarer.errors import BadInput

# Arrows are sequences that end with a capital letter, so capitals alone are no keys: half a sequence must not turn.
WAYS = {
    "\x1b[A": (1.0, 0.0), "\x1b[B": (-1.0, 0.0), "\x1b[C": (0.0, 1.0), "\x1b[D": (0.0, -1.0),
    "\x1bOA": (1.0, 0.0), "\x1bOB": (-1.0, 0.0), "\x1bOC": (0.0, 1.0), "\x1bOD": (0.0, -1.0),
    "w": (1.0, 0.0), "s": (-1.0, 0.0), "d": (0.0, 1.0), "a": (0.0, -1.0),
}  # fmt: skip
SPEEDS = {str(tenth % 10): tenth / 10 for tenth in range(1, 11)}  # 0 is full
STOP, END = " ", ("q", "\x04")  # Ctrl-D ends as well
KEY = re.compile(r"\x1b[\[O][A-Za-z]|[^\x1b]")
HALF_A_KEY = re.compile(r"\x1b[\[O]?\Z")
# While nothing is pressed, the daemon is told so; it gives a client up after 2 s.
IDLE_S = 0.2
START_SPEED = 0.5


class Keys:
    """What was pressed, from the characters of a terminal; implements ``Source`` but for the waiting.

    Args:
        expiry_s: for so long a key counts; the daemon's deadman, which acts by itself as well.
    """

    driver = "keys"

    def __init__(self, expiry_s: float) -> None:
        self._expiry_s = expiry_s
        self._pressed: Wish | None = None
        self._told_s = -IDLE_S
        self._rest = ""
        self.speed = START_SPEED
        self.is_over = False

    @property
    def help(self) -> str:
        """What to press, and how fast that is."""
        speed = f"1 to 9, 0: speed, now {100 * self.speed:.0f} %"
        return f"arrows or w a s d: drive   space: stop   {speed}   q: end"

    def take(self, text: str, t_s: float, since_s: float | None = None) -> None:
        """Take characters that were read at ``t_s``; of several keys the last one counts, and a stop before any.

        Where nobody has looked since ``since_s``, longer than a key counts (the daemon took its time to answer), they
        may be as old as that, and drive nothing.
        """
        text = self._rest + text
        half = HALF_A_KEY.search(text)
        self._rest = half[0] if half else ""
        keys = KEY.findall(text.removesuffix(self._rest))
        for key in keys:
            self.is_over |= key in END
            self.speed = SPEEDS.get(key, self.speed)
        ways = [WAYS[key] for key in keys if key in WAYS]
        if STOP in keys or self.is_over:
            self._pressed = Wish(0.0, 0.0, t_s)
        elif ways and (since_s is None or t_s - since_s <= self._expiry_s):
            forward, turn = ways[-1]
            self._pressed = Wish(forward * self.speed, turn * self.speed, t_s)

    def wish(self, t_s: float) -> Wish | None:
        """Return a key that was pressed since the last call; now and then, that none is."""
        pressed, self._pressed = self._pressed, None
        if pressed is not None:
            self._told_s = t_s + self._expiry_s - IDLE_S
            return pressed
        if t_s - self._told_s < IDLE_S:
            return None
        self._told_s = t_s
        return Wish(0.0, 0.0, t_s)


class TerminalKeys(Keys):
    """The same, of this process's terminal; made by ``terminal_keys``."""

    def __init__(self, expiry_s: float) -> None:
        super().__init__(expiry_s)
        self._looked_s = now_s()

    def wait(self, for_s: float) -> None:
        """Wait for a key, at most so long, and take all that there are."""
        stdin = sys.stdin.fileno()
        if select.select([stdin], [], [], for_s)[0]:
            text = os.read(stdin, 1024).decode(errors="replace")
            self.take(text or END[-1], now_s(), self._looked_s)  # nothing: the terminal has gone
        self._looked_s = now_s()


@contextmanager
def terminal_keys(expiry_s: float) -> Iterator[TerminalKeys]:
    """Give each key at once, without Enter and unseen, until the end.

    Raises:
        BadInput: there is no terminal.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise BadInput("driving by keys needs a terminal; without one, use a gamepad: wayfarer drive --gamepad")
    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield TerminalKeys(expiry_s)
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
