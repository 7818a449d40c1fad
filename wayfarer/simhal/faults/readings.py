"""Faults of readings: changes to what a driver returns."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from math import isfinite
from random import Random
from typing import Any

from wayfarer.errors import NotResponding
from wayfarer.simhal.faults.scoped import Effect, added, listed

Change = Callable[[Any], Any]

# What garbage is made of, besides any number in the range of a 16-bit register.
_STRANGE = (float("nan"), float("inf"), float("-inf"), -1.0, 1e300, 0.0)


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


def _with(reading: Any, name: str, value: float) -> Any:
    """Return a reading with another value; headings go round, as every driver has them."""
    return reading._replace(**{name: value % 360.0 if name == "heading_deg" and isfinite(value) else value})


def _frozen(part: FaultyPart) -> Change:
    """Repeat what was read last; a part that has not spoken yet has nothing to repeat."""
    return lambda reading: reading if part.last is None else part.last._replace(t_s=reading.t_s)


def _value(to: Callable[[float, Any, Random], float]) -> Effect:
    """Return what changes one value of each reading."""

    def effect(part: FaultyPart, params: Any, rng: Random) -> AbstractContextManager[None]:
        return listed(
            part.changes,
            lambda reading: _with(reading, params.of, to(getattr(reading, params.of), params, rng)),
        )

    return effect


def _reading(make: Callable[[Any, Random], Change]) -> Effect:
    """Return what changes readings as a whole."""
    return lambda part, params, rng: listed(part.changes, make(params, rng))


def _jumps(params: Any, _: Random) -> Change:
    count = 0

    def change(reading: Any) -> Any:
        nonlocal count
        count += 1
        return reading if count % params.every else _with(reading, params.of, getattr(reading, params.of) + params.by)

    return change


def _drifts(params: Any, _: Random) -> Change:
    since_s: float | None = None

    def change(reading: Any) -> Any:
        nonlocal since_s
        if since_s is None:
            since_s = reading.t_s
        return _with(reading, params.of, getattr(reading, params.of) + params.per_s * (reading.t_s - since_s))

    return change


def _becomes(params: Any, _: Random) -> Change:
    return lambda reading: reading._replace(**{params.of: float(params.value)})


def _garbage(params: Any, rng: Random) -> Change:
    def change(reading: Any) -> Any:
        if rng.random() >= params.chance:
            return reading
        numbers = [name for name, value in reading._asdict().items() if isinstance(value, float) and name != "t_s"]
        return reading._replace(
            **{name: rng.choice(_STRANGE) if rng.random() < 0.5 else rng.uniform(-32768.0, 32767.0) for name in numbers}
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


@contextmanager
def _crash(part: FaultyPart, _: object, __: Random) -> Iterator[None]:
    part.crash = Bug("a bug in a driver, injected")
    yield
    part.crash = None


EFFECTS: Mapping[str, Effect] = {
    "silent": lambda part, _, __: added(part, silent=1),
    "frozen": lambda part, _, __: listed(part.changes, _frozen(part)),
    "offset": _value(lambda value, params, _: value + params.by),
    "jumps": _reading(_jumps),
    "noisy": _value(lambda value, params, rng: value + rng.gauss(0.0, params.sd)),
    "drifts": _reading(_drifts),
    "negated": _value(lambda value, _, __: -value),
    "becomes": _reading(_becomes),
    "saturated": _value(lambda value, params, _: max(-params.limit, min(value, params.limit))),
    "garbage": _reading(_garbage),
    "not_a_number": _reading(_becomes),
    "delayed": _reading(_delayed),
    "late_answer": lambda part, params, _: added(part, answers_after_s=params.by_s),
    "task_crash": _crash,
}
