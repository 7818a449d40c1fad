"""A driver's part with faults on it: what it returns is changed on the way to the field code."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from wayfarer.errors import NotResponding

Change = Callable[[Any], Any]  # of a reading


class Bug(RuntimeError):
    """What a driver with a bug raises."""


class FaultyPart:
    """A part with faults on it; everything that no fault changes goes through as it is.

    ``changes`` are applied to each reading in turn. ``silent`` parts raise ``NotResponding`` at any question or
    command, and one with a ``crash`` raises that, as a bug in a driver would. ``answers_after_s`` delays every answer.
    ``last`` is the latest reading as it was handed on.
    """

    def __init__(self, part: Any) -> None:
        self._part = part
        self.changes: list[Change] = []
        self.silent = 0
        self.crash: Exception | None = None
        self.answers_after_s = 0.0
        self.last: Any = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._part, name)

    async def open(self) -> None:
        """Open the part."""
        await self._apply_faults()
        await self._part.open()

    async def read(self) -> Any:
        """Return a reading, changed."""
        await self._apply_faults()
        reading = await self._part.read()
        for change in self.changes:
            reading = change(reading) if reading is not None else None
        self.last = reading
        return reading

    async def drive(self, command: Any) -> Any:
        """Hand a command on; where the answer is late, the wheels were not: no bus carries a command that old."""
        self._refuse()
        applied = await self._part.drive(command)
        await self._wait()
        return applied

    async def health(self) -> Any:
        """Hand the question on."""
        await self._apply_faults()
        return await self._part.health()

    async def read_back(self) -> Any:
        """Hand the question on."""
        await self._apply_faults()
        return await self._part.read_back()

    async def stop(self) -> None:
        """Hand the stop on, unless the part hears nothing."""
        if not self.silent:
            await self._part.stop()

    def halt(self) -> None:
        """Hand the stop on, unless the part hears nothing."""
        if not self.silent:
            self._part.halt()

    async def _apply_faults(self) -> None:
        await self._wait()
        self._refuse()

    async def _wait(self) -> None:
        if self.answers_after_s:
            await asyncio.sleep(self.answers_after_s)

    def _refuse(self) -> None:
        if self.crash is not None:
            raise self.crash
        if self.silent:
            raise NotResponding(f"{self._part.name}: no answer; a fault was injected")
