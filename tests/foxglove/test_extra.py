"""Without Foxglove's SDK."""

from __future__ import annotations

import importlib.util

import pytest

from wayfarer.errors import WayfarerError
from wayfarer.foxglove import require_foxglove_extra


def test_missing_sdk_is_told_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.foxglove.find_spec", lambda name: None)
    with pytest.raises(WayfarerError, match=r"foxglove-sdk, which is not installed: pip install '\.\[foxglove\]'"):
        require_foxglove_extra()


def test_sdk_that_is_there_is_no_error() -> None:
    assert importlib.util.find_spec("foxglove") is not None
    require_foxglove_extra()
