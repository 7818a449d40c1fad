"""The events of a run as lines of text, with its state now and then. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from wayfarer.fieldlog.elapsed import Elapsed
from wayfarer.fieldlog.fields import name, names, number, span, whole
from wayfarer.fieldlog.reader import Damage, Record
from wayfarer.views.text.wording import (
    Tone,
    aim_text,
    event_name,
    event_text,
    event_tone,
    fault_text,
    outcome_text,
    place_text,
    reason_text,
    run_text,
    state_text,
    tick_text,
)

STATUS_S = 5.0  # a line at least so often while the rover drives
STANDING_S = 60.0  # and while it stands: enough to see that it lives
BATTERY_FALL_V = 0.1  # below the lowest told so far; a battery sags under load and comes back
BATTERY_RISE_V = 1.0  # another battery

Told = Iterator[tuple[str, Tone]]


class Line(NamedTuple):
    """One line: ``elapsed_s`` of its record, a text that is fit for a terminal, and its tone."""

    elapsed_s: float
    text: str
    tone: Tone

    def __str__(self) -> str:
        return f"{span(self.elapsed_s, 2)}  {self.text}"


class RunNarrator:
    """Turns the records of a run into lines.

    Args:
        ticks: tell every control tick, instead of changes of phase and a status now and then.
    """

    def __init__(self, *, ticks: bool = False) -> None:
        self._every_tick = ticks
        self._elapsed = Elapsed()
        self._number: int | None = None
        self._dropped = 0
        self._told_run = False
        self._phase: str | None = None
        self._anomalies: tuple[str, ...] = ()
        self._battery_v: float | None = None
        self._told_battery_v = float("inf")
        self._board_faults: tuple[str, ...] = ()
        self._throttled = ""
        self._status_t_s = self._position_t_s = float("-inf")
        self._tellers: dict[str, Callable[[Record], Told]] = {
            "run": self._run,
            "tick": self._tick,
            "event": self._event,
            "position": self._position,
            "board": self._board,
            "computer": self._computer,
            "truth": lambda _: iter(()),
            "fault": lambda fault: iter([(fault_text(fault), Tone.WARNING)]),
            "outcome": lambda outcome: iter([(outcome_text(outcome), Tone.END)]),
        }

    def take(self, record: Record) -> list[Line]:
        """Return the lines for a record; most records have none."""
        elapsed_s = self._elapsed.at(record)
        told = [*self._gap(record), *self._tellers[record["record"]](record)]
        return [Line(elapsed_s, text, tone) for text, tone in told]

    def _gap(self, record: Record) -> Told:
        """Report missing record numbers, unless a ``log_gap`` has just reported them."""
        count, before = whole(record, "n"), self._number
        if count is not None:
            missing = 0 if before is None else count - before - 1
            if missing > 0 and missing != self._dropped:
                yield str(Damage(missing=missing)), Tone.WARNING
            self._number, self._dropped = count, 0

    def _run(self, header: Record) -> Told:
        if self._told_run:
            return  # the header of a further part says nothing new
        self._told_run = True
        yield run_text(header), Tone.PLAIN
        part = whole(header, "part") or 1
        if part > 1 and self._number is None:
            yield f"the log begins with part {part}: what came before is gone", Tone.WARNING

    def _tick(self, tick: Record) -> Told:
        phase, anomalies = name(tick, "phase"), names(tick, "anomalies")
        changed, fresh = phase != self._phase, set(anomalies) - set(self._anomalies)
        self._phase, self._anomalies = phase, anomalies
        due_s = STANDING_S if phase == "halt" else STATUS_S
        if self._every_tick:
            yield tick_text(tick), Tone.PLAIN
        elif changed or fresh:
            yield f"{state_text(tick)}  {reason_text(tick)}".rstrip(), Tone.PHASE
        elif tick["t_s"] - self._status_t_s >= due_s:
            yield f"{state_text(tick)}  {aim_text(tick, self._battery_v)}".rstrip(), Tone.QUIET
        else:
            return
        self._status_t_s = tick["t_s"]

    def _event(self, event: Record) -> Told:
        if event_name(event) == "log_gap":
            self._dropped += whole(event, "dropped") or 0
        yield event_text(event), event_tone(event)

    def _position(self, fix: Record) -> Told:
        if fix["t_s"] - self._position_t_s >= STANDING_S:
            self._position_t_s = fix["t_s"]
            yield f"position {place_text(fix)}", Tone.QUIET

    def _board(self, board: Record) -> Told:
        faults, battery_v = names(board, "faults"), number(board, "battery_v")
        if faults != self._board_faults:
            self._board_faults = faults
            yield f"motor board: {', '.join(faults) or 'well again'}", Tone.FAULT if faults else Tone.PLAIN
        self._battery_v = battery_v
        if battery_v is None or -BATTERY_FALL_V < battery_v - self._told_battery_v < BATTERY_RISE_V:
            return
        self._told_battery_v = battery_v
        yield f"battery {battery_v:.1f} V", Tone.QUIET

    def _computer(self, computer: Record) -> Told:
        throttled = (name(computer, "throttled") or "").removeprefix("0x").lstrip("0")
        if throttled != self._throttled:
            self._throttled = throttled
            if throttled:
                yield f"computer: power and heat bits {throttled} (see vcgencmd get_throttled)", Tone.WARNING
            else:
                yield "computer: power and heat are well again", Tone.PLAIN
