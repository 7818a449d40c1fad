"""What each tick makes: the readings of the sensors, and the commands of the wheels; see ``hal`` for their conventions.

They take any numbers, such as NumPy's, and have Python's own, also if this is not compiled. They are used like named
tuples. They are none, because the ``__new__`` of those is interpreted also in a compiled tick.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from enum import Enum
from typing import Any, ClassVar, Final, NamedTuple, Self, SupportsFloat, SupportsInt


class Value:
    """Base of values that are made in each tick: it unpacks, compares and is replaced like a named tuple.

    A value is not to be changed. ``__match_args__`` has its names, in the order of ``__init__``.
    """

    __match_args__: ClassVar[tuple[str, ...]] = ()

    def _asdict(self) -> dict[str, Any]:
        """Return all by their names."""
        return {name: getattr(self, name) for name in self.__match_args__}

    def _replace(self, **changes: Any) -> Self:
        """Return the same with these changes."""
        return type(self)(**(self._asdict() | changes))

    def __iter__(self) -> Iterator[Any]:
        return iter(self._asdict().values())

    def __len__(self) -> int:
        return len(self.__match_args__)

    def __getitem__(self, index: int | slice) -> Any:
        return tuple(self)[index]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        """Return the array that numpy makes of it, which asks: compiled, a value has not what a sequence has in C."""
        return sys.modules["numpy"].array(tuple(self), dtype)

    def __eq__(self, other: object) -> bool:
        return self is other or tuple(self) == (tuple(other) if isinstance(other, Value) else other)

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self._asdict().items())})"

    def __reduce__(self) -> tuple[type[Self], tuple[Any, ...]]:
        return type(self), tuple(self)


class Side(Enum):
    """Where the body touches something, seen from the rover."""

    FRONT = "front"
    LEFT = "left"
    RIGHT = "right"
    REAR = "rear"


class CompassReading(Value):
    """Heading and tilt of the body at ``t_s``.

    ``calibration`` is 0 (not calibrated) to 3 (fully), or None if the part does not report it.
    """

    __match_args__ = ("t_s", "heading_deg", "pitch_deg", "roll_deg", "calibration")

    def __init__(
        self, t_s: float, heading_deg: float, pitch_deg: float, roll_deg: float, calibration: SupportsInt | None
    ) -> None:
        self.t_s: Final = float(t_s)
        self.heading_deg: Final = float(heading_deg)
        self.pitch_deg: Final = float(pitch_deg)
        self.roll_deg: Final = float(roll_deg)
        # What is right already needs no call, which would be a tenth of the work here.
        self.calibration: Final[int | None] = (
            calibration if calibration is None or isinstance(calibration, int) else int(calibration)
        )


class MotionReading(Value):
    """Displacement over ground since the previous read, in the body's own frame.

    ``quality`` is from 0 (nothing is known) to 1. **Low quality means unknown, never still**: a leaf on the lens also
    gives zero. A sensor that measures how much the picture changed but not in which direction (successive images of a
    forward-looking camera) is not ``signed``: its ``forward_m`` is a magnitude.
    """

    __match_args__ = ("t_s", "forward_m", "right_m", "quality", "signed")

    def __init__(self, t_s: float, forward_m: float, right_m: float, quality: float, signed: object = True) -> None:
        self.t_s: Final = float(t_s)
        self.forward_m: Final = float(forward_m)
        self.right_m: Final = float(right_m)
        self.quality: Final = float(quality)
        self.signed: Final = signed is True or (signed is not False and bool(signed))


class ContactReading(NamedTuple):
    """What touches the body at ``t_s``.

    ``sides`` is empty when nothing does. ``obstacle_bearing_deg`` is the compass bearing of the long axis of the
    obstacle, in [0, 180), or None if that is not known (a tree, a rover that cannot sense it).
    """

    t_s: float
    sides: tuple[Side, ...]
    obstacle_bearing_deg: float | None


class WheelReading(Value):
    """What the wheels of both sides did until ``t_s``: the way of their rims, and the current of their motors.

    ``left_m`` and ``right_m`` are how far the rims of a side have turned since the previous read, ahead positive; where
    the body went meanwhile is another matter. ``left_a`` and ``right_a`` are the size of the current of a side's motors
    in amperes, 0 or more. Each is None if the part does not measure it, or does not know it now, as at the first read.
    """

    __match_args__ = ("t_s", "left_m", "right_m", "left_a", "right_a")

    def __init__(
        self,
        t_s: float,
        left_m: SupportsFloat | None,
        right_m: SupportsFloat | None,
        left_a: SupportsFloat | None = None,
        right_a: SupportsFloat | None = None,
    ) -> None:
        self.t_s: Final = float(t_s)
        self.left_m: Final = None if left_m is None else float(left_m)
        self.right_m: Final = None if right_m is None else float(right_m)
        self.left_a: Final = None if left_a is None else float(left_a)
        self.right_a: Final = None if right_a is None else float(right_a)


class WheelCommand(Value):
    """Duty of the left and right wheels, each in -1 (full reverse) to 1 (full ahead); 0 stops."""

    __match_args__ = ("left", "right")

    def __init__(self, left: float, right: float) -> None:
        self.left: Final = float(left)
        self.right: Final = float(right)


STOP: Final = WheelCommand(0.0, 0.0)
