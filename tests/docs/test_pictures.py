"""The pictures of pages show what the pages are now."""

from __future__ import annotations

import json

import pytest

for package in ("aiohttp", "bokeh", "jinja2"):
    pytest.importorskip(package, reason="the pages that the pictures show need it")

from docs.pictures import CHECKSUMS, IMAGES, checksums  # noqa: E402

pytestmark = pytest.mark.process  # pages with figures


def test_each_picture_shows_its_page_and_its_run_as_they_are_now() -> None:
    taken, now = json.loads(CHECKSUMS.read_text(encoding="utf-8")), checksums()
    assert taken == now, "a page or its run has changed since: python -m docs.pictures"
    assert {path.stem for path in IMAGES.glob("*.png")} == set(now)
