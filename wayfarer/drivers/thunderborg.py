"""PiBorg ThunderBorg: the motor board of a MonsterBorg, on I2C.

Commands and levels are those of PiBorg's own ThunderBorg.py, the only documentation; ``thunderborg_board.py`` sends
them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Interval

from wayfarer.drivers.buses import Buses
from wayfarer.drivers.levels import MotorLevels
from wayfarer.drivers.thunderborg_board import CHIP, DEFAULT_ADDRESS, Opcode, ThunderBorgLink
from wayfarer.errors import BadReading, NotResponding, PowerLost
from wayfarer.hal import STOP, MotorHealth, WheelCommand

DEADMAN_S = 0.25  # "every 1/4 of a second"; the precision is not documented
FULL_LEVEL = 255

_FORWARD, _REVERSE = 1, 2
_FAILSAFE_TRIES = 5  # as PiBorg's own MonsterBorg scripts
_FULL_VOLTS, _FULL_RAW = 36.3, 1023

_DOES_NOT_ARM = (
    f"the failsafe does not arm: {_FAILSAFE_TRIES} times switched on, and it still reads off; nothing would stop the "
    "wheels if this computer failed: switch the board off and on, shorten the I2C cable"
)


@dataclass(frozen=True, slots=True)
class ThunderBorgSettings:
    """How the board is wired."""

    bus: str = "/dev/i2c-1"
    """Device file of the I2C bus."""
    address: Annotated[int, Interval(ge=0x03, le=0x77)] = DEFAULT_ADDRESS
    """I2C address, 7-bit."""
    duty_limit: Annotated[float, Interval(gt=0, le=1)] = 0.95
    """The highest share of the battery's voltage that the motors get: 0.95 for 12 V motors on ten NiMH cells, as in
    PiBorg's scripts."""
    left: Literal["A", "B"] = "B"
    """The output of the left wheels (a MonsterBorg's motor 2, "B"); the other one drives the right ones."""
    reverse_left: bool = False
    """The left motors turn backwards when they are commanded forwards."""
    reverse_right: bool = False
    """The right motors turn backwards when they are commanded forwards."""

    @property
    def deadman_s(self) -> float:
        """How long after the last command the board stops the motors."""
        return DEADMAN_S


class _Motor(NamedTuple):
    """One output of the board: its letter, and its commands."""

    letter: str
    forward: Opcode
    reverse: Opcode
    get: Opcode
    get_fault: Opcode


_A = _Motor("A", Opcode.SET_A_FORWARD, Opcode.SET_A_REVERSE, Opcode.GET_A, Opcode.GET_DRIVE_FAULT_A)
_B = _Motor("B", Opcode.SET_B_FORWARD, Opcode.SET_B_REVERSE, Opcode.GET_B, Opcode.GET_DRIVE_FAULT_B)


class ThunderBorg:
    """Both motors of a ThunderBorg; implements ``hal.DriveMotors``.

    A duty of 1 is ``duty_limit``. Duties are rounded to the board's levels, towards zero, and ``drive`` returns the
    rounded ones: level / (255 * duty_limit).

    The board's failsafe, off at power-up, is the deadman: it stops the motors when no drive command came for 0.25 s.
    Whether requests count as commands is not documented; the controller drives 20 times per second. In a board that
    lost its power for a moment the failsafe is off. So the board is asked before each command to move, and gets no such
    command while it is off.

    ``error_counts`` counts the transfers that were tried again, and how often the board had lost its power.
    """

    part: ClassVar[str] = "motors"
    chip: ClassVar[str] = CHIP
    addresses: ClassVar[Sequence[int]] = (DEFAULT_ADDRESS,)
    Settings = ThunderBorgSettings

    def __init__(self, settings: ThunderBorgSettings, buses: Buses) -> None:
        self._board = ThunderBorgLink(buses.i2c(settings.bus), settings.address)
        self.name = self._board.where
        self.deadman_s: float | None = settings.deadman_s
        self._halts = 0
        self._levels = MotorLevels(
            FULL_LEVEL * settings.duty_limit, reverse_left=settings.reverse_left, reverse_right=settings.reverse_right
        )
        self._left, self._right = (_A, _B) if settings.left == "A" else (_B, _A)
        self._driven: set[_Motor] = set()
        self._power_losses = 0
        self._forgot = False  # the board has lost its power, and its settings, since it was last opened

    @property
    def error_counts(self) -> dict[str, int]:
        """How many transfers were tried again, and how often the board was found to have lost its power."""
        return {"transfers retried": self._board.retries, "power lost": self._power_losses}

    async def open(self) -> None:
        """Find the board, arm its failsafe, read that back, and set both motors to zero.

        If the failsafe is off now, the board has lost power, and its drive-fault flags are ignored until both motors
        have been driven. Otherwise a fault of the last mission still counts.
        """
        await self.identify()
        with suppress(BadReading):
            if not await self._failsafe_is_on():
                self._driven.clear()
        if not await self._arm_failsafe():
            raise NotResponding(f"{self.name}: {_DOES_NOT_ARM}")
        self._forgot = False
        await self.drive(STOP)

    async def identify(self) -> None:
        """Ask the board for its id; changes nothing. Raises as ``ThunderBorgLink.identify``."""
        await self._board.identify()

    async def close(self) -> None:
        """Nothing to release; the failsafe stays armed."""

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply the command; duties beyond -1..1 count as these. One write for each side, the left first.

        A ``halt`` that comes meanwhile has priority: the motors are stopped after it. So they are if the command took
        longer than the deadman, because the process was suspended meanwhile. No wheel is commanded to turn while the
        failsafe is off: if this computer failed then, nothing would stop the wheels.

        Raises:
            NotResponding: not acknowledged three times.
            PowerLost: the board had lost its power since it was opened. Its failsafe was switched on again.
        """
        left, right = self._levels.of(command)
        halts, retries = self._halts, self._board.retries
        clock = asyncio.get_running_loop().time
        ends_s = clock() + DEADMAN_S
        if left or right:
            await self._refuse_without_failsafe()
        for motor, level in ((self._left, left), (self._right, right)):
            if self._halts == halts and clock() <= ends_s:
                await self._set(motor, level)
        if (left or right) and self._board.retries != retries:  # a board that was silent may have just started
            await self._refuse_without_failsafe()
        if self._halts != halts or clock() > ends_s:
            await self.stop()
            return STOP
        return self._levels.duties(left, right)

    async def stop(self) -> None:
        """Switch both motors off; never raises. If the bus hangs, the stop is the first command sent after that."""
        try:
            await self._board.write(Opcode.ALL_OFF, 0)
        except Exception:
            self.halt()

    def halt(self) -> None:
        """Switch both motors off without waiting."""
        self._halts += 1
        self._board.post(Opcode.ALL_OFF, 0)

    async def read_back(self) -> WheelCommand:
        """Return the duties that the board says it applies; zero once the failsafe has tripped.

        Raises:
            NotResponding: not acknowledged three times.
            BadReading: three answers to something else, or an invalid direction.
        """
        return self._levels.duties(await self._get(self._left), await self._get(self._right))

    async def health(self) -> MotorHealth:
        """Return the battery's voltage (steps of 35 mV, lower under load) and the faults.

        The board's drive-fault flags may be set after power-up and are cleared once both motors have been driven, so
        they count only after that.

        Raises:
            NotResponding: not acknowledged three times.
            BadReading: three answers to something else, or a voltage beyond the board's scale.
        """
        battery_v = await self._battery_v()
        faults = [] if await self._keep_failsafe() else [_DOES_NOT_ARM]
        if len(self._driven) == 2:
            faults += await self._drive_faults()
        return MotorHealth(battery_v, tuple(faults))

    async def _refuse_without_failsafe(self) -> None:
        try:
            await self._keep_failsafe()
        except BadReading:  # noise: it cannot be read now, but it can be switched on
            await self._board.write(Opcode.SET_FAILSAFE, 1)
        if self._forgot:
            await self.stop()
            raise PowerLost(self.name)

    async def _keep_failsafe(self) -> bool:
        """Ask the board for its failsafe, and switch it on if it is off; return whether it is on now.

        It counts as off if the board says so twice: a byte may be wrong although its echo is right.
        """
        if await self._failsafe_is_on() or await self._failsafe_is_on():
            return True
        self._forgot = True
        self._power_losses += 1
        self._driven.clear()
        return await self._arm_failsafe()

    async def _arm_failsafe(self) -> bool:
        """Switch the failsafe on and read it back; return whether it is on."""
        for _ in range(_FAILSAFE_TRIES):
            await self._board.write(Opcode.SET_FAILSAFE, 1)
            with suppress(BadReading):
                if await self._failsafe_is_on():
                    return True
        return False

    async def _failsafe_is_on(self) -> bool:
        (state,) = await self._board.request(Opcode.GET_FAILSAFE, 1)
        return state != 0

    async def _set(self, motor: _Motor, level: int) -> None:
        await self._board.write(motor.forward if level >= 0 else motor.reverse, abs(level))
        if level:
            self._driven.add(motor)

    async def _get(self, motor: _Motor) -> int:
        direction, level = await self._board.request(motor.get, 2)
        if direction not in (_FORWARD, _REVERSE):
            raise BadReading(
                f"{self.name}: motor {motor.letter} reports direction {direction}, an unknown one; noise on the wires"
            )
        return level if direction == _FORWARD else -level

    async def _drive_faults(self) -> list[str]:
        return [
            f"motor {motor.letter} ({side}): drive fault: under-voltage, a short or overheating; charge the battery, "
            "check the motor's wires, let the board cool"
            for motor, side in ((self._left, "left"), (self._right, "right"))
            if any(await self._board.request(motor.get_fault, 1))
        ]

    async def _battery_v(self) -> float:
        raw = int.from_bytes(await self._board.request(Opcode.GET_BATTERY, 2), "big")
        if raw > _FULL_RAW:
            raise BadReading(f"{self.name}: battery reads {raw} of at most {_FULL_RAW}; noise on the wires")
        return raw / _FULL_RAW * _FULL_VOLTS
