"""What a rover file tells of the body that no decision needs: how it meets a branch. Only the simulator reads it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from wayfarer.bounds import Metres

Kilograms = Annotated[float, Interval(gt=0, le=1000)]
NewtonMetres = Annotated[float, Interval(gt=0, le=1000)]

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True)
class Chassis:
    """Weight, motors and belly of a rover; None where its file does not say.

    A branch that is no thicker than ``ground_clearance_m`` passes under the belly. ``motors_n_m`` is the torque of all
    motors together.
    """

    ground_clearance_m: Metres | None = None
    weight_kg: Kilograms | None = None
    motors_n_m: NewtonMetres | None = None

    @property
    def missing(self) -> tuple[str, ...]:
        """The keys that the file does not give."""
        return tuple(key for key in self.__slots__ if getattr(self, key) is None)
