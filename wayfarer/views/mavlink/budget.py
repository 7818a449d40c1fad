"""How many bytes may go out now, and which message is due. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from pymavlink.dialects.v20 import common

BURST_S = 1.0  # what was not used in so long may be used at once

# What a radio says of its buffer, in per cent that are free (RADIO_STATUS.txbuf), and what share of the budget follows;
# the bounds are those of ArduPilot (GCS_Common.cpp, handle_radio_status), the factors from no source.
FULL, FULLISH, EMPTY = 20, 50, 90
LEAST_SHARE = 0.1


class Budget:
    """A bucket of bytes that fills at ``bytes_per_s``, or a share of it while a radio says that its buffer is full."""

    def __init__(self, bytes_per_s: float) -> None:
        self._bytes_per_s = bytes_per_s
        self.share = 1.0
        self._left = BURST_S * bytes_per_s
        self._at_s: float | None = None

    def fill(self, now_s: float) -> None:
        """Let time pass."""
        passed_s = 0.0 if self._at_s is None else now_s - self._at_s
        self._at_s = now_s
        most = BURST_S * self._bytes_per_s * self.share
        self._left = min(most, self._left + passed_s * self._bytes_per_s * self.share)

    @property
    def is_left(self) -> bool:
        """Whether a message may go; the last one may be longer than what is left."""
        return self._left > 0.0

    def spend(self, count: int) -> None:
        """Count bytes that went out."""
        self._left -= count

    def radio_says(self, free_percent: int) -> None:
        """Take how much of the radio's buffer is free; it says so about once a second."""
        factor = (
            0.5 if free_percent < FULL else 0.8 if free_percent < FULLISH else 1.25 if free_percent > EMPTY else 1.0
        )
        self.share = min(1.0, max(LEAST_SHARE, self.share * factor))


Make = Callable[[], Iterator[common.MAVLink_message]]


class Stream:
    """Messages that are sent again and again.

    Args:
        make: makes them, of the newest state.
        rate_hz: how often.
        always: also where no bytes are left.
    """

    def __init__(self, make: Make, rate_hz: float, *, always: bool = False) -> None:
        self.make = make
        self.always = always
        self._period_s = 1.0 / rate_hz
        self._due_s = float("-inf")

    def is_due(self, now_s: float) -> bool:
        """Return whether it is time."""
        return now_s >= self._due_s

    def sent(self, now_s: float) -> None:
        """Note that they went out; periods that were missed are skipped."""
        self._due_s = max(self._due_s, now_s - self._period_s) + self._period_s
