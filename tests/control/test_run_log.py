"""Several logs that take the same run."""

from __future__ import annotations

from pathlib import Path

from tests.fieldlog.lines import standing
from wayfarer.control.run_log import DriverCounters, RunLog, Tee
from wayfarer.control.tick import TickRecord
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import Event
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import STOP, MotorHealth, PositionFix, WheelCommand

RECORD = TickRecord(1.0)
FIX = PositionFix(1.5, 52.0, 13.0, None)
HEALTH = MotorHealth(12.0, ())


class Kept(RunLog):
    def __init__(self, name: str, told: list[tuple[object, ...]]) -> None:
        self.name, self.told = name, told

    def tick(self, record: TickRecord) -> None:
        self.told.append((self.name, record))

    def event(self, name: str, t_s: float, **details: object) -> None:
        self.told.append((self.name, name, t_s, details))

    def position(self, fix: PositionFix | None) -> None:
        self.told.append((self.name, fix))

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        self.told.append((self.name, t_s, health, duties))

    def close(self, reason: str, text: str) -> None:
        self.told.append((self.name, reason, text))


def test_tee_tells_every_log_everything_in_turn() -> None:
    told: list[tuple[object, ...]] = []
    tee = Tee(Kept("first", told), Kept("second", told))
    tee.tick(RECORD)
    tee.event("armed", 2.0, goal_heading_deg=3.0)
    tee.position(FIX)
    tee.position(None)
    tee.board(2.5, HEALTH, STOP)
    tee.close("requested", "enough")
    expected = [
        (RECORD,), ("armed", 2.0, {"goal_heading_deg": 3.0}), (FIX,), (None,), (2.5, HEALTH, STOP),
        ("requested", "enough"),
    ]  # fmt: skip
    assert told == [(name, *what) for what in expected for name in ("first", "second")]


class LooseWire:
    """A compass whose wire is a little loose."""

    name = "compass"

    async def open(self) -> None: ...

    async def close(self) -> None: ...

    @property
    def error_counts(self) -> dict[str, int]:
        return {"reads retried": 1}


class Told(RunLog):
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
