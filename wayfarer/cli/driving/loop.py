"""The loop of ``wayfarer drive``: takes wishes, sends them as numbered samples, and shows what becomes of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from wayfarer.cli.driving.wish import Source, Wish, now_s
from wayfarer.daemon.socket.protocol import Refused
from wayfarer.errors import WayfarerError

Ask = Callable[[Mapping[str, object]], dict[str, Any]]
POLL_S = 0.05
STATUS_S = 1.0
GIVE_UP_S = 2.0  # as the daemon does; it has stopped the wheels long before
Show = Callable[[Wish, str, Mapping[str, Any]], None]


class Driving:
    """One time of driving.

    Args:
        ask: sends a request to the daemon and returns the details of its answer.
        source: what the person presses.
        show: is told the newest wish, why the wheels do not turn, and the status.
    """

    def __init__(self, ask: Ask, source: Source, show: Show) -> None:
        self._ask = ask
        self._source = source
        self._show = show
        self._wish = Wish(0.0, 0.0, 0.0)
        self._why, self._wheels = "", [0.0, 0.0]
        self._seq = 0
        self._taken_s = self._status_s = now_s()

    def drive(self) -> dict[str, Any]:
        """Drive until the person ends it; return what the daemon says at the end: ``mode``.

        Raises:
            Refused: the daemon refuses to begin, or somebody else ended it.
            WayfarerError: the daemon, or what the person drives with, has gone.
        """
        lease = self._ask({"do": "manual_begin", "driver": self._source.driver})["lease"]
        try:
            status = self._ask({"do": "status"})
            while not self._source.is_over:
                self._source.wait(POLL_S)
                wish = self._source.wish(now_s())
                if wish is not None:
                    self._send(lease, wish)
                if now_s() - self._status_s >= STATUS_S:
                    self._status_s, status = now_s(), self._ask({"do": "status"})
                self._show(self._wish, self._why, {**status, "wheels": self._wheels})
        except BaseException:
            with suppress(WayfarerError):  # where it does not hear this, its deadman stops the wheels
                self._ask({"do": "manual_end", "lease": lease})
            raise
        return self._ask({"do": "manual_end", "lease": lease})

    def _send(self, lease: int, wish: Wish) -> None:
        self._wish = wish
        self._seq += 1
        sample = {"forward": wish.forward, "turn": wish.turn, "sent_s": wish.taken_s}
        try:
            told = self._ask({"do": "manual_drive", "lease": lease, "seq": self._seq, **sample})
        except Refused as refusal:  # one may have been too old; if all are, somebody has ended it
            self._why = str(refusal)
            if now_s() - self._taken_s > GIVE_UP_S:
                raise
        else:
            self._why, self._wheels = str(told["why_not"]), told["wheels"]
            self._taken_s = now_s()
