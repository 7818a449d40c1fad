"""What a third party's package would bring."""

from __future__ import annotations

from dataclasses import replace

from wayfarer.drivers.cmps14 import CMPS14
from wayfarer.escape.catalogue import CATALOGUE


class Chipless(CMPS14):
    """A driver for whose part nobody has written a simulated chip."""


spiral = replace(CATALOGUE["pledge"], name="spiral", summary="round and round")
