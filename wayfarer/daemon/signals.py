"""Signal handling: every signal that would end or suspend the daemon stops the wheels first.

The default actions of signals are in signal(7). These signals are not changed:

* SIGKILL and SIGSTOP, which cannot be caught.
* SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT. A handler in Python runs after the one in C has returned. For a real
  fault, that one returns to the instruction that failed, again and again. systemd's watchdog also sends SIGABRT to a
  daemon that hangs, to get its stacks (``faulthandler``). The motor board's deadman and ``stop-motors`` then stop the
  wheels.
* Signals that do no harm by default, and those that are handled or ignored already: nohup ignores SIGHUP, Python
  SIGPIPE.
"""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from signal import Signals

UNCATCHABLE = frozenset({Signals.SIGKILL, Signals.SIGSTOP})
FAULTS = frozenset({Signals.SIGSEGV, Signals.SIGBUS, Signals.SIGFPE, Signals.SIGILL, Signals.SIGABRT})
HARMLESS = frozenset({Signals.SIGCHLD, Signals.SIGCONT, Signals.SIGURG, Signals.SIGWINCH})
# Without this, a daemon in the background that writes to its terminal could be suspended (stty tostop).
IGNORED = frozenset({Signals.SIGTTIN, Signals.SIGTTOU})
SUSPENDING = Signals.SIGTSTP  # Ctrl-Z
ENDING = frozenset(signal.valid_signals()) - UNCATCHABLE - FAULTS - HARMLESS - IGNORED - {SUSPENDING}
# Handled even if they are ignored: a shell script starts its background processes with SIGINT and SIGQUIT ignored.
ASKED = frozenset({Signals.SIGTERM, Signals.SIGINT, Signals.SIGQUIT})


def handle_signals(end: Callable[[str], None], suspend: Callable[[str], None]) -> None:
    """From now on the running loop calls ``end`` or ``suspend`` with a signal's name, until the loop is closed."""
    loop = asyncio.get_running_loop()
    for number in IGNORED:
        signal.signal(number, signal.SIG_IGN)
    for number in {*ENDING, SUSPENDING}:
        if number in ASKED or signal.getsignal(number) is signal.SIG_DFL:
            loop.add_signal_handler(number, suspend if number == SUSPENDING else end, name_of(number))


def name_of(number: int) -> str:
    """Return the name of a signal for kill(1); most real-time signals are named by their distance to SIGRTMIN."""
    try:
        return Signals(number).name
    except ValueError:
        return f"SIGRTMIN+{number - Signals.SIGRTMIN}"
