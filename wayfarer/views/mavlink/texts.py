"""Status texts: what happens in a run, in the words of the terminal, in chunks of 50 bytes. Pure.

While nobody listens the newest texts wait. So a station that connects is told how the run before ended, and one that
was out of reach what it has missed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Final

from pymavlink.dialects.v20 import common

from wayfarer.fieldlog.run_events import PhaseChanged
from wayfarer.fieldlog.typed import RunEvent
from wayfarer.fieldlog.wording import Tone
from wayfarer.views.text.log_lines import log_lines

WAITING = 24  # texts; the oldest go first
CHUNK_BYTES, CHUNKS = 50, 6  # of one text; the longest refusals have 300 characters
SEVERITIES: Final = {
    Tone.FAULT: common.MAV_SEVERITY_CRITICAL,
    Tone.WARNING: common.MAV_SEVERITY_WARNING,
    Tone.PERSON: common.MAV_SEVERITY_NOTICE,
    Tone.END: common.MAV_SEVERITY_NOTICE,
}
LAST_NUMBER: Final = 0xFFFF  # of a text in chunks; 0 means that there is one chunk only


Chunks = list[common.MAVLink_message]


class StatusTexts:
    """The texts that wait to be sent."""

    def __init__(self) -> None:
        self._waiting: deque[Chunks] = deque(maxlen=WAITING)
        self._number = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def take(self, events: Iterable[RunEvent]) -> None:
        """Queue a text for each event that has one."""
        for event in events:
            if not isinstance(event, PhaseChanged):
                for _, text, tone in log_lines(event):
                    if tone is not Tone.QUIET:  # a radio has no room for them
                        self.add(text, SEVERITIES.get(tone, common.MAV_SEVERITY_INFO))

    def add(self, text: str, severity: int) -> None:
        """Queue a text with a severity (MAV_SEVERITY)."""
        self._waiting.append(self.chunks(text, severity))

    def chunks(self, text: str, severity: int) -> Chunks:
        """Return the messages of a text; what stations cannot show becomes a question mark."""
        data = text.encode("ascii", "replace")[: CHUNKS * CHUNK_BYTES]
        number, pieces = 0, [data]
        if len(data) > CHUNK_BYTES:
            self._number = number = self._number % LAST_NUMBER + 1
            # A chunk that is not full ends a text: an empty one does, where the others are all full.
            pieces = [data[begin : begin + CHUNK_BYTES] for begin in range(0, len(data) + 1, CHUNK_BYTES)]
        return [common.MAVLink_statustext_message(severity, piece, number, place) for place, piece in enumerate(pieces)]

    def pop(self) -> Chunks:
        """Return the chunks of the oldest text.

        Raises:
            IndexError: none waits.
        """
        return self._waiting.popleft()
