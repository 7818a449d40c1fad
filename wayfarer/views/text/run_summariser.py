"""Builds the summary of a run, record by record. Pure."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable

from wayfarer.fieldlog.elapsed import Elapsed
from wayfarer.fieldlog.fields import began_wall_s, flag, name, names, number, reckoning, sound_tick, table, whole
from wayfarer.fieldlog.reader import Record
from wayfarer.views.text.last_position import PositionTracker
from wayfarer.views.text.periods import Periods
from wayfarer.views.text.summary import LowBattery, Mark, RunSummary

HELD = {"hold", "fault"}  # the levels at which the gate lets no wheel turn
# The events that tell of something that failed; ``sensor_failed`` is counted by sensor.
FAILURES = {
    "board_silent", "light_failed", "part_failed", "motors_failed", "loop_stalled", "stop_not_confirmed", "close_hangs",
    "control_error", "viewer_failed",
}  # fmt: skip


def summarise(records: Iterable[Record]) -> RunSummary:
    """Return the summary of a run, as far as its records go."""
    account = RunSummariser()
    for record in records:
        account.take(record)
    return account.summary()


class RunSummariser:
    """Takes the records of a run and returns its summary."""

    def __init__(self) -> None:
        self._header: Record = {}
        self._first: Record = {}
        self._last: Record = {}
        self._outcome: Record = {}
        self._tick: Record = {}
        self._number: int | None = None
        self._commanded_m: float | None = None
        self._ends_s = 0.0
        self._armed = False
        self._armed_s = 0.0
        self._held_s: defaultdict[str, float] = defaultdict(float)
        self._counts: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self._low_battery: LowBattery | None = None
        self._marks: list[Mark] = []
        self._elapsed = Elapsed()
        self._clock_steps_s: list[float] = []
        self._dropped = 0
        self._periods = Periods()
        self._track = reckoning({})
        self._position = PositionTracker()
        self._takers: dict[str, Callable[[Record], None]] = {
            "run": self._take_header,
            "tick": self._take_tick,
            "event": self._take_event,
            "board": self._take_board,
            "position": self._position.fix,
            "outcome": self._take_outcome,
        }

    def take(self, record: Record) -> None:
        """Take the next record."""
        self._first = self._first or record
        self._take_number(whole(record, "n"))
        self._last = record
        self._ends_s = max(self._ends_s, self._at_s(record))
        if taker := self._takers.get(record["record"]):
            taker(record)

    def summary(self) -> RunSummary:
        """Return the summary of what was taken."""
        header, counts, outcome = self._header, self._counts, self._outcome
        return RunSummary(
            rover=name(header, "rover"),
            algorithm=name(header, "algorithm"),
            version=name(header, "version"),
            seed=whole(header, "seed"),
            trial=whole(header, "trial"),
            simulated=flag(header, "simulated"),
            dry_run=flag(header, "dry_run"),
            began_wall_s=began_wall_s(header, self._first, self._last),
            lasted_s=self._ends_s,
            armed_s=self._armed_s,
            held_s=dict(self._held_s),
            commanded_m=self._commanded_m,
            reckoned_m=self._track.path_m,
            anomalies=dict(counts["anomalies"]),
            episodes=counts["moves"]["episodes"],
            recoveries=counts["moves"]["recoveries"],
            exhausted=dict(counts["exhausted"]),
            low_battery=self._low_battery,
            ticks=counts["moves"]["ticks"],
            period=self._periods.spread(),
            late_ticks=self._periods.late,
            sensor_failures=dict(counts["sensors"]),
            failures=dict(counts["failures"]),
            marks=tuple(self._marks),
            holds=counts["asked"]["hold"],
            goals=counts["asked"]["goal"],
            clock_steps_s=tuple(self._clock_steps_s),
            dropped=max(self._dropped, int(number(outcome, "dropped") or 0.0)),
            reason=(name(outcome, "reason") or "unknown") if outcome else None,
            text=name(outcome, "text"),
            where=self._position.where(self._last.get("t_s", 0.0)),
        )

    def _take_number(self, count: int | None) -> None:
        """Find where records are missing; those without a number say nothing of it."""
        if count is None:
            return
        if self._number is not None and count > self._number + 1:
            self._periods.interrupted()
        self._number = count

    def _at_s(self, record: Record) -> float:
        """Return how long after the beginning a record was made."""
        return self._elapsed.at(record)

    def _take_header(self, header: Record) -> None:
        if self._header:
            return  # a further part of the log says the same again
        self._header = header
        self._track = reckoning(header)
        if (whole(header, "part") or 1) > 1:
            self._position.begins_late()
        self._periods = Periods(number(table(table(header, "config"), "safety"), "tick_late_s"))

    def _take_tick(self, tick: Record) -> None:
        before, self._tick = self._tick, tick
        self._periods.take(tick["t_s"])
        self._position.reckoned(self._track.take(sound_tick(tick)))
        travelled_m = number(tick, "travelled_m")
        self._commanded_m = self._commanded_m if travelled_m is None else travelled_m
        self._add_time(tick, before)
        self._count(tick, before)

    def _add_time(self, tick: Record, before: Record) -> None:
        passed_s = max(0.0, tick["t_s"] - before.get("t_s", tick["t_s"]))
        if self._armed:
            self._armed_s += passed_s
            if name(tick, "level") in HELD:
                self._held_s[name(tick, "cause") or "unknown"] += passed_s

    def _count(self, tick: Record, before: Record) -> None:
        counts, moves = self._counts, self._counts["moves"]
        moves["ticks"] += 1
        counts["anomalies"].update(set(names(tick, "anomalies")) - set(names(before, "anomalies")))
        moves["recoveries"] += tick.get("phase") == "back_off" != before.get("phase")
        phase, _, event = (name(tick, "why") or "").partition(".")
        if event == "exhausted":
            counts["exhausted"][phase] += 1
        begun = (number(tick, "episodes") or 0.0) - (number(before, "episodes") or 0.0)
        moves["episodes"] += max(0, int(begun))  # it falls back to zero with each mission

    def _take_event(self, event: Record) -> None:
        what = name(event, "name") or "unknown"
        if what in {"armed", "disarmed"}:
            self._armed = what == "armed"
        if what == "armed":
            self._position.starts()
        elif what == "sensor_failed":
            self._counts["sensors"][name(event, "sensor") or "unknown"] += 1
        elif what == "mark":
            self._marks.append(Mark(self._at_s(event), name(event, "text") or ""))
        elif what == "clock_step":
            self._clock_steps_s.append(number(event, "by_s") or 0.0)
        elif what == "log_gap":
            self._dropped += int(number(event, "dropped") or 0.0)
        self._counts["failures" if what in FAILURES else "asked"][what] += 1

    def _take_board(self, board: Record) -> None:
        battery_v, lowest = number(board, "battery_v"), self._low_battery
        if battery_v is None or (lowest is not None and battery_v >= lowest.battery_v):
            return
        duties = [number(self._tick, f"applied_{side}") for side in ("left", "right")]
        duty = max((abs(duty) for duty in duties if duty is not None), default=None)
        self._low_battery = LowBattery(battery_v, self._at_s(board), duty)

    def _take_outcome(self, outcome: Record) -> None:
        self._outcome = outcome
