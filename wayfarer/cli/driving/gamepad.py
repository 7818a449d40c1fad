"""Driving by a gamepad, through the kernel's event devices (evdev).

The wheels turn only while the left shoulder button is held: a pad that falls, or lies in a bag, drives nothing. A pad
that is unplugged ends it. A wireless pad out of reach keeps its last state until the kernel notices, some seconds, so
a pad with a cable is the better one.
"""

from __future__ import annotations

import select
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

from wayfarer.cli.driving.wish import Wish
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.extras import require

# Linux, include/uapi/linux/input-event-codes.h.
EV_SYN, EV_KEY, EV_ABS = 0x00, 0x01, 0x03
SYN_DROPPED = 3  # the kernel's buffer was full: events are missing
ABS_X, ABS_Y = 0x00, 0x01  # the left stick, to the right and down positive
BTN_GAMEPAD, BTN_TL, BTN_START = 0x130, 0x136, 0x13B
DEADZONE = 0.05  # of full deflection: ROS's joy
EVERY_S = 0.05  # a stick that is held tells nothing, so its state is read so often


class InputEvent(Protocol):
    """An event, as evdev has it."""

    type: int
    code: int
    value: int


class AxisRange(Protocol):
    """The state and the range of an axis, as evdev's ``AbsInfo`` has it."""

    value: int
    min: int
    max: int


class GamepadState:
    """What a pad's stick and buttons say, from its events."""

    def __init__(self, axes: Mapping[int, AxisRange], pressed: Iterator[int] | list[int]) -> None:
        self.resume(axes, pressed)
        self.is_over = False

    def resume(self, axes: Mapping[int, AxisRange], pressed: Iterator[int] | list[int]) -> None:
        """Take the whole state, at the beginning and where events are missing."""
        self._axes = dict(axes)
        self._values = {code: axis.value for code, axis in axes.items()}
        self._held = BTN_TL in pressed

    def take(self, event: InputEvent) -> bool:
        """Take an event; return whether the whole state must be read again."""
        if event.type == EV_ABS and event.code in self._values:
            self._values[event.code] = event.value
        elif event.type == EV_KEY and event.code == BTN_TL:
            self._held = event.value != 0
        elif event.type == EV_KEY and event.code == BTN_START:
            self.is_over |= event.value != 0
        return event.type == EV_SYN and event.code == SYN_DROPPED

    def wish(self, t_s: float) -> Wish:
        """Return what the pad asks for: nothing without the button."""
        if not self._held:
            return Wish(0.0, 0.0, t_s)
        return Wish(-self._share(ABS_Y), self._share(ABS_X), t_s)

    def _share(self, code: int) -> float:
        """Return the deflection of an axis, -1 to 1; it begins at 0 where the dead zone ends."""
        axis = self._axes[code]
        half = (axis.max - axis.min) / 2
        share = max(-1.0, min(1.0, (self._values[code] - axis.min - half) / half))
        beyond = max(0.0, abs(share) - DEADZONE) / (1.0 - DEADZONE)
        return (beyond if share > 0.0 else -beyond) + 0.0


class Gamepad:
    """A pad that is plugged in; implements ``Source``. ``device`` is evdev's."""

    driver = "gamepad"
    help = "hold the left shoulder button and use the left stick   start: end"

    def __init__(self, device: Any) -> None:
        self._device = device
        self._state = GamepadState(*self._whole_state())
        self._told_s = 0.0

    def wait(self, for_s: float) -> None:
        """Wait for events, at most so long, and take all that there are."""
        if not select.select([self._device.fd], [], [], for_s)[0]:
            return
        try:
            again = [self._state.take(event) for event in self._device.read()]
            if any(again):
                self._state.resume(*self._whole_state())
        except OSError as error:  # ENODEV: unplugged
            raise WayfarerError(f"{self._device.path}: the gamepad has gone ({error.strerror}): plug it in") from None

    def wish(self, t_s: float) -> Wish | None:
        """Return what the pad asks for now, every ``EVERY_S``: what it says is its state, not a repetition."""
        if t_s - self._told_s < EVERY_S - 0.005:
            return None
        self._told_s = t_s
        return self._state.wish(t_s)

    @property
    def is_over(self) -> bool:
        """Whether the start button was pressed."""
        return self._state.is_over

    def _whole_state(self) -> tuple[dict[int, AxisRange], list[int]]:
        return {code: self._device.absinfo(code) for code in (ABS_X, ABS_Y)}, self._device.active_keys()


@contextmanager
def open_gamepad(path: str | None) -> Iterator[Gamepad]:
    """Give the gamepad at a path, or the first one that there is, until the end.

    Raises:
        BadInput: there is none, or it may not be read.
        MissingPackage: evdev is not installed.
    """
    require("a gamepad")
    from evdev import InputDevice, list_devices

    paths = [path] if path else sorted(list_devices())
    for each in paths:
        try:
            device = InputDevice(each)
        except OSError as error:
            raise BadInput(f"{each}: cannot be opened: {error.strerror}; is your user in the group input?") from None
        if is_gamepad(device.capabilities(absinfo=False)):
            try:
                yield Gamepad(device)
            finally:
                device.close()
            return
        device.close()
    raise BadInput(
        f"{path or '/dev/input'}: no gamepad with a left stick and a left shoulder button: plug one in; your user must"
        " be in the group input"
    )


def is_gamepad(capabilities: Mapping[int, list[int]]) -> bool:
    """Return whether a device has the buttons and the axes that driving needs."""
    keys, axes = capabilities.get(EV_KEY, []), capabilities.get(EV_ABS, [])
    return BTN_GAMEPAD in keys and BTN_TL in keys and ABS_X in axes and ABS_Y in axes
