"""What a third party's package would bring."""

from __future__ import annotations

from dataclasses import replace

from wayfarer.escape.catalogue import CATALOGUE

spiral = replace(CATALOGUE["pledge"], name="spiral", summary="round and round")
