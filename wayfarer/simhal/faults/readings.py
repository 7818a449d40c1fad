"""Faults of readings: changes to what a driver returns."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from math import isfinite
from random import Random
from typing import Any

from wayfarer.errors import NotResponding
from wayfarer.simhal.faults.kinds import Fault

Change = Callable[[Any], Any]

# What garbage is made of, besides any number in the range of a 16-bit register.
_STRANGE = (float("nan"), float("inf"), float("-inf"), -1.0, 1e300, 0.0)


class TamperedPart:
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


def reading_fault(fault: Fault, part: TamperedPart, chance: Random) -> AbstractContextManager[None]:
    """Return what makes a fault of this layer happen."""
    if fault.kind == "silent":
        return _silent(part)
    if fault.kind == "late_answer":
        return _late_answer(part, fault.params.by_s)
    if fault.kind == "frozen":
        return _changed(part, _frozen(part))
    return _changed(part, _CHANGES[fault.kind](fault.params, chance))


@contextmanager
def crashed(part: TamperedPart, error: Exception) -> Iterator[None]:
    """Have a part raise what no driver may."""
    part.crash = error
    yield
    part.crash = None


@contextmanager
def _silent(part: TamperedPart) -> Iterator[None]:
    part.silent += 1
    yield
    part.silent -= 1


@contextmanager
def _late_answer(part: TamperedPart, by_s: float) -> Iterator[None]:
    part.answers_after_s += by_s
    yield
    part.answers_after_s -= by_s


@contextmanager
def _changed(part: TamperedPart, change: Change) -> Iterator[None]:
    part.changes.append(change)
    yield
    part.changes.remove(change)


def _with(reading: Any, name: str, value: float) -> Any:
    """Return a reading with another value; headings go round, as every driver has them."""
    return reading._replace(**{name: value % 360.0 if name == "heading_deg" and isfinite(value) else value})


def _frozen(part: TamperedPart) -> Change:
    """Repeat what was read last; a part that has not spoken yet has nothing to repeat."""
    return lambda reading: reading if part.last is None else part.last._replace(t_s=reading.t_s)


def _offset(params: Any, _: Random) -> Change:
    return lambda reading: _with(reading, params.of, getattr(reading, params.of) + params.by)


def _jumps(params: Any, _: Random) -> Change:
    count = 0

    def change(reading: Any) -> Any:
        nonlocal count
        count += 1
        return reading if count % params.every else _with(reading, params.of, getattr(reading, params.of) + params.by)

    return change


def _noisy(params: Any, chance: Random) -> Change:
    return lambda reading: _with(reading, params.of, getattr(reading, params.of) + chance.gauss(0.0, params.sd))


def _drifts(params: Any, _: Random) -> Change:
    since_s: float | None = None

    def change(reading: Any) -> Any:
        nonlocal since_s
        if since_s is None:
            since_s = reading.t_s
        return _with(reading, params.of, getattr(reading, params.of) + params.per_s * (reading.t_s - since_s))

    return change


def _negated(params: Any, _: Random) -> Change:
    return lambda reading: _with(reading, params.of, -getattr(reading, params.of))


def _becomes(params: Any, _: Random) -> Change:
    return lambda reading: reading._replace(**{params.of: params.value})


def _not_a_number(params: Any, _: Random) -> Change:
    return lambda reading: reading._replace(**{params.of: float(params.value)})


def _saturated(params: Any, _: Random) -> Change:
    return lambda reading: _with(reading, params.of, max(-params.limit, min(getattr(reading, params.of), params.limit)))


def _garbage(params: Any, chance: Random) -> Change:
    def change(reading: Any) -> Any:
        if chance.random() >= params.chance:
            return reading
        numbers = [name for name, value in reading._asdict().items() if isinstance(value, float) and name != "t_s"]
        return reading._replace(
            **{
                name: chance.choice(_STRANGE) if chance.random() < 0.5 else chance.uniform(-32768.0, 32767.0)
                for name in numbers
            }
        )

    return change


def _delayed(params: Any, _: Random) -> Change:
    waiting: deque[Any] = deque()

    def change(reading: Any) -> Any:
        waiting.append(reading)
        while len(waiting) > 1 and waiting[1].t_s <= reading.t_s - params.by_s:
            waiting.popleft()
        return waiting[0]

    return change


_CHANGES: dict[str, Callable[[Any, Random], Change]] = {
    "offset": _offset,
    "jumps": _jumps,
    "noisy": _noisy,
    "drifts": _drifts,
    "negated": _negated,
    "becomes": _becomes,
    "saturated": _saturated,
    "garbage": _garbage,
    "not_a_number": _not_a_number,
    "delayed": _delayed,
}
