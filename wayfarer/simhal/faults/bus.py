"""Faults of buses and chips, below the real drivers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from random import Random
from struct import pack
from typing import Annotated, ClassVar

from annotated_types import Interval

from wayfarer.drivers.buses import Frame
from wayfarer.drivers.pmw3901_registers import MOTION_BIT
from wayfarer.drivers.thunderborg_board import Opcode
from wayfarer.setting_ranges import Fraction
from wayfarer.simhal.built_in_chips import mounted
from wayfarer.simhal.chips.pmw3901 import BURST
from wayfarer.simhal.chips.roboclaw import ROBOCLAW_FAULT
from wayfarer.simhal.faults.fault_kind import FaultKind, changed, listed
from wayfarer.simhal.faults.wires import ANSWERING, ASKED, CAMERA, CHIPS, I2C, SERIAL, SPI, WiredPart

Byte = Annotated[int, Interval(ge=0, le=255)]

_DARK_SQUAL, _LONGEST_SHUTTER = 0, 0x1FFF
# What asks a part who it is, and which byte of the answer says so; a BNO055 is on I2C or on a serial line.
_IDENTITY = {
    "bno055": {b"\x00": 0, b"\xaa\x01\x00": 2},
    "cmps14": {b"\x00": 0},
    "pmw3901": {b"\x00": 1},
    "thunderborg": {bytes((Opcode.GET_ID,)): 1},
}


class BusFault(FaultKind):
    """Changes what the wires carry or the chips answer; needs bus depth, where the real drivers are asked.

    It can happen to any part on such a bus, or of such a driver (``fits``).
    """

    targets: ClassVar[tuple[str, ...]] = ("compass", "motion", "motors")
    fits: ClassVar[tuple[str, ...]] = CHIPS


@dataclass(frozen=True)
class Nack(BusFault):
    """Transfers are not acknowledged: the share ``chance`` of them, and no more than ``most`` in total."""

    fits = (*CHIPS, CAMERA)
    chance: Fraction = 1.0
    most: Annotated[int, Interval(ge=1, le=1_000_000)] = 1_000_000

    def effect(self, wired: WiredPart, rng: Random) -> AbstractContextManager[None]:
        left = self.most

        def is_lost() -> bool:
            nonlocal left
            lost = left > 0 and rng.random() < self.chance
            left -= lost
            return lost

        return listed(wired.wire.unheard, is_lost)


class Hang(BusFault):
    """A device holds the whole bus."""

    fits = (*CHIPS, CAMERA)

    @contextmanager
    def effect(self, wired: WiredPart, _: Random) -> Iterator[None]:
        wired.hang.begin()
        yield
        wired.hang.end()


@contextmanager
def _on_the_wire(wired: WiredPart, change: Callable[[bytes], bytes]) -> Iterator[None]:
    """Change the answers of a part; on a serial line, whose part may only listen, also what is written."""
    with listed(wired.wire.answers, lambda _, answer: change(answer)), ExitStack() as writes:
        if wired.bus == SERIAL:
            writes.enter_context(listed(wired.wire.writes, change))
        yield


@dataclass(frozen=True)
class FlippedBits(BusFault):
    """Answers have ``bits`` wrong bits, with ``chance``; on a serial line, what is written has them too."""

    bits: Annotated[int, Interval(ge=1, le=64)] = 1
    chance: Fraction = 1.0

    def effect(self, wired: WiredPart, rng: Random) -> AbstractContextManager[None]:
        def flip(data: bytes) -> bytes:
            if not data or rng.random() >= self.chance:
                return data
            wrong = int.from_bytes(data, "big")
            for bit in rng.sample(range(len(data) * 8), min(self.bits, len(data) * 8)):
                wrong ^= 1 << bit
            return wrong.to_bytes(len(data), "big")

        return _on_the_wire(wired, flip)


@dataclass(frozen=True)
class ShiftedBlock(BusFault):
    """Answers are shifted by so many bits: clock stretching that the bus master does not understand gives such."""

    fits = (I2C, SPI)
    bits: Annotated[int, Interval(ge=1, le=16)] = 8

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        def shift(_: bytes, answer: bytes) -> bytes:
            whole = int.from_bytes(answer, "big") << self.bits
            return (whole & ((1 << len(answer) * 8) - 1)).to_bytes(len(answer), "big")

        return listed(wired.wire.answers, shift)


def _answering(wired: WiredPart, questions: Mapping[bytes, int], says: int) -> AbstractContextManager[None]:
    """Change a byte of the answer to each question: the one at its place."""

    def lie(asked: bytes, answer: bytes) -> bytes:
        for question, at in questions.items():
            if asked.startswith(question):
                return answer[:at] + bytes((says,)) + answer[at + 1 :]
        return answer

    return listed(wired.wire.answers, lie)


@dataclass(frozen=True)
class WrongId(BusFault):
    """The part says it is another."""

    fits = tuple(_IDENTITY)
    says: Byte = 0x2A

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        return _answering(wired, _IDENTITY[wired.driver], self.says)


class Reset(BusFault):
    """The part loses its power, and with it its settings."""

    @contextmanager
    def effect(self, wired: WiredPart, _: Random) -> Iterator[None]:
        """Take the power away: the part is silent for as long, and restarts after that."""
        power_cycle = getattr(wired.chip, "power_cycle", lambda: None)  # a third party's may have nothing to forget
        power_cycle()
        with ExitStack() as silence:
            if wired.bus == I2C:
                silence.enter_context(listed(wired.wire.unheard, lambda: True))
            else:
                silence.enter_context(listed(wired.wire.writes, lambda _: None))
                silence.enter_context(listed(wired.wire.answers, lambda _, answer: b"\xff" * len(answer)))
            yield
        power_cycle()


class All00(BusFault):
    """Answers contain only zeros."""

    fits = ANSWERING

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        return listed(wired.wire.answers, lambda _, answer: bytes(len(answer)))


class AllFF(BusFault):
    """Answers contain only ones."""

    fits = ANSWERING

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        return listed(wired.wire.answers, lambda _, answer: b"\xff" * len(answer))


@dataclass(frozen=True)
class LostBytes(BusFault):
    """Bytes are lost on the way to the part and back: the share ``chance`` of them."""

    targets = ("motors",)
    fits = (SERIAL,)
    chance: Fraction = 0.1

    def effect(self, wired: WiredPart, rng: Random) -> AbstractContextManager[None]:
        return _on_the_wire(wired, lambda data: bytes(byte for byte in data if rng.random() >= self.chance))


@dataclass(frozen=True)
class LateBytes(BusFault):
    """Answers on a serial line come ``by_s`` late: if nobody waits for so long, to the next question."""

    targets = ("compass", "motors")
    fits = ASKED
    by_s: Annotated[float, Interval(ge=0, le=10)] = 0.06

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        return changed(wired.wire, late_s=self.by_s)


class FailsafeOff(BusFault):
    """The board's deadman does not arm."""

    targets = ("motors",)
    fits = ("thunderborg", "roboclaw")

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        if wired.driver == "roboclaw":
            wired.chip.timeout = 0
            return changed(wired.chip, keeps_timeout=False)
        return _answering(wired, {bytes((Opcode.GET_FAILSAFE,)): 1}, 0)


class BoardFault(BusFault):
    """The board reports a drive fault."""

    targets = ("motors",)
    fits = ("thunderborg", "roboclaw")

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        if wired.driver == "roboclaw":
            return changed(wired.chip, status=ROBOCLAW_FAULT)
        return changed(wired.chip, drive_faults={0})


class Ignores(BusFault):
    """The board acknowledges commands and does not follow them."""

    targets = ("motors",)
    fits = ("thunderborg", "sabertooth")

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        """Let requests through, which are one byte, and nothing that drives: the board continues with what it had."""
        return listed(wired.wire.writes, lambda data: data if len(data) == 1 else None)


class Dark(BusFault):
    """The picture is dark: a leaf on the lens, or night."""

    targets = ("motion",)
    fits = ("pmw3901", "camera_motion")

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        if wired.bus == CAMERA:
            return listed(wired.chip.shows, lambda frame: frame._replace(luma=frame.luma * 0))
        return changed(wired.chip, squal=_DARK_SQUAL, shutter=_LONGEST_SHUTTER)


@dataclass(frozen=True)
class Spikes(BusFault):
    """One answer in ``every`` says that the ground moved ahead by ``counts``, independent of the motion."""

    targets = ("motion",)
    fits = ("pmw3901",)
    counts: Annotated[int, Interval(ge=1, le=32_767)] = 469
    every: Annotated[int, Interval(ge=1, le=1000)] = 10

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        x, y = mounted(wired.settings)(self.counts, 0)
        bursts = 0

        def spike(asked: bytes, answer: bytes) -> bytes:
            nonlocal bursts
            bursts += asked[:1] == bytes((BURST,))
            if asked[:1] != bytes((BURST,)) or bursts % self.every:
                return answer
            motion, observation = answer[1] | MOTION_BIT, answer[2]
            return answer[:1] + pack("<BBhh", motion, observation, x, y) + answer[7:]

        return listed(wired.wire.answers, spike)


class SamePicture(BusFault):
    """The camera repeats the same picture."""

    targets = ("motion",)
    fits = ("camera_motion",)

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        def show(frame: Frame) -> Frame:
            last: Frame | None = wired.chip.last
            return frame if last is None else last._replace(t_s=frame.t_s)

        return listed(wired.chip.shows, show)


class Uncalibrated(BusFault):
    """The part reports that its calibration is lost."""

    targets = ("compass",)
    fits = ("bno055", "cmps14")

    def effect(self, wired: WiredPart, _: Random) -> AbstractContextManager[None]:
        return changed(wired.chip, calibration=0)
