"""Conformance checks for third-party algorithms and parts, and simulated chips; wayfarer's own parts pass them too.

::

    print(check_algorithm(MyAlgorithm))

    print(asyncio.run(check_compass(lambda: MyCompass(bus), unreachable=lambda: MyCompass(dead_bus))))

Each promise of ``wayfarer.hal`` and ``wayfarer.escape.api`` is a check. The first that is broken raises an
``AssertionError``, with what was seen and the sentence of the promise; the report says how many ran, and why others
could not. ``unreachable`` makes a part whose hardware does not answer: without it that is not tried. Pass a function
that makes a part, because new ones are needed again and again. Name what is known to fail with a reason:
``gaps={"deadman_stops_the_wheels": "it is off"}``; once it passes, that is an error. With pytest, each is a test::

    @pytest.mark.parametrize("check", checks_of("compass", lambda: MyCompass(bus)), ids=str)
    def test_my_compass(check):
        asyncio.run(check.run())

A simulated part of one's own is a chip on ``FakeBuses``: on an I2C bus (``RegisterChip`` fits many parts), an
SPI device, a serial line, or at ``FakePins``. A ``SimulatedChip`` says how ``wayfarer sim --depth bus`` puts it on the
buses of a ``ChipWiring``. ``wayfarer.testing.faults`` has faults on purpose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from wayfarer.config.registry import algorithm_of
from wayfarer.simhal.buses import ChipMisuse, FakeBuses, I2CChip, SerialChip, SPIChip
from wayfarer.simhal.pins import FakePin, FakePins
from wayfarer.simhal.register_chip import RegisterChip
from wayfarer.testing import algorithm_checks, part_checks
from wayfarer.testing.algorithm_checks import check_algorithm
from wayfarer.testing.part_checks import (
    check_compass,
    check_contact_sensor,
    check_motion_sensor,
    check_motors,
    check_position_receiver,
    check_status_light,
    check_wheel_sensor,
)
from wayfarer.testing.promises import Check, Report, checks_in

if TYPE_CHECKING:
    from wayfarer.simhal.chip_wiring import ChipWiring, MotorBoard, SimulatedChip

__all__ = [
    "Check",
    "ChipMisuse",
    "ChipWiring",
    "FakeBuses",
    "FakePin",
    "FakePins",
    "I2CChip",
    "MotorBoard",
    "RegisterChip",
    "Report",
    "SPIChip",
    "SerialChip",
    "SimulatedChip",
    "check_algorithm",
    "check_compass",
    "check_contact_sensor",
    "check_motion_sensor",
    "check_motors",
    "check_position_receiver",
    "check_status_light",
    "check_wheel_sensor",
    "checks_of",
]


def checks_of(
    kind: str, make: Any, unreachable: Callable[[], Any] | None = None, gaps: Mapping[str, str] | None = None
) -> list[Check]:
    """Return the checks of a kind: ``algorithm``, or a part of a rover such as ``compass``.

    ``make`` makes a part; for an algorithm it is the algorithm.

    Raises:
        ValueError: there is no such kind, or no such check among the ``gaps``.
    """
    if kind == algorithm_checks.ALGORITHM:
        make = algorithm_of(make)
    return checks_in((*part_checks.TABLE, *algorithm_checks.TABLE), kind, make, unreachable, gaps)


def __getattr__(name: str) -> Any:
    """Import what a test of an algorithm or a driver does not need: the simulated world, and numpy with it."""
    if name in {"ChipWiring", "MotorBoard", "SimulatedChip"}:
        from wayfarer.simhal import chip_wiring

        return getattr(chip_wiring, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), "ChipWiring", "MotorBoard", "SimulatedChip"]
