"""Conditions from the computer's power supply, as a Raspberry Pi's firmware reports it. Pure: time is an input.

A supply whose voltage drops when the motors start can reset the computer. So the rover continues with less duty while
the voltage is too low, and holds for a while if it drops repeatedly.
"""

from __future__ import annotations

from collections import deque
from math import inf

from wayfarer.safety.conditions import Condition

# The firmware's power and heat flags: bits 0 to 3 are the state now, 16 to 19 what happened since boot (field.md 4).
UNDER_VOLTAGE_NOW, SLOWED_NOW, UNDER_VOLTAGE_SINCE_BOOT, SLOWED_SINCE_BOOT = 0x1, 0xE, 0x10000, 0xE0000

DIPS, DIPS_S = 3, 60.0  # "repeated 3x/min": fault catalogue, fault 32


class SupplyMonitor:
    """Turns the firmware's flags into conditions; ``flags`` are the latest, None where the computer does not report it.

    ``noticed`` says whether the voltage has dropped so far: before that there is no condition.
    """

    def __init__(self) -> None:
        self.flags: int | None = None
        self.noticed = False
        self._dips_s = deque([-inf] * DIPS, maxlen=DIPS)

    def update(self, t_s: float, flags: int | None) -> None:
        """Take the flags as they are at ``t_s``."""
        was_low, self.flags = self._is_low, flags
        if self._is_low and not was_low:
            self._dips_s.append(t_s)
            self.noticed = True

    def conditions(self, t_s: float) -> tuple[Condition, ...]:
        """Return the conditions at ``t_s``: less duty while the voltage is low, a hold while it drops too often."""
        low = (Condition.UNDERVOLTAGE,) if self._is_low else ()
        return (*low, Condition.POWER_UNSTABLE) if t_s - self._dips_s[0] < DIPS_S else low

    @property
    def _is_low(self) -> bool:
        return bool((self.flags or 0) & UNDER_VOLTAGE_NOW)


def meaning(flags: int) -> str:
    """Return the meaning of flags, in words."""
    said = {
        UNDER_VOLTAGE_NOW: "under-voltage now",
        SLOWED_NOW: "slowed down now",
        UNDER_VOLTAGE_SINCE_BOOT: "under-voltage since boot",
        SLOWED_SINCE_BOOT: "slowed down since boot",
    }
    return ", ".join(text for bits, text in said.items() if flags & bits) or "all well"
