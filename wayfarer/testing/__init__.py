"""Conformance checks for third-party algorithms and parts; wayfarer's own pass them too.

::

    def test_my_algorithm():
        check_algorithm(my_algorithm)

    def test_my_compass():
        asyncio.run(check_compass(lambda: MyCompass(bus), unreachable=lambda: MyCompass(dead_bus)))

A part comes as a factory, because a fresh one is needed again and again. ``unreachable`` makes one whose hardware does
not answer: only with it can a failed ``open`` be checked. What is wrong is said by an ``AssertionError``.

A simulated part of one's own is a chip on ``FakeBuses``: on an I2C bus (``RegisterChip`` fits many parts), an
SPI device, a serial line, or at ``FakePins``. A ``SimulatedChip`` says how ``wayfarer sim --depth bus`` puts it on the
buses of a ``ChipWiring``. ``wayfarer.testing.faults`` has faults on purpose.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from wayfarer.simhal.buses import ChipMisuse, FakeBuses
from wayfarer.simhal.pins import FakePin, FakePins
from wayfarer.simhal.register_chip import RegisterChip
from wayfarer.testing.conformance import (
    check_algorithm,
    check_compass,
    check_contact_sensor,
    check_motion_sensor,
    check_motors,
    check_position_receiver,
    check_status_light,
    check_wheel_sensor,
)

if TYPE_CHECKING:
    from wayfarer.simhal.chip_wiring import ChipWiring, SimulatedChip

__all__ = [
    "ChipMisuse",
    "ChipWiring",
    "FakeBuses",
    "FakePin",
    "FakePins",
    "RegisterChip",
    "SimulatedChip",
    "check_algorithm",
    "check_compass",
    "check_contact_sensor",
    "check_motion_sensor",
    "check_motors",
    "check_position_receiver",
    "check_status_light",
    "check_wheel_sensor",
]


def __getattr__(name: str) -> Any:
    """Import what a test of an algorithm or a driver does not need: the simulated world, and numpy with it."""
    if name in {"ChipWiring", "SimulatedChip"}:
        from wayfarer.simhal import chip_wiring

        return getattr(chip_wiring, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
