"""A rover that is checked or calibrated."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.kit.rover import Rig


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    """A healthy rover."""
    return Rig(tmp_path)
