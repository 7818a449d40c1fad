"""Fixtures of the control loop's tests."""

from __future__ import annotations

import pytest

from tests.kit.workshop import Workshop


@pytest.fixture
def shop() -> Workshop:
    return Workshop()
