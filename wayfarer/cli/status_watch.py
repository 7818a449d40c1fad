"""``wayfarer status --watch``: the status every second, until Ctrl-C.

Each time is one short request, so that no place at the daemon's socket stays taken. A daemon that is gone is waited
for, because a person who watches may be restarting it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from threading import Event

from wayfarer.errors import WayfarerError
from wayfarer.fieldlog.clock import local_time, wall_clock
from wayfarer.views.text.colour import painted

EVERY_S = 1.0


def watch_in_place(tell: Callable[[], str]) -> None:
    """Show what ``tell`` returns, or why it cannot, always at the same place of the terminal."""
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    with suppress(KeyboardInterrupt), Live(console=Console(), auto_refresh=False) as live:
        for told in _every_second(tell):
            text = painted(_waiting(told), "fault") if isinstance(told, WayfarerError) else told
            title = painted(f"{_now()}, once a second; Ctrl-C ends", "quiet")
            live.update(Text.from_ansi(f"{title}\n{text}"), refresh=True)


def watch_changes(tell: Callable[[], str]) -> None:
    """Print a line with the time where what ``tell`` returns, or why it cannot, is not what it was a second ago."""
    before = ""
    with suppress(KeyboardInterrupt):
        for told in _every_second(tell):
            text = _waiting(told) if isinstance(told, WayfarerError) else told
            if text != before:
                print(f"{_now()}  {text}", flush=True)
            before = text


def watch_documents(tell: Callable[[], str]) -> None:
    """Print what ``tell`` returns, each time, and on stderr why it cannot."""
    missed = ""
    with suppress(KeyboardInterrupt):
        for told in _every_second(tell):
            if isinstance(told, str):
                print(told, flush=True)
            elif str(told) != missed:
                print("wayfarer:", _waiting(told), file=sys.stderr, flush=True)
            missed = "" if isinstance(told, str) else str(told)


def _every_second(tell: Callable[[], str]) -> Iterator[str | WayfarerError]:
    while True:
        try:
            yield tell()
        except WayfarerError as error:
            yield error
        Event().wait(EVERY_S)  # there is no event loop that sleeping could hold up


def _waiting(error: WayfarerError) -> str:
    return f"{error}; waiting"


def _now() -> str:
    return local_time(wall_clock(0.0), "%H:%M:%S")
