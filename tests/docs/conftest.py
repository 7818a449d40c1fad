"""Fixtures shared with the tests of the commands, and the browser."""

from __future__ import annotations

from tests.browser import browser_page, chromium
from tests.cli.conftest import own_folders

__all__ = ["browser_page", "chromium", "own_folders"]
