"""Starts and ends faults at their times in one run."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from math import inf
from typing import Any, Protocol

from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import BadInput, NotResponding
from wayfarer.hal import Rover
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.fault_kind import PARTS
from wayfarer.simhal.faults.kinds import Fault, misplaced
from wayfarer.simhal.faults.process import TakePower
from wayfarer.simhal.faults.readings import FaultyPart
from wayfarer.simhal.faults.wires import FaultyBuses, wired_part
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.simulated_world import SimulatedWorld

PUMP_S = 0.05


class NoteFault(Protocol):
    """Takes what a fault did, for the log: ground truth that no field code sees."""

    def __call__(self, t_s: float, fault: Fault, *, begins: bool) -> None:
        """Take the beginning of a fault, or its end."""


class Injector:
    """Holds the faults of one run.

    Build the rover over ``buses``, pass it through ``instrument``, and ``start`` when the run begins. ``end`` ends what
    still lasts.

    Args:
        faults: what is to go wrong.
        config: the rover, for where its parts are.
        seed: of the faults' own chance, which is apart from the world's.
    """

    def __init__(self, faults: Iterable[Fault], config: RoverConfig, seed: int) -> None:
        self._faults = tuple(faults)
        self._config = config
        self._streams = RandomStreams(seed)
        self._parts: dict[str, FaultyPart] = {}
        self._lasting: dict[int, ExitStack] = {}
        self.buses = FaultyBuses()

    @property
    def board(self) -> Any:
        """The chip of the motor board; None at device depth, if there is none."""
        if "motors" not in self._config.parts:
            return None
        with suppress(NotResponding):
            return wired_part("motors", self._config, self.buses).chip
        return None

    def instrument(self, rover: Rover) -> Rover:
        """Return the rover with everything around its parts that the faults need.

        Raises:
            BadInput: the rover has no such part, or one to which a fault cannot happen.
        """
        for fault in self._faults:
            if isinstance(fault.params, BusFault) and (why := misplaced(fault, self._config)):
                raise BadInput(f"{fault}: {why}")
        changed = {fault.target for fault in self._faults if not isinstance(fault.params, BusFault)} & set(PARTS)
        for name in changed:
            if getattr(rover, name) is None:
                raise BadInput(f"rover '{self._config.name}' has no {name} to inject a fault into")
            self._parts[name] = FaultyPart(getattr(rover, name))
        fitted: dict[str, Any] = dict(self._parts)
        return replace(rover, **fitted)

    def start(self, world: SimulatedWorld, take_power: TakePower, notes: Sequence[NoteFault] = ()) -> None:
        """Begin what begins at once, and the rest at its time from now on; ``notes`` are called with each."""
        self._world, self._take_power, self._notes = world, take_power, notes
        loop = asyncio.get_running_loop()
        self._pump(loop)
        for number, fault in enumerate(self._faults):
            if fault.at_s <= 0.0:
                self.begin(number, fault)
            else:
                loop.call_later(fault.at_s, self.begin, number, fault)

    def _pump(self, loop: asyncio.AbstractEventLoop) -> None:
        """Let the world continue, and chips act, even if no part asks: faults may silence all of them."""
        self._world.tick_chips()
        self._world.advance_to(loop.time())
        if self._faults:
            loop.call_later(PUMP_S, self._pump, loop)

    def end(self) -> None:
        """End all that lasts, the latest first, and begin nothing more."""
        self._faults = ()
        for number in reversed(list(self._lasting)):
            self._lasting.pop(number).close()

    def begin(self, number: int, fault: Fault) -> None:
        """Begin a fault now, independent of its time; it lasts as long as it says. ``number`` identifies it."""
        if not self._faults:
            return
        loop = asyncio.get_running_loop()
        for note in self._notes:
            note(loop.time(), fault, begins=True)
        stack = self._lasting[number] = ExitStack()
        rng = self._streams.random(f"fault.{number}")
        stack.enter_context(fault.params.effect(self._target(fault), rng))
        if fault.for_s < inf:
            loop.call_later(fault.for_s, self.end_fault, number, fault)

    def end_fault(self, number: int, fault: Fault) -> None:
        """End a fault that lasts; nothing happens if it has ended."""
        stack = self._lasting.pop(number, None)
        if stack is not None:
            stack.close()
            for note in self._notes:
                note(asyncio.get_running_loop().time(), fault, begins=False)

    def _target(self, fault: Fault) -> Any:
        if isinstance(fault.params, BusFault):
            return wired_part(fault.target, self._config, self.buses)
        beside = {"world": self._world, "process": self._take_power}
        return beside[fault.target] if fault.target in beside else self._parts[fault.target]
