"""What a mission came to: its metres and anomalies, without those that a person drove."""

from __future__ import annotations

import pytest

from tests.fieldlog.lines import standing
from wayfarer.control.run_log import PartialLog
from wayfarer.control.tick_record import TickRecord
from wayfarer.daemon.mission_totals import MissionTotals
from wayfarer.escape.api import Anomaly, Decision, Observation, Phase
from wayfarer.hal import WheelCommand

STUCK = (Anomaly.IMMOBILISED,)


def at(t_s: float, travelled_m: float, anomalies: tuple[Anomaly, ...] = (), *, by_hand: bool = False) -> TickRecord:
    record = standing(t_s)
    record.observation = Observation(t_s, 0.0, 0.0, 0.0, anomalies, None, 0.0, travelled_m)
    record.decision = Decision(WheelCommand(0.5, 0.5), Phase.MANUAL if by_hand else Phase.FOLLOW, "")
    return record


@pytest.fixture
def counted() -> MissionTotals:
    return MissionTotals(PartialLog())


def test_metres_and_anomalies_of_a_mission_are_counted(counted: MissionTotals) -> None:
    counted.tick(at(0.0, 3.0, STUCK))
    counted.event("armed", 1.0)
    for t_s, travelled_m, anomalies in (
        (1.0, 3.0, ()),
        (2.0, 4.0, STUCK),
        (3.0, 5.5, STUCK),
        (4.0, 6.0, ()),
        (5.0, 7.0, STUCK),
    ):
        counted.tick(at(t_s, travelled_m, anomalies))
    assert counted.totals == {"mission_s": 4.0, "mission_m": 4.0, "mission_anomalies": 2, "mission_ended": None}
    counted.event("disarmed", 5.5, reason="mission_time")
    counted.tick(at(9.0, 70.0))
    assert (counted.totals["mission_m"], counted.totals["mission_ended"]) == (4.0, "mission_time")


def test_what_a_person_drives_meanwhile_is_none_of_it(counted: MissionTotals) -> None:
    counted.event("armed", 0.0)
    for tick in (
        at(0.0, 0.0), at(1.0, 1.0), at(2.0, 3.0, by_hand=True), at(3.0, 9.0, STUCK, by_hand=True), at(4.0, 10.0),
    ):  # fmt: skip
        counted.tick(tick)
    assert counted.totals == {"mission_s": 4.0, "mission_m": 2.0, "mission_anomalies": 0, "mission_ended": None}
