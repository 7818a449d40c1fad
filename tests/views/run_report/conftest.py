from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import browser_page

__all__ = ["browser_page"]  # a fixture for the tests here


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Drawing takes most of the time of these tests, and the same on every Python: one of them is enough."""
    for item in items:
        if item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.slow)
