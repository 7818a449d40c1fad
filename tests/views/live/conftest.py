"""A browser for the tests that want one."""

from tests.browser import browser_page, chromium

__all__ = ["browser_page", "chromium"]
