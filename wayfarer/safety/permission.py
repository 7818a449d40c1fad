"""A person's permission to start wheels: how old it may be, and what else ends it. Pure: time is input.

Bytes wait. A daemon can be suspended, a disk can freeze, a relay can keep a request or send it again, while the person
who asked has interrupted the command, or stands before the rover by now. So each request that can start a wheel says
when it was asked, and that is compared in one place, ``Supervisor``, at the moment at which the mode changes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

# So old a permission may be when the wheels are started. The checks before arming take less than a second; just after
# the daemon's start they wait up to 3 s for the parts besides. Every client waits longer for its answer (5 s), so that
# none says "failed" of what happens later. Chosen by us.
PERMISSION_S: Final = 4.0
# Times that pass through a page are rounded to milliseconds; what comes from later than this is not believed.
AHEAD_S: Final = 0.001


def _is_there() -> bool:
    return True


class Asked(NamedTuple):
    """A person's permission to start the wheels: to arm, to resume or to drive by hand. It is fresh, or it is void.

    ``at_s`` is when the person asked, on the loop's clock. That of the daemon is ``CLOCK_BOOTTIME``: it counts from the
    start of the computer, also while that sleeps, and every process can read it. ``is_there`` returns whether who asked
    still waits for the answer.
    """

    at_s: float
    is_there: Callable[[], bool] = _is_there

    def why_void(self, now_s: float, over_s: float) -> str:
        """Return why the wheels must not be started now, empty if they may.

        A permission is good for one start, and a stop ends all that were given before it: void is what was asked before
        ``over_s``, when the wheels were last stopped by a person, or just after the last permission that was used.
        """
        if not self.at_s <= now_s + AHEAD_S:  # written so that NaN is refused
            return f"asked in the future: the clock (CLOCK_BOOTTIME) says {now_s:.3f}, not {self.at_s:.3f}"
        if not now_s - self.at_s < PERMISSION_S:
            return f"asked {now_s - self.at_s:.1f} s ago; a request counts for {PERMISSION_S:g} s only"
        if self.at_s < over_s:
            return "the rover was stopped, or started, after this was asked"
        return "" if self.is_there() else "the client that asked has disconnected"
