"""Who says that the body moved or stood, and who is believed: the names of ``anomaly_source`` in a rover file.

A witness says *moved*, *stood* or nothing. The table is in the order of belief, and the page
``docs/explanation/witnesses.md`` shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple


class Witness(NamedTuple):
    """A row of the table, in clauses without a full stop.

    ``part`` is the part of the rover that it needs, None if the compass is enough. ``cannot`` is what it does not see.
    """

    part: str | None
    stood: str
    moved: str
    nothing: str
    cannot: str


WITNESSES: Final[Mapping[str, Witness]] = {
    "motion": Witness(
        "motion",
        "the ground passed by less than 0.3 of what was possible in 0.3 s, or in 2 s",
        "the newest reading shows motion; then no other sensor is asked",
        "the picture is poor, the sensor is silent, or the rover turns on the spot",
        "anything in the dark, on black ground, with a leaf on the lens",
    ),
    "contact": Witness(
        "contact",
        "a switch is pressed: an anomaly by itself, also if the others see motion",
        "never",
        "no switch is pressed",
        "slips, and what the switches do not cover",
    ),
    "wheels": Witness(
        "wheels",
        "the rims of a side turned by less than 0.3 of what was possible in 0.3 s, or in 2 s, and its current, if "
        "`current` is named, does not show that they turn",
        "never: wheels that turn may spin",
        "the rims turn, the sensor is silent, or the rover turns on the spot",
        "slips: wheels that spin at a trunk, on leaves or on mud look like driving",
    ),
    "current": Witness(
        "wheels",
        "the motors of both sides together draw 0.7 or more of duty x stall current for as long, and rims that are "
        "measured do not turn",
        "never: a small current may be that of wheels that spin",
        "in the first 0.5 s after a start or a reversal, in sharp turns, or if the current is smaller, or zero",
        "slips, as encoders; and if `stall_current_a` is twice too high, it sees no stall, and contradicts encoders",
    ),
    "yaw": Witness(
        None,
        "the heading does not answer steering while the rover is driven ahead",
        "never",
        "it is hardly steered, or the heading answers",
        "a stall that needs no steering; ground that takes up all steering looks like one",
    ),
}
