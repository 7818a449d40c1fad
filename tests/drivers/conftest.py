"""A board without a Raspberry Pi, for parts at GPIO pins."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def board(request: pytest.FixtureRequest) -> Iterator[Any]:
    """gpiozero's own mock of the pins; a module that needs another kind of them names it in ``PIN_CLASS``."""
    gpiozero = pytest.importorskip("gpiozero")
    mock = pytest.importorskip("gpiozero.pins.mock")
    pin_class = getattr(mock, getattr(request.module, "PIN_CLASS", "MockPin"))
    gpiozero.Device.pin_factory = factory = mock.MockFactory(pin_class=pin_class)
    yield factory
    gpiozero.Device.pin_factory = None
    factory.close()
