"""Simulated motor boards, which drive the simulated world's wheels: Sabertooth 2x12 and ThunderBorg.

**Sabertooth**, in packetised serial mode: packets and commands as in the Sabertooth 2x12 User's Guide (April 2012),
pages 15 to 20, as far as the rover's driver and pysabertooth use them: each motor forward and back, minimum voltage,
serial timeout and baud rate. Of the settings only the serial timeout has an effect. Older boards take the line's speed
from the first byte (2x5 and 2x10 User's Guide, page 15).

**ThunderBorg**, on I2C: commands, lengths and replies as in PiBorg's ThunderBorg.py. If that is silent the chip takes
the harder case: the LEDs show the battery at power-up, the drive fault flags are up until both motors have been driven,
requests do not keep the failsafe from tripping, and the filler of a reply is not zero.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from typing import Final, Literal

from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.world.simulated_world import SimulatedWorld


class MotorBoardChip(ABC):
    """A board whose outputs have levels, negative for back; its deadman stops both at ``stops_by_s``.

    Args:
        world: whose wheels turn: at level / ``full_level`` from the world's next step on.
        clock: seconds on the clock of the world.
        full_level: the level at which the world's motors run at their full duty.
        left_is_second: the left wheels are on the second output, the right ones on the first.
        reverse_left: whether the left motors turn backwards when commanded forward.
        reverse_right: the same of the right ones.
    """

    def __init__(
        self, world: SimulatedWorld, clock: Callable[[], float], full_level: float, *,
        left_is_second: bool, reverse_left: bool, reverse_right: bool,
    ) -> None:  # fmt: skip
        self.levels: tuple[float, float] = (0, 0)
        self._world = world
        self._clock = clock
        self._full_level = full_level
        self._left, self._right = (1, 0) if left_is_second else (0, 1)
        self._reverse_left, self._reverse_right = reverse_left, reverse_right

    @property
    @abstractmethod
    def stops_by_s(self) -> float:
        """When the deadman stops the motors unless a command comes before; infinite while it is off."""

    def tick(self) -> None:
        """Let the deadman trip, at its own time, if that has come. Every access does this first."""
        if self.levels != (0, 0):
            trips_at_s = self.stops_by_s
            if self._clock() >= trips_at_s:
                self._stop(trips_at_s)

    def _stop(self, t_s: float) -> None:
        self._turn(t_s, (0, 0))

    def _turn(self, t_s: float, levels: tuple[float, float]) -> None:
        """Turn the wheels at the levels of both outputs from a time on."""
        self.levels = levels
        self._world.advance_to(t_s)
        left, right = levels[self._left] / self._full_level, levels[self._right] / self._full_level
        # Subtracted from 0, because -0.0 is written otherwise than 0.0.
        self._world.command(0.0 - left if self._reverse_left else left, 0.0 - right if self._reverse_right else right)


# -- Sabertooth --------------------------------------------------------------------------------------------------------

SABERTOOTH_ADDRESS: Final = 128
SABERTOOTH_FULL_LEVEL: Final = 127.0  # the level that is duty 1 in the world

_PACKET_BYTES: Final = 4
_ADDRESS_BIT: Final = 0x80  # set in the first byte of a packet, and in that one only

# What each motor command turns: the output (M1, M2), and its direction.
_MOTORS: Final = {0: (0, 1), 1: (0, -1), 4: (1, 1), 5: (1, -1)}
_SERIAL_TIMEOUT: Final = 14
_BAUD: Final = 15
# Minimum voltage, timeout, baud rate (pages 18 and 19). The user's guide gives no end for the timeout.
_SETTINGS: Final = {2: range(121), _SERIAL_TIMEOUT: range(128), _BAUD: range(1, 5)}
_TIMEOUT_UNIT_S: Final = 0.1
_AUTOBAUD: Final = 0xAA
_START_UP_S: Final = 2.0  # for which an older board ignores everything


class SabertoothChip(MotorBoardChip):
    """Implements ``buses.SerialChip``.

    Args:
        address: as set on the DIP switches, 128 to 135.
        left: the output that the left wheels are on, M1 or M2; the other drives the right ones.
        autobaud: an older board, switched on now. It ignores everything for two seconds. If the first byte then is AA,
            it takes commands; any other makes it take a wrong speed, so that it understands none until its power was
            off.

    Packets for other addresses, and any other AA, are passed over. ``settings`` holds the data of the latest setting
    commands; ``dropped`` counts packets that broke off or whose checksum was wrong. Any packet keeps the serial timeout
    from tripping.
    """

    def __init__(
        self, world: SimulatedWorld, clock: Callable[[], float], *,
        address: int = SABERTOOTH_ADDRESS, full_level: float = SABERTOOTH_FULL_LEVEL,
        left: Literal[1, 2] = 1, reverse_left: bool = False, reverse_right: bool = False, autobaud: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(
            world, clock, full_level,
            left_is_second=left == 2, reverse_left=reverse_left, reverse_right=reverse_right,
        )  # fmt: skip
        self.settings: dict[int, int] = {}
        self.dropped = 0
        self._address = address
        self._heard_s = -inf
        self._packet: list[int] = []
        self._autobaud = autobaud
        self._heard = not autobaud  # the first byte
        self._deaf = False
        self._started_s = clock() + _START_UP_S if autobaud else -inf

    @property
    def stops_by_s(self) -> float:
        """When the serial timeout stops the motors unless a packet comes before; infinite while it is off."""
        timeout_s = self.settings.get(_SERIAL_TIMEOUT, 0) * _TIMEOUT_UNIT_S
        return self._heard_s + timeout_s if timeout_s else inf

    def power_cycle(self) -> None:
        """Lose power for a moment: motors off, minimum voltage and serial timeout forgotten; the baud rate is kept."""
        self.tick()
        self.settings = {command: data for command, data in self.settings.items() if command == _BAUD}
        self._packet.clear()
        if self._autobaud:
            self._heard, self._deaf, self._started_s = False, False, self._clock() + _START_UP_S
        self._stop(self._clock())

    def receive(self, data: bytes) -> bytes:
        """Take bytes, in pieces of any length; an address begins a new packet, even if the last one is incomplete."""
        self.tick()
        self._take(data)
        return b""  # it only listens

    def _take(self, data: bytes) -> None:
        if not data or self._clock() < self._started_s:
            return
        if not self._heard:
            self._heard, self._deaf = True, data[0] != _AUTOBAUD
        if self._deaf:
            return
        packet = self._packet
        for byte in data:
            if byte & _ADDRESS_BIT:
                self.dropped += bool(packet)
                packet.clear()
                if byte == self._address:
                    packet.append(byte)
            elif packet:
                packet.append(byte)
                if len(packet) == _PACKET_BYTES:
                    self._check(packet[0], packet[1], packet[2], packet[3])
                    packet.clear()

    def _check(self, address: int, command: int, data: int, checksum: int) -> None:
        if (address + command + data) & 0x7F != checksum:
            self.dropped += 1
        elif command in _MOTORS:
            self._heard_s = self._clock()
            output, direction = _MOTORS[command]
            first, second = self.levels
            level = direction * data
            self._turn(self._heard_s, (level, second) if output == 0 else (first, level))
        elif data in _SETTINGS.get(command, ()):
            self._heard_s = self._clock()
            self.settings[command] = data
        else:
            raise ChipMisuse(f"Sabertooth: command {command} with data {data}")


# -- ThunderBorg -------------------------------------------------------------------------------------------------------

THUNDERBORG_ADDRESS: Final = 0x15
THUNDERBORG_FULL_LEVEL: Final = 255 * 0.95  # the level that is duty 1 in the world: 12 V motors behind a limit of 95 %
FAILSAFE_S: Final = 0.25

_ID: Final = 0x15
_FORWARD: Final = 1
_REVERSE: Final = 2
_FILLER: Final = 0xFF
_REPLY_BYTES: Final = 6
_FULL_VOLTS: Final = 36.3
_LIMITS_AT_DELIVERY: Final = (int(7.0 / _FULL_VOLTS * 255), int(35.0 / _FULL_VOLTS * 255))  # for red and for green
_REMEMBERED_WRITES: Final = 200

_A: Final = 0
_B: Final = 1


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
        full_level: float = THUNDERBORG_FULL_LEVEL,
        left: Literal["A", "B"] = "B", reverse_left: bool = False, reverse_right: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(
            world, clock, full_level,
            left_is_second=left == "B", reverse_left=reverse_left, reverse_right=reverse_right,
        )  # fmt: skip
        self.volts = volts
        self.drive_faults: set[int] = set()
        self.writes: deque[bytes] = deque(maxlen=_REMEMBERED_WRITES)
        self.address = THUNDERBORG_ADDRESS
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
