"""A file of forests, from forests."""

from __future__ import annotations

import json
from collections.abc import Iterable

from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.forest_file import as_row


def lines_of(forests: Iterable[Forest]) -> bytes:
    """Return what ``forest_file`` reads: one JSON object a line."""
    return "".join(json.dumps(as_row(forest), separators=(",", ":")) + "\n" for forest in forests).encode()
