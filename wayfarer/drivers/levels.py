"""Converts duties to the levels of a motor board, and back."""

from __future__ import annotations

from typing import Protocol

from wayfarer.hal import WheelCommand


class Wiring(Protocol):
    """What a motor board's settings say of its motors."""

    @property
    def duty_limit(self) -> float:
        """Highest share of the battery's voltage that they get."""

    @property
    def reverse_left(self) -> bool:
        """Whether the left ones turn backwards when told to go forward."""

    @property
    def reverse_right(self) -> bool:
        """The same of the right ones."""


class MotorLevels:
    """The levels of both sides' motors: whole steps, negative for reverse, up to what the board is allowed.

    A duty of 1 is ``duty_limit`` of the board's ``full_level``; duties are cut to its steps, towards zero. A side is
    reversed where its motors turn backwards when told to go forward.
    """

    def __init__(self, full_level: int, wiring: Wiring) -> None:
        self._steps = full_level * wiring.duty_limit
        self._left_sign = -1 if wiring.reverse_left else 1
        self._right_sign = -1 if wiring.reverse_right else 1

    def of(self, command: WheelCommand) -> tuple[int, int]:
        """Return the levels of left and right; duties beyond -1..1 count as these.

        Raises:
            ValueError: a duty is not a number; it must reach no motor.
        """
        return self._left_sign * self._level(command.left), self._right_sign * self._level(command.right)

    def duties(self, left: int, right: int) -> WheelCommand:
        """Return the duties that these levels are."""
        return WheelCommand(left * self._left_sign / self._steps, right * self._right_sign / self._steps)

    def _level(self, duty: float) -> int:
        return int(self._steps * min(max(duty, -1.0), 1.0))
