"""Faults of readings, and a driver's part with them on it: what it returns is changed on the way to the field code."""

from __future__ import annotations

import asyncio
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import count
from math import isfinite
from random import Random
from typing import Annotated, Any, Literal

from annotated_types import Interval

from wayfarer.angles import clamp
from wayfarer.errors import NotResponding
from wayfarer.setting_ranges import Fraction
from wayfarer.simhal.faults.fault_kind import PARTS, SENSES, FaultKind, added, listed

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
        """Hand a command on; if the answer is late, the wheels are not: no bus carries a command that old."""
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
        """Pass the stop on, unless the part receives nothing."""
        if not self.silent:
            await self._part.stop()

    def halt(self) -> None:
        """Pass the stop on, unless the part receives nothing."""
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


Delay = Annotated[float, Interval(gt=0, le=60)]

# What garbage is made of, besides any number in the range of a 16-bit register.
_STRANGE = (float("nan"), float("inf"), float("-inf"), -1.0, 1e300, 0.0)


class PartFault(FaultKind):
    """Happens to a driver's part: to all that it is asked."""

    targets = PARTS


class ReadingFault(FaultKind):
    """Changes what a driver passes on, for any answer of the part."""

    targets = SENSES

    def effect(self, part: FaultyPart, rng: Random) -> AbstractContextManager[None]:
        return listed(part.changes, self.change(part, rng))

    @abstractmethod
    def change(self, part: FaultyPart, rng: Random) -> Change:
        """Return what makes the wrong reading of a right one."""


@dataclass(frozen=True)
class ValueFault(ReadingFault):
    """Changes one value of each reading: ``of`` is its name."""

    of: str = "heading_deg"

    def each(self, wrong: Callable[[float], float]) -> Change:
        """Return what passes on ``wrong`` of each value."""
        return lambda reading: self.replaced(reading, wrong(getattr(reading, self.of)))

    def replaced(self, reading: Any, value: float) -> Any:
        """Return a reading with another value; headings go round, as every driver has them."""
        return reading._replace(**{self.of: value % 360.0 if self.of == "heading_deg" and isfinite(value) else value})


class Silent(PartFault):
    """The part does not answer."""

    def effect(self, part: FaultyPart, _: Random) -> AbstractContextManager[None]:
        return added(part, silent=1)


class Frozen(ReadingFault):
    """The last reading is repeated, with a new time."""

    def change(self, part: FaultyPart, _: Random) -> Change:
        """Repeat it; a part that has not spoken yet has nothing to repeat."""
        return lambda reading: reading if part.last is None else part.last._replace(t_s=reading.t_s)


@dataclass(frozen=True)
class Offset(ValueFault):
    """A value is off by ``by``, in the unit of the reading's own field, in one reading of ``every``."""

    by: float = 90.0
    every: Annotated[int, Interval(ge=1, le=1000)] = 1

    def change(self, _: FaultyPart, __: Random) -> Change:
        numbers = count(1)
        return self.each(lambda value: value if next(numbers) % self.every else value + self.by)


@dataclass(frozen=True)
class Noisy(ValueFault):
    """A value has normal noise of ``sd`` on it."""

    sd: Annotated[float, Interval(ge=0)] = 3.0

    def change(self, _: FaultyPart, rng: Random) -> Change:
        return self.each(lambda value: value + rng.gauss(0.0, self.sd))


@dataclass(frozen=True)
class Drifts(ValueFault):
    """A value drifts away, further by ``per_s`` each second, in the unit of the reading's own field."""

    per_s: float = 1.0

    def change(self, _: FaultyPart, __: Random) -> Change:
        since_s: float | None = None

        def drift(reading: Any) -> Any:
            nonlocal since_s
            if since_s is None:
                since_s = reading.t_s
            return self.replaced(reading, getattr(reading, self.of) + self.per_s * (reading.t_s - since_s))

        return drift


class Negated(ValueFault):
    """A value has the wrong sign: the part is mounted the other way round, or set so."""

    def change(self, _: FaultyPart, __: Random) -> Change:
        return self.each(lambda value: -value)


@dataclass(frozen=True)
class Becomes(ValueFault):
    """A value is ``value``, independent of the measured one."""

    of: str = "quality"
    value: float = 0.0

    def change(self, _: FaultyPart, __: Random) -> Change:
        """Replace it, also by what no driver would pass on, such as a heading above 360."""
        return lambda reading: reading._replace(**{self.of: self.value})


@dataclass(frozen=True)
class Saturated(ValueFault):
    """A value never leaves -limit..limit."""

    of: str = "forward_m"
    limit: Annotated[float, Interval(gt=0)] = 0.037

    def change(self, _: FaultyPart, __: Random) -> Change:
        return self.each(lambda value: clamp(value, -self.limit, self.limit))


@dataclass(frozen=True)
class Garbage(ReadingFault):
    """Every number of a reading is random, possibly out of range, infinite or NaN; this happens with ``chance``."""

    chance: Fraction = 1.0

    def change(self, _: FaultyPart, rng: Random) -> Change:

        def spoil(reading: Any) -> Any:
            if rng.random() >= self.chance:
                return reading
            numbers = [name for name, value in reading._asdict().items() if isinstance(value, float) and name != "t_s"]
            return reading._replace(
                **{
                    name: rng.choice(_STRANGE) if rng.random() < 0.5 else rng.uniform(-32768.0, 32767.0)
                    for name in numbers
                }
            )

        return spoil


@dataclass(frozen=True)
class NotANumber(ValueFault):
    """A value is NaN or infinite."""

    value: Literal["nan", "inf", "-inf"] = "nan"

    def change(self, _: FaultyPart, __: Random) -> Change:
        return lambda reading: reading._replace(**{self.of: float(self.value)})


@dataclass(frozen=True)
class Delayed(ReadingFault):
    """Readings are handed on ``by_s`` late, with the time at which they were taken."""

    by_s: Delay = 0.2

    def change(self, _: FaultyPart, __: Random) -> Change:
        waiting: deque[Any] = deque()

        def delay(reading: Any) -> Any:
            waiting.append(reading)
            while len(waiting) > 1 and waiting[1].t_s <= reading.t_s - self.by_s:
                waiting.popleft()
            return waiting[0]

        return delay


@dataclass(frozen=True)
class LateAnswer(PartFault):
    """The part takes ``by_s`` to answer."""

    by_s: Delay = 0.05

    def effect(self, part: FaultyPart, _: Random) -> AbstractContextManager[None]:
        return added(part, answers_after_s=self.by_s)
