"""Driving by hand from the page: the lease of one viewer, and how old what it sends may be.

The page is never told its lease. It is kept here, with the connection: no other page can use it, and it ends when the
connection ends. Nothing is remembered for a page that connects again.

A sample of the pad says when it was taken, on the daemon's clock as the page knows it from the answers to earlier
samples (``page/rover_clock.js``). That is late by what a message takes to the page, and never ahead. So the daemon can
refuse what waited in a network or in a busy browser.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

from wayfarer.daemon.socket.protocol import Commands, Details, RequestRefused, check, perform
from wayfarer.errors import WayfarerError

BEGIN, DRIVE, END = VERBS = ("manual_begin", "manual_drive", "manual_end")
DRIVER = "page"  # for the log


class ManualLease:
    """What one viewer may drive: nothing before ``begin``, and nothing after ``end``.

    Args:
        commands: what the daemon can do.
        is_there: returns whether the viewer has the page open.
    """

    def __init__(self, commands: Commands, is_there: Callable[[], bool]) -> None:
        self._commands = commands
        self._is_there = is_there
        self._lease: object = None
        self._asking = False

    async def begin(self, asked_s: object) -> Details:
        """Ask for the wheels, and return ``deadman_s``; ``asked_s`` is when the person asked, on the daemon's clock.

        Raises:
            RequestRefused: they cannot be had now, or this viewer has asked already.
        """
        if self._asking:
            raise RequestRefused("this page has asked to drive by hand already: wait for the answer")
        self._asking = True
        try:
            details = await self._perform({"do": BEGIN, "asked_s": asked_s, "driver": DRIVER})
        finally:
            self._asking = False
        self._lease = details["lease"]
        return {"deadman_s": details["deadman_s"]}

    async def drive(self, fields: Mapping[str, object]) -> Details:
        """Drive by a sample: ``seq``, ``forward``, ``turn`` and ``sent_s``, as ``Commands.manual_drive`` takes them.

        Raises:
            WayfarerError: this viewer does not drive, or the daemon refuses the sample.
        """
        if self._lease is None:
            raise RequestRefused("this page does not drive the rover: press Drive by hand first")
        sample = {key: fields.get(key) for key in ("seq", "forward", "turn", "sent_s")}
        return await self._perform({"do": DRIVE, "lease": self._lease, **sample})

    async def end(self) -> None:
        """Let go of the wheels; safe if this viewer does not drive."""
        lease, self._lease = self._lease, None
        if lease is not None:
            with suppress(WayfarerError):  # it has ended already: somebody stopped the rover, or it fell silent
                await self._perform({"do": END, "lease": lease})

    async def _perform(self, fields: Mapping[str, object]) -> Details:
        return await perform(check(fields), self._commands, None, self._is_there)
