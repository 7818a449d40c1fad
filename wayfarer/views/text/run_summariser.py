"""Builds the summary of a run from its fold. Pure."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from math import isnan

from wayfarer.fieldlog.fields import began_wall_s
from wayfarer.fieldlog.run_events import Noted
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.run_state import RunState
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import RunEvent, Tick
from wayfarer.safety.settings import SafetySettings
from wayfarer.views.text.last_position import last_position
from wayfarer.views.text.summary import Mark, PeriodPercentiles, RunSummary

LATE_S = SafetySettings().tick_late_s  # where a header does not tell
# The events that tell of something that failed; ``sensor_failed`` is counted by sensor.
FAILURES = {
    "board_silent", "light_failed", "part_failed", "motors_failed", "motors_not_opened", "loop_stalled",
    "stop_not_confirmed", "close_hangs", "control_error", "viewer_failed",
}  # fmt: skip


def summarise(records: Iterable[Record]) -> RunSummary:
    """Return the summary of a run, as far as its records go."""
    fold, summariser = RunFold(), RunSummariser()
    for record in records:
        summariser.take(fold.take(record))
    return summariser.summary(fold.state)


class RunSummariser:
    """Keeps what a summary needs beyond the fold's state: control periods, marks and clock steps grow with the run."""

    def __init__(self) -> None:
        self._periods_s = array("d")
        self._marks: list[Mark] = []
        self._clock_steps_s: list[float] = []

    def take(self, events: Iterable[RunEvent]) -> None:
        """Take what the fold yields for a record."""
        for event in events:
            match event:
                case Tick(period_s=period_s) if not isnan(period_s):
                    self._periods_s.append(period_s)
                case Noted(name="mark"):
                    self._marks.append(Mark(event.elapsed_s, event.text))
                case Noted(name="clock_step"):
                    self._clock_steps_s.append(event.by_s)

    def summary(self, state: RunState) -> RunSummary:
        """Return the summary of a run with this state."""
        header, ended, events = state.header, state.ended, state.events
        late_s = header.setting("safety", "tick_late_s") or LATE_S
        return RunSummary(
            rover=header.rover,
            algorithm=header.algorithm,
            version=header.version,
            seed=header.seed,
            trial=header.trial,
            simulated=header.simulated,
            dry_run=header.dry_run,
            began_wall_s=began_wall_s(header.record, state.first, state.last),
            lasted_s=state.lasted_s,
            armed_s=state.armed_s,
            held_s=dict(state.held_s),
            limited_s=dict(state.limited_s),
            commanded_m=state.commanded_m,
            reckoned_m=state.path_m,
            anomalies=dict(state.anomalies),
            episodes=state.episodes,
            recoveries=state.recoveries,
            exhausted=dict(state.exhausted),
            low_battery=state.low_battery,
            ticks=state.ticks,
            period=self._spread(),
            late_ticks=sum(period_s > late_s for period_s in self._periods_s),
            sensor_failures={name: sensor.failures for name, sensor in state.sensors.items() if sensor.failures},
            failures={name: count for name, count in events.items() if name in FAILURES},
            marks=tuple(self._marks),
            holds=events["hold"],
            goals=events["goal"],
            clock_steps_s=tuple(self._clock_steps_s),
            dropped=state.dropped,
            reason=(ended.reason or "unknown") if ended else None,
            text=ended.text if ended else None,
            where=last_position(state),
        )

    def _spread(self) -> PeriodPercentiles | None:
        """Return how the control periods spread; None where there is none."""
        ordered, last = sorted(self._periods_s), len(self._periods_s) - 1
        return PeriodPercentiles(*(ordered[round(part * last)] for part in (0.5, 0.99, 1.0))) if ordered else None
