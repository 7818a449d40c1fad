"""``wayfarer check``, ``calibrate`` and ``install-service``: looking after a rover."""

from __future__ import annotations


def check() -> None:
    """Check every part."""


def calibrate() -> None:
    """Calibrate."""


def install_service() -> None:
    """Install."""
