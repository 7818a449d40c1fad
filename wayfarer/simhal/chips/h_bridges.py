"""Simulated H-bridges at GPIO pins, and the monostable in their enable line (docs/reference/hardware.md).

An input that nobody drives is low: the boards have pull-downs. The monostable is the harder kind: only a rising edge
triggers it, and while it does not hold, both bridges are off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import inf

from wayfarer.simhal.chips.motor_boards import MotorBoardChip
from wayfarer.simhal.pins import FakePin
from wayfarer.simhal.world.simulated_world import SimulatedWorld


class HBridgesChip(MotorBoardChip):
    """Two bridges, whose levels are in whole percent of the battery's voltage.

    Args:
        left: the inputs of the left bridge by name: ``forward`` and ``backward`` (DRV8871, BTS7960), ``pwm`` and
            ``direction`` (MD10C), or ``pwm``, ``forward`` and ``backward`` (L298N, TB6612).
        right: those of the right one.
        left_enable: must be high for the left bridge; None is a jumper.
        right_enable: the same for the right one.
        trigger: what triggers the monostable; None if there is none.
        holds_s: how long it holds.
    """

    def __init__(
        self, world: SimulatedWorld, clock: Callable[[], float],
        left: Mapping[str, FakePin], right: Mapping[str, FakePin], *,
        left_enable: FakePin | None = None, right_enable: FakePin | None = None,
        trigger: FakePin | None = None, holds_s: float = 0.0,
        full_level: float = 100.0, reverse_left: bool = False, reverse_right: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(
            world, clock, full_level, left_is_second=False, reverse_left=reverse_left, reverse_right=reverse_right
        )
        self._bridges = (left, left_enable), (right, right_enable)
        self._trigger, self._holds_s = trigger, holds_s
        self._trips_at_s = -inf if trigger is not None else inf
        for pins, enable in self._bridges:
            for pin in (*pins.values(), *([enable] if enable else [])):
                pin.listeners.append(self._changed)
        if trigger is not None:
            trigger.listeners.append(partial(self._triggered, trigger))

    @property
    def stops_by_s(self) -> float:
        """When the monostable lets go unless it is triggered before; infinite if there is none."""
        return self._trips_at_s

    def power_cycle(self) -> None:
        """Lose power for a moment: the bridges remember nothing, and the monostable lets go."""
        self.tick()
        if self._trigger is not None:
            self._trips_at_s = self._clock()
        self._changed()

    def _triggered(self, trigger: FakePin) -> None:
        self.tick()
        if trigger.level:
            self._trips_at_s = self._clock() + self._holds_s
            self._changed()

    def _changed(self) -> None:
        """Follow the pins."""
        self.tick()
        now_s = self._clock()
        holds = now_s < self._trips_at_s
        first, second = (
            _percent(pins) if holds and (enable is None or enable.level) else 0 for pins, enable in self._bridges
        )
        if (first, second) != self.levels:
            self._turn(now_s, (first, second))


def _percent(pins: Mapping[str, FakePin]) -> int:
    """Return what a bridge gives its motor, negative for back; both inputs high brake."""
    high = {name: pin.level or 0.0 for name, pin in pins.items()}
    if "direction" in high:
        share = high["pwm"] * (-1.0 if high["direction"] else 1.0)
    else:
        share = high.get("pwm", 1.0) * (high["forward"] - high["backward"])
    return round(share * 100.0)
