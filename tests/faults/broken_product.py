"""Tests that break wayfarer on purpose, to see that it is noticed."""

from __future__ import annotations

import pytest

from wayfarer.control import is_compiled

breaks_the_product = pytest.mark.skipif(is_compiled(), reason="compiled classes cannot be broken from outside")
