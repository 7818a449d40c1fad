"""Converts duties to the levels of a motor board, and back."""

from __future__ import annotations

from wayfarer.angles import clamp
from wayfarer.hal import WheelCommand


class MotorLevels:
    """The levels of both sides' motors: whole steps, negative for reverse, up to the allowed level.

    A duty of 1 is ``steps``: the board's full level times the highest share of the battery's voltage that its motors
    may get. Duties are rounded to whole steps, towards zero. A side is reversed if its motors turn backwards when they
    are commanded forwards.
    """

    def __init__(self, steps: float, *, reverse_left: bool, reverse_right: bool) -> None:
        self._steps = steps
        self._left_sign = -1 if reverse_left else 1
        self._right_sign = -1 if reverse_right else 1

    def of(self, command: WheelCommand) -> tuple[int, int]:
        """Return the levels of left and right; duties beyond -1..1 count as these.

        Raises:
            ValueError: a duty is NaN, which must not be sent to a motor.
        """
        steps, left, right = self._steps, clamp(command.left, -1.0, 1.0), clamp(command.right, -1.0, 1.0)
        return self._left_sign * int(steps * left), self._right_sign * int(steps * right)

    def duties(self, left: int, right: int) -> WheelCommand:
        """Return the duties of these levels."""
        return WheelCommand(left * self._left_sign / self._steps, right * self._right_sign / self._steps)
