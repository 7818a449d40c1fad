"""Several logs that take the same run."""

from __future__ import annotations

from unittest.mock import Mock, call

from wayfarer.control.run_log import RunLog, Tee
from wayfarer.control.tick import TickRecord
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
