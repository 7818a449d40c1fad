"""A person's driving: who drives, the newest sample of keys, stick or finger, and its own deadman. Pure: time is input.

A link can repeat, delay, lose and reorder what it carries, and a relay can send the last command for ever. So each
sample has a number and a time that were given where it was *taken*: a repetition has an old number, a late one is too
old, and neither feeds the deadman. The wheels turn only while the newest sample is younger than the deadman's time.

After the beginning, and after each hold of the gate, the wheels turn only once keys and stick were let go: a stick that
is held, or lies under something, must not start a rover.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from wayfarer.safety.permission import AHEAD_S
from wayfarer.safety.settings import ManualSettings

# A client that is silent for this long has gone: another one may drive. LeKiwi's host stops its base after 0.5 s; here
# the wheels stop long before, so that a person can let a key go and think.
LEASE_S: Final = 2.0


class ManualSample(NamedTuple):
    """What a person asked for at ``sent_s``, on the loop's clock.

    ``forward`` and ``turn`` are shares of full deflection in -1 to 1, ahead and clockwise positive. ``seq`` grows with
    each sample that is taken.
    """

    seq: int
    forward: float
    turn: float
    sent_s: float


class ManualControl:
    """Holds the lease of the client that drives, and its newest sample.

    ``settings`` are those of the rover file. ``driver`` says in a word what drives ("page"); ``sample`` is the newest
    sample, None before the first; ``why`` says why nothing is asked for, empty if something is.
    """

    def __init__(self, settings: ManualSettings) -> None:
        self.settings = settings
        self._deadman_s = settings.deadman_s
        self._lease = 0
        self._since_s = 0.0
        # A release is new until a tick has seen it: then the newest sample asks for nothing.
        self._let_go = self._is_new_release = False
        self.driver = self.why = ""
        self.sample: ManualSample | None = None

    def begin(self, t_s: float, lease: int, driver: str) -> None:
        """Give the lease, a number that nobody can guess, to a client."""
        self._lease, self.driver, self._since_s = lease, driver, t_s
        self.sample, self._is_new_release = None, False
        self.must_let_go()

    def must_let_go(self) -> None:
        """Ask for nothing until a sample says that keys and stick were let go."""
        self._let_go = False

    def is_held_by(self, lease: int) -> bool:
        """Return whether a client has the lease; whether anybody drives is the controller's to know."""
        return lease == self._lease

    def take(self, now_s: float, sample: ManualSample) -> str:
        """Take a sample of the client that drives; return why it is refused, and has no effect, or an empty text.

        If keys and stick must be released, a release stays the newest sample until a tick has seen it: what is pressed
        in between counts from the next sample on. So the sample of each tick, which is in the log, is all that a replay
        needs.
        """
        seq, forward, turn, sent_s = sample
        if not (abs(forward) <= 1.0 and abs(turn) <= 1.0):  # written so that NaN is refused
            return "forward and turn must be numbers from -1 to 1"
        if not sent_s <= now_s + AHEAD_S:
            return f"a sample from the future: sent_s must be of the daemon's clock, which says {now_s:.3f}"
        if not now_s - sent_s <= self._deadman_s:
            return f"a sample of {now_s - sent_s:.2f} s ago: at most {self._deadman_s:g} s are allowed"
        if self.sample is not None and seq <= self.sample.seq:
            return f"sample {seq} came after sample {self.sample.seq}: it is a repetition, or out of order"
        if self._is_new_release and not self._let_go:
            forward = turn = 0.0
        self._is_new_release = forward == turn == 0.0
        self.sample = ManualSample(seq, forward, turn, min(sent_s, now_s))
        return ""

    def is_silent(self, t_s: float) -> bool:
        """Return whether the client has gone."""
        heard_s = self._since_s if self.sample is None else max(self._since_s, self.sample.sent_s)
        return t_s - heard_s > LEASE_S

    def wanted(self, t_s: float) -> tuple[float, float]:
        """Return forward and turn of a tick, both 0 if nothing is asked for; see ``ManualSample``."""
        sample = self.sample
        self._is_new_release = False
        if sample is None or not t_s - sample.sent_s <= self._deadman_s:
            self.why = "nothing is pressed"
            return 0.0, 0.0
        if sample.forward == 0.0 and sample.turn == 0.0:
            self._let_go, self.why = True, "nothing is pressed"
            return 0.0, 0.0
        if not self._let_go:
            self.why = "let go of keys and stick first"
            return 0.0, 0.0
        self.why = ""
        return sample.forward, sample.turn
