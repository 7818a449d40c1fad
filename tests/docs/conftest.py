"""Fixtures shared with the tests of the commands."""

from __future__ import annotations

from tests.cli.conftest import own_folders

__all__ = ["own_folders"]
