"""A chip with registers on I2C, for simulated parts: declare what the data sheet names, and the rest is misuse."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from wayfarer.simhal.buses import ChipMisuse


class RegisterChip:
    """Implements ``buses.I2CChip``: the first byte of a write is a register, further ones go to it and those behind it.

    A read begins where the last transfer has left off, and moves along too. ``registers`` has what they hold.

    Args:
        name: of the part, for what is said of a misuse.
        registers: the registers that there are, with what they hold after power-up.
        read_only: those that cannot be written.
        before_read: is called before each read with the registers that are wanted, to ``put`` there what is measured.
        written: is called after each byte that was written, with the register and the byte.

    >>> chip = RegisterChip("XC9", {0x0F: 0x9C, 0x10: 0, 0x11: 0}, read_only={0x0F})
    >>> chip.write(bytes((0x10, 7, 8)))
    >>> chip.write(bytes((0x0F,)))
    >>> chip.read(3).hex(" ")
    '9c 07 08'
    """

    def __init__(
        self,
        name: str,
        registers: Mapping[int, int],
        *,
        read_only: Collection[int] = (),
        before_read: Callable[[range], None] | None = None,
        written: Callable[[int, int], None] | None = None,
    ) -> None:
        self._name, self._at_power_up, self._read_only = name, dict(registers), read_only
        self._before_read, self._written = before_read, written
        self.power_cycle()

    def power_cycle(self) -> None:
        """Lose power for a moment: the registers hold what they do after power-up."""
        self.registers = dict(self._at_power_up)
        self._pointer = min(self.registers, default=0)

    def put(self, register: int, data: bytes) -> None:
        """Put bytes into registers from one on, also into read-only ones."""
        for at, value in enumerate(data, register):
            self.registers[self._declared(at)] = value

    def write(self, data: bytes) -> None:
        """Take a write; raises ``ChipMisuse`` for a register that is not there, or cannot be written."""
        if not data:
            raise ChipMisuse(f"{self._name}: a write without a register")
        self._pointer = self._declared(data[0])
        for value in data[1:]:
            at = self._declared(self._pointer)
            if at in self._read_only:
                raise ChipMisuse(f"{self._name}: register 0x{at:02X} cannot be written")
            self.registers[at] = value
            self._pointer += 1
            if self._written is not None:
                self._written(at, value)

    def read(self, count: int) -> bytes:
        """Give a read; raises ``ChipMisuse`` for a register that is not there."""
        wanted = range(self._pointer, self._pointer + count)
        if self._before_read is not None:
            self._before_read(wanted)
        answer = bytes(self.registers[self._declared(at)] for at in wanted)
        self._pointer = wanted.stop
        return answer

    def _declared(self, register: int) -> int:
        if register not in self.registers:
            raise ChipMisuse(f"{self._name}: no register 0x{register:02X}")
        return register
