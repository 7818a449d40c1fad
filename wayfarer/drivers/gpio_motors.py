"""Motors on H-bridges at the GPIO pins: any board that takes PWM, by the pins that the rover file gives each side.

**Such a board does not stop the wheels if the computer fails.** It has no timeout, and a Raspberry Pi's pins keep their
level when a program ends or hangs (docs/reference/hardware.md): the rover drives on until a person catches it. So
``deadman_s`` is None, and the rover is armed only if its file has ``safety.allow_no_deadman``.

With a retriggerable monostable, or a small controller that does the same, in the board's enable line there is a
deadman: it lets the board drive for a time after each pulse, and ``drive`` gives the pulses. What hangs or has crashed
gives none. Only a person can see that it works; ``wayfarer check`` asks for this.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

from annotated_types import Interval

from wayfarer.drivers.buses import Buses, OutputPin
from wayfarer.drivers.gpio import GpioPart, Pin
from wayfarer.drivers.levels import MotorLevels
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, MotorHealth, WheelCommand

FULL_PERCENT: Final = 100  # gpiozero sets lgpio's PWM in whole percent, and cuts off what is beyond
_DUTY: Final = None
_PULLED_UP: Final = frozenset(range(9))  # BCM2835 ARM Peripherals, table 6-31 (docs/reference/hardware.md)

# What the pins of a side do ahead, and back, by the pins that it has.
SCHEMES: Final[Mapping[frozenset[str], Mapping[str, tuple[float | None, float | None]]]] = {
    frozenset(pins): pins
    for pins in (
        {"forward": (_DUTY, 0.0), "backward": (0.0, _DUTY)},
        {"pwm": (_DUTY, _DUTY), "direction": (0.0, 1.0)},
        {"pwm": (_DUTY, _DUTY), "forward": (1.0, 0.0), "backward": (0.0, 1.0)},
    )
}


@dataclass(frozen=True, slots=True)
class GpioMotorsSettings:
    """The pins of the H-bridges.

    Each side has a pin that drives it ahead and one that drives it back, both with PWM (DRV8871, DRV8833, BTS7960);
    or a direction and a PWM pin (Cytron); or a pin for each direction and a PWM pin (L298N, TB6612).
    """

    left_forward: Pin | None = None
    """GPIO number of the input that drives the left side ahead."""
    left_backward: Pin | None = None
    """GPIO number of the input that drives the left side back."""
    left_pwm: Pin | None = None
    """GPIO number of the left side's speed input, if it has one beside its direction: PWM, ENA."""
    left_direction: Pin | None = None
    """GPIO number of the left side's direction input, low for ahead."""
    right_forward: Pin | None = None
    """GPIO number of the input that drives the right side ahead."""
    right_backward: Pin | None = None
    """GPIO number of the input that drives the right side back."""
    right_pwm: Pin | None = None
    """GPIO number of the right side's speed input."""
    right_direction: Pin | None = None
    """GPIO number of the right side's direction input."""
    left_enable: Pin | None = None
    """GPIO number of an input that is held high while the pins are claimed (EN, STBY); none if the board has no such
    input, or a jumper, or if ``pulse`` enables it."""
    right_enable: Pin | None = None
    """GPIO number of the same for the right side."""
    pulse: Pin | None = None
    """GPIO number of the trigger of a monostable in the board's enable line, which stops the wheels if it is not
    triggered: it changes its level with each command."""
    deadman_s: Annotated[float, Interval(ge=0.1, le=2)] | None = None
    """How long after the last pulse the monostable stops the wheels, as it was built."""
    pwm_hz: Annotated[float, Interval(ge=10, le=10_000)] = 100.0
    """Frequency of the PWM, which software makes: the higher, the coarser."""
    reverse_left: bool = False
    """The left motors turn backwards when they are commanded forwards."""
    reverse_right: bool = False
    """The right motors turn backwards when they are commanded forwards."""
    duty_limit: Annotated[float, Interval(gt=0, le=1)] = 1.0
    """The highest share of the battery's voltage that the motors may get."""

    commands_per_deadman: ClassVar[int] = 4  # one edge in two triggers a monostable, and one command may be lost

    def __post_init__(self) -> None:
        left, right = self.pins("left"), self.pins("right")
        if frozenset(left) not in SCHEMES or set(left) != set(right):
            raise ValueError(
                "each side needs the same pins: forward and backward; or pwm and direction; or pwm, forward and "
                f"backward. The left side has {' and '.join(left) or 'none'}, the right one "
                f"{' and '.join(right) or 'none'}"
            )
        if (self.pulse is None) != (self.deadman_s is None):
            raise ValueError("pulse and deadman_s go together: the pin of the monostable, and how long it holds")

    def pins(self, side: str) -> dict[str, int]:
        """Return the pins of a side, left or right, that make it turn."""
        pins = {name: getattr(self, f"{side}_{name}") for name in ("forward", "backward", "pwm", "direction")}
        return {name: pin for name, pin in pins.items() if pin is not None}


class Bridge:
    """The pins of one side, by their names in a scheme."""

    def __init__(self, pins: Mapping[str, OutputPin]) -> None:
        scheme = SCHEMES[frozenset(pins)]
        self._powers = [pins[name] for name, levels in scheme.items() if _DUTY in levels]
        # What each pin gets ahead and back; what gives the direction comes before what gives the power.
        self._ahead, self._behind = (
            sorted(((levels[back], pins[name]) for name, levels in scheme.items()), key=lambda row: row[0] is _DUTY)
            for back in (False, True)
        )
        self._back = False

    def turn(self, percent: int) -> None:
        """Set the duty, negative for back. A change of direction passes through zero, so no pin drives against it."""
        back = percent < 0
        if back != self._back:
            self.stop()
        self._back = back
        # A thousandth more: 0.29 * 100 is 28.999..., of which gpiozero would make 28.
        duty = min(1.0, (abs(percent) + 0.001) / FULL_PERCENT) if percent else 0.0
        for level, pin in self._behind if back else self._ahead:
            pin.value = duty if level is _DUTY else level

    def stop(self) -> None:
        """Take the power away: set each PWM pin to zero, also if another one fails."""
        with ExitStack() as each:
            for pin in self._powers:
                each.callback(setattr, pin, "value", 0.0)


class GpioMotors(GpioPart):
    """Two H-bridges as ``hal.DriveMotors``.

    A duty of 1 is ``duty_limit``. Duties are rounded to whole percent of the battery's voltage, towards zero.
    """

    part: ClassVar[str] = "motors"
    Settings = GpioMotorsSettings

    def __init__(self, settings: GpioMotorsSettings, buses: Buses) -> None:
        left, right = ("/".join(map(str, settings.pins(side).values())) for side in ("left", "right"))
        super().__init__(f"motors on GPIO {left} and {right}", buses.pins())
        self._settings = settings
        self.deadman_s: float | None = settings.deadman_s
        self._levels = MotorLevels(
            FULL_PERCENT * settings.duty_limit,
            reverse_left=settings.reverse_left,
            reverse_right=settings.reverse_right,
        )
        self._pulse: OutputPin | None = None
        self._halts = 0
        scheme = SCHEMES[frozenset(settings.pins("left"))]
        powers = [name for name, levels in scheme.items() if _DUTY in levels] + ["enable"]
        high = sorted(
            _PULLED_UP & {getattr(settings, f"{side}_{name}") for side in ("left", "right") for name in powers}
        )
        self.note = ""
        if high:
            pins = " and ".join(map(str, high))
            self.note = f"a Raspberry Pi pulls GPIO {pins} up while no program holds them: wheels may turn at boot"

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
        """Set the duty of both sides and return what was set; duties beyond -1..1 count as these.

        A ``halt`` that comes meanwhile has priority.

        Raises:
            ValueError: a duty is NaN; nothing is set.
            NotResponding: the pins are not open or failed; both sides were stopped as far as their pins obey.
        """
        left, right = self._levels.of(command)
        halts = self._halts
        try:
            with self._using() as sides:
                sides["left"].turn(left)
                sides["right"].turn(right)
                if self._pulse is not None:
                    self._pulse.value = 1.0 - self._pulse.value
        except NotResponding:
            self.halt()
            raise
        if self._halts != halts:
            self._stopped()
            return STOP
        return self._levels.duties(left, right)

    async def stop(self) -> None:
        """Stop both sides; claims the pins if necessary and holds them at zero."""
        with suppress(NotResponding):
            await self.open()

    def halt(self) -> None:
        """Stop both sides now, if the pins are open. It takes microseconds, and no lock."""
        self._halts += 1
        self._stopped()

    async def read_back(self) -> None:
        """Return None: an H-bridge reports nothing."""

    async def health(self) -> MotorHealth:
        """Return an empty report: the board measures nothing."""
        return MotorHealth(None, ())

    def _make(self) -> dict[str, Bridge]:
        settings = self._settings
        sides = {side: Bridge(dict(self._bridge_pins(side))) for side in ("left", "right")}
        for enable in (settings.left_enable, settings.right_enable):
            if enable is not None:
                self._output(enable).value = 1.0
        self._pulse = None if settings.pulse is None else self._output(settings.pulse)
        return sides

    def _bridge_pins(self, side: str) -> Iterator[tuple[str, OutputPin]]:
        pins = self._settings.pins(side)
        for name, levels in SCHEMES[frozenset(pins)].items():
            yield name, self._output(pins[name], pwm_hz=self._settings.pwm_hz if _DUTY in levels else None)

    def _stopped(self) -> bool:
        """Stop each side, even if the other fails; return whether both were claimed and obeyed."""
        obeyed = 0
        for side in self._devices.values():
            with suppress(Exception):
                side.stop()
                obeyed += 1
        return obeyed == len(("left", "right"))
