"""The result of one scenario, of the catalogue or a user's."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from wayfarer.fault_scenarios.catalogue.covered_by_tests import FaultTest
from wayfarer.fault_scenarios.scenario import ResponseLevel, Scenario

Row = Scenario | FaultTest


class Tried(StrEnum):
    """How a fault was tried."""

    SIMULATED = "virtual time"
    TEST = "a test"


class Result(NamedTuple):
    """How one fault was met.

    Times are seconds from the beginning of the fault; None where nothing of that kind can be timed. ``changed`` says
    what the field code read, or was told, that it would not have without the fault. ``problems`` is empty where all was
    as expected; ``remark`` is for the reader: why the level is another than the catalogue's, or what only a real part
    can show and how. Of a row that was not run ``skipped`` says why; it has neither passed nor failed.
    """

    name: str
    row: int | None
    about: str
    tried: Tried
    asked: str
    expected: ResponseLevel
    reached: ResponseLevel = ResponseLevel.NONE
    within_s: float | None = None
    changed: str = ""
    detected_s: float | None = None
    stopped_s: float | None = None
    cause: str = ""
    problems: tuple[str, ...] = ()
    remark: str = ""
    skipped: str = ""

    @property
    def passed(self) -> bool:
        """Whether it was run and all was as expected."""
        return not (self.problems or self.skipped)


def not_run(row: Row, skipped: str = "") -> Result:
    """Return the result of a row that was not run, and why."""
    if isinstance(row, FaultTest):
        tried, level, within_s = Tried.TEST, row.level, row.within_s
    else:
        tried, level, within_s = Tried.SIMULATED, row.expect.level, None
    return Result(row.name, row.row, row.about, tried, row.asked, level, within_s=within_s, skipped=skipped)
