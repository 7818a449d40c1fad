from __future__ import annotations

from tests.browser import browser_page

__all__ = ["browser_page"]  # a fixture for the tests here
