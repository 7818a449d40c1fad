"""Motors on a plain H-bridge at the GPIO pins.

**Nothing stops these wheels if the computer fails.** Such a board has no timeout: after SIGKILL, or if the kernel
hangs, the pins keep their state, and the rover drives on until a person catches it. So ``deadman_s`` is None, and the
rover is armed only if its file has ``safety.allow_no_deadman``.

Each side has a pin that drives it ahead and one that drives it back, both in software PWM, and optionally one that
enables it (TB6612, L298N, DRV8833). Boards that take a direction and a speed instead cannot be used with this driver.
If a side turns the wrong way, exchange its two pins in the rover file.

While no program drives them, at boot and after ``close``, pins 0 to 8 of a Raspberry Pi are pulled up and pins 9 to 27
down (BCM2835 ARM Peripherals, table 6-31): wire an H-bridge to the latter.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from math import isnan
from typing import Annotated, ClassVar

from annotated_types import Interval

from wayfarer.angles import clamp
from wayfarer.drivers.buses import Buses, OutputPin
from wayfarer.drivers.gpio import GpioPart, Pin
from wayfarer.errors import NotResponding
from wayfarer.hal import MotorHealth, WheelCommand

_PWM_HZ = 100.0  # gpiozero's own


@dataclass(frozen=True, slots=True)
class GpioMotorsSettings:
    """The pins of the H-bridges."""

    left_forward: Pin
    """GPIO number of the input that drives the left side ahead."""
    left_backward: Pin
    """GPIO number of the input that drives the left side back."""
    right_forward: Pin
    """GPIO number of the input that drives the right side ahead."""
    right_backward: Pin
    """GPIO number of the input that drives the right side back."""
    left_enable: Pin | None = None
    """GPIO number of an input that is held high while the pins are claimed; none if the board has no such input, or a
    jumper."""
    right_enable: Pin | None = None
    """GPIO number of the same for the right side."""
    duty_limit: Annotated[float, Interval(gt=0, le=1)] = 1.0
    """No side gets more than this share of the battery's voltage; if one would, both are scaled down together, so that
    a curve keeps its shape. For motors whose rated voltage is below that of the battery."""


class _Bridge:
    """An H-bridge with a PWM input for each direction."""

    def __init__(self, forward: OutputPin, backward: OutputPin) -> None:
        self._forward, self._backward = forward, backward

    @property
    def value(self) -> float:
        """The duty that its pins are set to."""
        return self._forward.value - self._backward.value

    @value.setter
    def value(self, duty: float) -> None:
        drives, other = (self._forward, self._backward) if duty >= 0.0 else (self._backward, self._forward)
        other.value = 0.0  # first: both high brake
        drives.value = abs(duty)

    def stop(self) -> None:
        """Set both pins low, the second one even if the first fails."""
        try:
            self._forward.value = 0.0
        finally:
            self._backward.value = 0.0


class GpioMotors(GpioPart):
    """Two H-bridges as ``hal.DriveMotors``, without a deadman."""

    part: ClassVar[str] = "motors"
    Settings = GpioMotorsSettings
    deadman_s: float | None = None

    def __init__(self, settings: GpioMotorsSettings, buses: Buses) -> None:
        left, right = (settings.left_forward, settings.left_backward), (settings.right_forward, settings.right_backward)
        super().__init__(f"motors on GPIO {left[0]}/{left[1]} and {right[0]}/{right[1]}", buses.pins())
        self._settings = settings

    async def open(self) -> None:
        """Claim the pins, all at zero; raises as ``GpioPart.open``.

        Pins that are claimed already and obey are stopped and kept; released pins would float.
        """
        if not self._stopped():
            await super().open()

    async def close(self) -> None:
        """Stop, and release the pins."""
        self.halt()
        await super().close()

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Set the duty of both sides and return what was set, within the limit; duties beyond -1..1 count as these.

        Raises:
            ValueError: a duty is NaN; nothing is set.
            NotResponding: the pins are not open or failed; both sides were stopped as far as their pins obey.
        """
        asked = WheelCommand(_duty(command.left), _duty(command.right))
        scale = min(1.0, self._settings.duty_limit / max(abs(asked.left), abs(asked.right), 1e-9))
        applied = WheelCommand(asked.left * scale, asked.right * scale)
        try:
            with self._using() as sides:
                sides["left"].value, sides["right"].value = applied
        except NotResponding:
            self.halt()
            raise
        return applied

    async def stop(self) -> None:
        """Stop both sides; claims the pins if necessary and holds them at zero."""
        with suppress(NotResponding):
            await self.open()

    def halt(self) -> None:
        """Stop both sides now, if the pins are open. It takes microseconds, and no lock."""
        self._stopped()

    async def read_back(self) -> WheelCommand:
        """Return the duty that the pins are set to; the H-bridge itself reports nothing."""
        with self._using() as sides:
            return WheelCommand(sides["left"].value, sides["right"].value)

    async def health(self) -> MotorHealth:
        """Return an empty report: the board measures nothing."""
        return MotorHealth(None, ())

    def _make(self) -> dict[str, _Bridge]:
        pins = self._settings
        sides = {
            "left": self._bridge(pins.left_forward, pins.left_backward),
            "right": self._bridge(pins.right_forward, pins.right_backward),
        }
        for enable in (pins.left_enable, pins.right_enable):
            if enable is not None:
                self._output(enable).value = 1.0
        return sides

    def _bridge(self, forward: int, backward: int) -> _Bridge:
        return _Bridge(self._output(forward, pwm_hz=_PWM_HZ), self._output(backward, pwm_hz=_PWM_HZ))

    def _stopped(self) -> bool:
        """Stop each side, even if the other fails; return whether both were claimed and obeyed."""
        obeyed = 0
        for motor in self._devices.values():
            with suppress(Exception):
                motor.stop()
                obeyed += 1
        return obeyed == 2


def _duty(asked: float) -> float:
    if isnan(asked):
        raise ValueError("a duty is NaN, and moves no wheel")
    return clamp(asked, -1.0, 1.0)
