"""Signal handling: every signal that would end or suspend the daemon stops the wheels first.

What a signal does by default is in signal(7). Left as they are:

* SIGKILL and SIGSTOP, which nobody can catch.
* SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT. A handler in Python runs after the one in C has returned, and for a real
  fault that returns to the instruction that failed, without end. SIGABRT is also how systemd's watchdog asks a daemon
  that hangs for its stacks (``faulthandler``). The motor board's deadman and ``stop-motors`` stop the wheels then.
* What does no harm by default, and what somebody else handles or ignores: nohup ignores SIGHUP, Python SIGPIPE.
"""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from signal import Signals

UNCATCHABLE = frozenset({Signals.SIGKILL, Signals.SIGSTOP})
FAULTS = frozenset({Signals.SIGSEGV, Signals.SIGBUS, Signals.SIGFPE, Signals.SIGILL, Signals.SIGABRT})
HARMLESS = frozenset({Signals.SIGCHLD, Signals.SIGCONT, Signals.SIGURG, Signals.SIGWINCH})
# A daemon in the background that says something would be suspended where its terminal is set so (stty tostop).
IGNORED = frozenset({Signals.SIGTTIN, Signals.SIGTTOU})
SUSPENDING = Signals.SIGTSTP  # Ctrl-Z
ENDING = frozenset(signal.valid_signals()) - UNCATCHABLE - FAULTS - HARMLESS - IGNORED - {SUSPENDING}
# Taken even where they are ignored: a shell script starts what it puts into the background with SIGINT and SIGQUIT so.
ASKED = frozenset({Signals.SIGTERM, Signals.SIGINT, Signals.SIGQUIT})


def handle_signals(end: Callable[[str], None], suspend: Callable[[str], None]) -> None:
    """Have the running loop call ``end`` or ``suspend`` with a signal's name from now on, until the loop is closed."""
    loop = asyncio.get_running_loop()
    for number in IGNORED:
        signal.signal(number, signal.SIG_IGN)
    for number in {*ENDING, SUSPENDING}:
        if number in ASKED or signal.getsignal(number) is signal.SIG_DFL:
            loop.add_signal_handler(number, suspend if number == SUSPENDING else end, name_of(number))


def name_of(number: int) -> str:
    """Return what kill(1) calls a signal; most real-time signals have no name but by their distance."""
    try:
        return Signals(number).name
    except ValueError:
        return f"SIGRTMIN+{number - Signals.SIGRTMIN}"
