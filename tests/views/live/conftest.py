"""A browser for the tests that want one."""

from tests.browser import browser_page

__all__ = ["browser_page"]
