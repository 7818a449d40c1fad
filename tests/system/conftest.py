"""A daemon's site for each test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.system.hil_setup import Site, hil_site


@pytest.fixture
def site(request: pytest.FixtureRequest) -> Iterator[Site]:
    """The ForestRover's, or that of the rover that a test's parameter names."""
    with hil_site(getattr(request, "param", "forestrover")) as made:
        yield made
