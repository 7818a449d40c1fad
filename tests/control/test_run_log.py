"""Several logs that take the same run."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import Mock, call

from tests.fieldlog.lines import standing
from wayfarer.control.run_log import DriverCounters, PartialLog, RunLog, Tee
from wayfarer.control.tick import TickRecord
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import Event
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import PositionFix

RECORD = TickRecord(1.0)
FIX = PositionFix(1.5, 52.0, 13.0, None)


def test_tee_tells_every_log_everything_in_turn() -> None:
    told = Mock(spec_set=["first", "second"])
    told.first, told.second = Mock(spec_set=RunLog), Mock(spec_set=RunLog)
    tee = Tee(told.first, told.second)
    tee.tick(RECORD)
    tee.event("armed", 2.0, goal_heading_deg=3.0)
    tee.position(FIX)
    tee.position(None)
    tee.close("requested", "enough")
    expected = [
        call.tick(RECORD), call.event("armed", 2.0, goal_heading_deg=3.0), call.position(FIX), call.position(None),
        call.close("requested", "enough"),
    ]  # fmt: skip
    assert told.first.mock_calls == expected
    assert told.second.mock_calls == expected
    assert [name.partition(".")[0] for name, _, _ in told.mock_calls] == ["first", "second"] * len(expected)


class LooseWire:
    """A compass whose wire is a little loose."""

    name = "compass"

    async def open(self) -> None: ...

    async def close(self) -> None: ...

    @property
    def error_counts(self) -> dict[str, int]:
        return {"reads retried": 1}


class Told(PartialLog):
    def __init__(self) -> None:
        self.severities: list[tuple[str, object]] = []

    def event(self, name: str, t_s: float, **details: object) -> None:
        self.severities.append((name, details["severity"]))


def test_errors_that_a_driver_has_recovered_from_are_no_warning() -> None:
    """A wire that is a little loose has some each second, and nothing is wrong with the run."""
    log = Told()
    DriverCounters([LooseWire()], log).note(1.0)
    assert log.severities == [("part_troubles", "info")]


def test_context_of_a_run_is_that_of_all_events_of_its_logs(tmp_path: Path) -> None:
    """A clock that is set during a mission is an event of the field log only."""
    offset_s = 0.0
    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s + offset_s)
    tee = Tee(log)
    tee.bind(run="00017-now", mission=2)
    log.tick(standing(1.0))
    offset_s = 3600.0
    log.tick(standing(2.0))
    tee.logger.info("mark", t_s=3.0, text="Mark")
    tee.close("requested", "enough")
    events = [record for record in RunReader(tmp_path) if isinstance(record, Event)]
    assert [(event.name, event.run, event.mission) for event in events] == [
        ("clock_step", "00017-now", 2), ("mark", "00017-now", 2),
    ]  # fmt: skip
