"""Conformance checks for third-party algorithms and parts; wayfarer's own pass them too.

::

    def test_my_algorithm():
        check_algorithm(my_algorithm)

    def test_my_compass():
        asyncio.run(check_compass(lambda: MyCompass(bus), unreachable=lambda: MyCompass(dead_bus)))

A part comes as a factory, because a fresh one is needed again and again. ``unreachable`` makes one whose hardware does
not answer: only with it can a failed ``open`` be checked. What is wrong is said by an ``AssertionError``. ``FakeBuses``
are buses to put simulated chips on. ``wayfarer.testing.faults`` has faults on purpose.
"""

from __future__ import annotations

from wayfarer.simhal.buses import FakeBuses
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

__all__ = [
    "FakeBuses",
    "check_algorithm",
    "check_compass",
    "check_contact_sensor",
    "check_motion_sensor",
    "check_motors",
    "check_position_receiver",
    "check_status_light",
    "check_wheel_sensor",
]
