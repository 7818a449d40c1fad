"""Settings of the field log: how much disk space it may use."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Annotated

from annotated_types import Interval


@dataclass(frozen=True, slots=True)
class LogSettings:
    """Limits of one run's log, in MB (1,000,000 bytes). At 20 Hz a run writes 14 kB a second: 50 MB an hour.

    A file of ``part_mb`` is an hour, small enough for an editor and for a phone's connection, and far below the 4 GB
    that a file may have on FAT. A run of more than ``run_mb``, which is most of a day and should be several parts,
    loses its oldest parts but the first, which says how it began: a daemon that stands disarmed for weeks must not fill
    the card. With less than ``free_mb`` left on the disk only events are written: the computer needs that to boot and
    to let a person log in. A rover is armed only where a part fits beside it.
    """

    part_mb: Annotated[float, Interval(ge=1, le=2000)] = 50.0
    run_mb: Annotated[float, Interval(ge=10, le=1_000_000)] = 1000.0
    free_mb: Annotated[float, Interval(ge=0, le=100_000)] = 100.0


# One file, whatever the disk is like: the same simulated trial writes the same bytes everywhere.
UNLIMITED = LogSettings(part_mb=inf, run_mb=inf, free_mb=0.0)
