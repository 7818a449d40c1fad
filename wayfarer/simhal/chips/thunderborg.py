"""Simulated ThunderBorg motor board on I2C; it drives the simulated world's wheels.

Commands, lengths and replies as in PiBorg's ThunderBorg.py. If that is silent the chip takes the harder case: the
LEDs show the battery at power-up, the drive fault flags are up until both motors have been driven, requests do not keep
the failsafe from tripping, and the filler of a reply is not zero.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from typing import Literal

from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.motor_board import MotorBoardChip
from wayfarer.simhal.world.simulated_world import SimulatedWorld

ADDRESS = 0x15
FULL_LEVEL = 255 * 0.95  # the level that is duty 1 in the world: 12 V motors behind a limit of 95 %
FAILSAFE_S = 0.25

_ID = 0x15
_FORWARD, _REVERSE = 1, 2
_FILLER = 0xFF
_REPLY_BYTES = 6
_FULL_VOLTS = 36.3
_LIMITS_AT_DELIVERY = (int(7.0 / _FULL_VOLTS * 255), int(35.0 / _FULL_VOLTS * 255))  # volts for red and for green
_REMEMBERED_WRITES = 200

_A, _B = 0, 1


class ThunderBorgChip(MotorBoardChip):
    """Implements ``buses.I2CChip``.

    Args:
        volts: battery; None is the world's. An attribute, so that it can be drained.
        left: the output that the left wheels are on, the other drives the right ones.

    ``drive_faults`` holds the motors (0 is A, 1 is B) whose fault flags a test wants up; ``colours`` what the two LEDs
    were told; ``writes`` the latest writes; ``address`` what the EEPROM says, for the bench to attach the chip at.
    """

    def __init__(
        self, world: SimulatedWorld, clock: Callable[[], float], volts: float | None = None, *,
        full_level: float = FULL_LEVEL,
        left: Literal["A", "B"] = "B", reverse_left: bool = False, reverse_right: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(
            world, clock, full_level,
            left_is_second=left == "B", reverse_left=reverse_left, reverse_right=reverse_right,
        )  # fmt: skip
        self.volts = volts
        self.drive_faults: set[int] = set()
        self.writes: deque[bytes] = deque(maxlen=_REMEMBERED_WRITES)
        self.address = ADDRESS
        self.led_limits = _LIMITS_AT_DELIVERY
        self._setters = self._table_of_setters()
        self._getters = self._table_of_getters()
        self._power_up()

    @property
    def stops_by_s(self) -> float:
        """When the failsafe stops the motors unless a drive command comes before; infinite while it is off."""
        return self._trips_at_s if self.failsafe else inf

    def power_cycle(self) -> None:
        """Lose power for a moment: motors off, and all forgotten but the EEPROM's address and LED limits."""
        self.tick()
        self._stop(self._clock())
        self._power_up()

    def _power_up(self) -> None:
        self.failsafe = False
        self.shows_battery = True
        self.colours = [(0, 0, 0), (0, 0, 0)]
        self._never_driven = {_A, _B}
        self._reply: bytes | None = None
        self._trips_at_s = 0.0

    def write(self, data: bytes) -> None:
        """Take a command; a request is answered by the reads that follow."""
        self.tick()
        self.writes.append(data)
        command, *values = data or b"\0"
        if command in self._getters and not values:
            self._reply = bytes((command, *self._getters[command]()))
        elif command in self._setters and len(values) == self._setters[command][0]:
            self._reply = None
            self._setters[command][1](*values)
        else:
            raise ChipMisuse(f"ThunderBorg: no command {data.hex(' ') or 'without a byte'}")

    def read(self, count: int) -> bytes:
        """Give the reply to the last request."""
        self.tick()
        if self._reply is None or count != _REPLY_BYTES:
            raise ChipMisuse(f"ThunderBorg: a read of {count} bytes; every reply has 6, and follows a request")
        return self._reply.ljust(_REPLY_BYTES, bytes((_FILLER,)))

    # -- commands ------------------------------------------------------------------------------------------------

    def _table_of_setters(self) -> Mapping[int, tuple[int, Callable[..., None]]]:
        """Return the number of data bytes, and what to do, by command."""
        return {
            1: (3, partial(self._light, 0)),
            3: (3, partial(self._light, 1)),
            5: (3, self._light_both),
            6: (1, self._show_battery),
            8: (1, lambda level: self._drive(level, self.levels[_B])),
            9: (1, lambda level: self._drive(-level, self.levels[_B])),
            11: (1, lambda level: self._drive(self.levels[_A], level)),
            12: (1, lambda level: self._drive(self.levels[_A], -level)),
            14: (1, lambda _: self._drive(0, 0)),
            17: (1, lambda level: self._drive(level, level)),
            18: (1, lambda level: self._drive(-level, -level)),
            19: (1, self._set_failsafe),
            22: (2, self._limit_leds),
            24: (4, lambda *_: None),  # for a strip of further LEDs, which is not there
            170: (1, self._move_to),
        }

    def _table_of_getters(self) -> Mapping[int, Callable[[], tuple[int, ...]]]:
        """Return what makes the answer, by command."""
        return {
            2: lambda: self.colours[0],
            4: lambda: self.colours[1],
            7: lambda: (int(self.shows_battery),),
            10: lambda: self._motor(_A),
            13: lambda: self._motor(_B),
            15: lambda: (int(_A in self.drive_faults or bool(self._never_driven)),),
            16: lambda: (int(_B in self.drive_faults or bool(self._never_driven)),),
            20: lambda: (int(self.failsafe),),
            21: self._voltage,
            23: lambda: self.led_limits,
            153: lambda: (_ID,),
        }

    def _voltage(self) -> tuple[int, int]:
        volts = self._world.battery_v if self.volts is None else self.volts
        return divmod(round(volts / _FULL_VOLTS * 1023), 256)

    def _light(self, led: int, red: int, green: int, blue: int) -> None:
        if not self.shows_battery:
            self.colours[led] = red, green, blue

    def _light_both(self, red: int, green: int, blue: int) -> None:
        self._light(0, red, green, blue)
        self._light(1, red, green, blue)

    def _show_battery(self, state: int) -> None:
        self.shows_battery = bool(state)

    def _limit_leds(self, red: int, green: int) -> None:
        self.led_limits = red, green

    def _move_to(self, address: int) -> None:
        self.address = address

    def _set_failsafe(self, state: int) -> None:
        if state and not self.failsafe:
            self._trips_at_s = self._clock() + FAILSAFE_S
        self.failsafe = bool(state)

    # -- motors --------------------------------------------------------------------------------------------------

    def _motor(self, motor: int) -> tuple[int, int]:
        level = int(self.levels[motor])
        return (_FORWARD if level >= 0 else _REVERSE), abs(level)

    def _drive(self, a: float, b: float) -> None:
        """Take new levels for A and B, and be quiet about the failsafe for its interval."""
        now_s = self._clock()
        self._trips_at_s = now_s + FAILSAFE_S
        self._never_driven -= {motor for motor, level in ((_A, a), (_B, b)) if level}
        self._turn(now_s, (a, b))
