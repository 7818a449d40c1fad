"""Simulated GPIO pins, for the real drivers at bus depth: plain objects that a test or a chip sets and reads."""

from __future__ import annotations

from collections.abc import Callable

Callback = Callable[[], None]


class FakePin:
    """A pin and the wire at it.

    ``level`` is the share of time that the wire is high, None while nobody drives it. An output of the computer sets
    it; at an input a test or a chip does. ``listeners`` are called after each change.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self.claimed = False
        self.listeners: list[Callback] = []
        self._level: float | None = None

    @property
    def level(self) -> float | None:
        """The share of time that the wire is high."""
        return self._level

    @level.setter
    def level(self, level: float | None) -> None:
        if level != self._level:
            self._level = level
            for listener in tuple(self.listeners):
                listener()


class FakeOutput:
    """A pin that the computer drives; implements ``drivers.buses.OutputPin``. PWM is in whole percent, as lgpio's."""

    def __init__(self, pin: FakePin, *, pwm: bool, active_high: bool) -> None:
        self._pin: FakePin | None = pin
        self._pwm, self._active_high = pwm, active_high
        self.value = 0.0

    @property
    def value(self) -> float:
        """The share of time that the pin is active."""
        level = self._claimed().level or 0.0
        return level if self._active_high else 1.0 - level

    @value.setter
    def value(self, value: float) -> None:
        pin = self._claimed()
        if not 0.0 <= value <= 1.0:
            raise ValueError(f"GPIO{pin.number} cannot be {value}")
        value = int(value * 100.0) / 100.0 if self._pwm else float(bool(value))
        pin.level = value if self._active_high else 1.0 - value

    def close(self) -> None:
        """Let the pin float, as it does after gpiozero has closed it."""
        pin, self._pin = self._pin, None
        if pin is not None:
            pin.claimed, pin.level = False, None

    def _claimed(self) -> FakePin:
        if self._pin is None:
            raise RuntimeError("the pin is closed")
        return self._pin


class FakeInput:
    """A pin that something else drives; implements ``drivers.buses.InputPin``."""

    def __init__(self, pin: FakePin, before_read: list[Callback], *, pull_up: bool) -> None:
        self.when_activated: Callback | None = None
        self.when_deactivated: Callback | None = None
        self._pin: FakePin | None = pin
        self._before_read, self._pull_up = before_read, pull_up
        self._was_active = self._sees(pin)
        pin.listeners.append(self._changed)

    @property
    def is_active(self) -> bool:
        """Whether it is high, or with a pull-up low, now."""
        if self._pin is None:
            raise RuntimeError("the pin is closed")
        for update in self._before_read:
            update()
        return self._sees(self._pin)

    def close(self) -> None:
        """Release the pin."""
        pin, self._pin = self._pin, None
        if pin is not None:
            pin.listeners.remove(self._changed)
            pin.claimed = False

    def _sees(self, pin: FakePin) -> bool:
        return pin.level is not None and (pin.level >= 0.5) != self._pull_up

    def _changed(self) -> None:
        pin = self._pin
        if pin is None or self._sees(pin) == self._was_active:
            return
        self._was_active = not self._was_active
        then = self.when_activated if self._was_active else self.when_deactivated
        if then is not None:
            then()


class FakePins:
    """The GPIO pins; implements ``drivers.buses.Pins``. ``before_read`` is done before a driver reads an input."""

    def __init__(self) -> None:
        self.before_read: list[Callback] = []
        self._pins: dict[int, FakePin] = {}

    def wire(self, number: int) -> FakePin:
        """Return a pin, for what is outside."""
        return self._pins.setdefault(number, FakePin(number))

    def output(self, pin: int, *, pwm_hz: float | None = None, active_high: bool = True) -> FakeOutput:
        """Claim an output; the frequency of its PWM is not simulated."""
        return FakeOutput(self._claim(pin), pwm=pwm_hz is not None, active_high=active_high)

    def input(self, pin: int, *, pull_up: bool) -> FakeInput:
        """Claim an input."""
        return FakeInput(self._claim(pin), self.before_read, pull_up=pull_up)

    def _claim(self, number: int) -> FakePin:
        pin = self.wire(number)
        if pin.claimed:
            raise RuntimeError(f"pin GPIO{number} is already in use")
        pin.claimed = True
        return pin
