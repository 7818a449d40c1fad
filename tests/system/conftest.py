"""A bench for all tests of a worker, and a daemon's site for each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.hil_setup import Site, hil_site, running_bench


@pytest.fixture(scope="session")
def bench() -> Iterator[Path]:
    """It rests while no site uses it."""
    with running_bench() as path:
        yield path


@pytest.fixture
def site(request: pytest.FixtureRequest, bench: Path) -> Iterator[Site]:
    """The ForestRover's, or that of the rover that a test's parameter names."""
    with hil_site(bench, getattr(request, "param", "forestrover")) as made:
        yield made
