"""Finds the first value that the field code read differently because of a fault."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import NamedTuple, TypeVar

from wayfarer.fault_scenarios.recorder import RunRecorder
from wayfarer.hal import Snapshot

T = TypeVar("T")
_Pair = tuple[float, T | None, T | None]


class FaultEffect(NamedTuple):
    """What is different, and when, in seconds on the runs' clock."""

    t_s: float
    what: str


def first_difference(recorder: RunRecorder, well: RunRecorder) -> FaultEffect | None:
    """Return the first difference between a run with a fault and the same run without, None where there is none."""
    return min(_differences(recorder, well), key=lambda difference: difference.t_s, default=None)


def _differences(recorder: RunRecorder, well: RunRecorder) -> Iterator[FaultEffect]:
    """Give the first difference of each kind, those that tell most first."""
    ticks = [(tick.t_s, tick.snapshot) for tick in recorder.ticks]
    well_ticks = [(tick.t_s, tick.snapshot) for tick in well.ticks]
    for t_s, now, then in _first(ticks, well_ticks, recorder.ended_s):
        yield FaultEffect(t_s, _of_snapshots(now, then))
    for t_s, _, _ in _first(recorder.boards, well.boards, recorder.ended_s):
        yield FaultEffect(t_s, "answer of the motor board")
    fixes, well_fixes = ([(fix.t_s, fix) for fix in each.fixes if fix is not None] for each in (recorder, well))
    for t_s, _, _ in _first(fixes, well_fixes, recorder.ended_s):
        yield FaultEffect(t_s, "position")
    events, well_events = ([(each.t_s, each) for each in log.events] for log in (recorder, well))
    for t_s, event, well_event in _first(events, well_events, recorder.ended_s):
        if there := event or well_event:
            yield FaultEffect(t_s, f"{'' if event else 'no '}event {there.name}")


def _first(run: Sequence[tuple[float, T]], well: Sequence[tuple[float, T]], ended_s: float) -> Iterator[_Pair[T]]:
    """Give the first items of two runs that are not the same, with the time; None where one run has no more."""
    for item, well_item in zip_longest(run, well):
        if item is None:
            yield min(well_item[0], ended_s), None, well_item[1]
        elif well_item is None or item[1] != well_item[1]:
            yield item[0], item[1], well_item and well_item[1]
        else:
            continue
        return


def _of_snapshots(now: Snapshot | None, then: Snapshot | None) -> str:
    if now is None or then is None:
        return "no further control tick" if now is None else "a further control tick"
    for part in ("compass", "motion", "contact"):
        read, well = getattr(now, part), getattr(then, part)
        if read == well:
            continue
        if read is None or well is None:
            return f"{part}: {'no' if read is None else 'a'} reading"
        # A reading's time is the last to name: an older reading is another one in all its numbers.
        names = [name for name in (*read._fields[1:], "t_s") if getattr(read, name) != getattr(well, name)]
        late = read.t_s < well.t_s
        return f"{part}: an older reading" if late else f"{part}.{names[0]}"
    return "time of the control tick"
