"""What the light shows is what its table says."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.control import status_light
from wayfarer.control.controller import Controller
from wayfarer.control.modes import Mode
from wayfarer.control.status_light import LIGHT_HZ, OFF, LastEnd, colour
from wayfarer.escape.api import Phase
from wayfarer.hal import Colour
from wayfarer.safety.conditions import LEVELS, Condition, Level

COLOURS = {
    name: getattr(status_light, name.upper()) for name in ("blue", "yellow", "green", "white", "magenta", "cyan", "red")
}
RHYTHMS = {  # of two seconds, lit or not at each refresh of the light
    "steady": [True] * 16,
    "slow": [*[True] * 4, *[False] * 4] * 2,
    "fast": [True, False] * 8,
    "twice": [True, True, False, False, True, True, *[False] * 10],
    "thrice": [True, True, False, False, True, True, False, False, True, True, *[False] * 6],
}
ROW = re.compile(r"^(\w+) +(steady|slow|fast|twice|thrice) +(driving with limits|\w+)", re.MULTILINE)
TABLE = {meaning: (COLOURS[shown], rhythm) for shown, rhythm, meaning in ROW.findall(status_light.__doc__ or "")}


def controller(
    mode: Mode, level: Level = Level.WELL, phase: Phase = Phase.FOLLOW, *conditions: Condition, ticked: bool = True
) -> Controller:
    """What the light sees of a controller."""
    decision = SimpleNamespace(phase=phase)
    last = SimpleNamespace(level=level, decision=decision) if ticked else None
    return cast(Controller, SimpleNamespace(mode=mode, last=last, conditions=conditions))


STATES: list[tuple[str, Any]] = [
    ("disarmed", controller(Mode.DISARMED, Level.WELL, Phase.HALT)),
    ("disarmed", controller(Mode.DISARMED, ticked=False)),
    ("disarmed", controller(Mode.DISARMED, Level.HOLD, Phase.HALT, Condition.COMPASS_STALE)),
    ("arming", controller(Mode.ARMING, Level.WELL, Phase.HALT)),
    ("arming", controller(Mode.ARMING, ticked=False)),
    ("arming", controller(Mode.ARMING, Level.HOLD, Phase.HALT, Condition.COMPASS_STALE)),
    ("arming", controller(Mode.ARMED, Level.HOLD, Phase.HALT, Condition.RESUME_WARNING)),
    ("driving", controller(Mode.ARMED)),
    ("driving with limits", controller(Mode.ARMED, Level.DEGRADE, Phase.FOLLOW, Condition.MOTION_UNKNOWN)),
    ("driving with limits", controller(Mode.ARMED, Level.DEGRADE, Phase.PROBE, Condition.HEADING_RECKONED)),
    *(
        ("escaping", controller(Mode.ARMED, Level.WELL, phase))
        for phase in Phase
        if phase not in {Phase.FOLLOW, Phase.HALT, Phase.MANUAL}
    ),
    ("driven", controller(Mode.MANUAL, Level.WELL, Phase.MANUAL)),
    ("driven", controller(Mode.MANUAL, Level.DEGRADE, Phase.MANUAL, Condition.COMPASS_LOST)),
    ("held", controller(Mode.MANUAL, Level.HOLD, Phase.MANUAL, Condition.MOTORS_FAILED)),
    ("held", controller(Mode.ARMED, Level.HOLD, Phase.HALT, Condition.OPERATOR_HOLD)),
    ("held", controller(Mode.ARMED, Level.HOLD, Phase.HALT, Condition.COMPASS_STALE)),
    ("battery", controller(Mode.ARMED, Level.DEGRADE, Phase.FOLLOW, Condition.BATTERY_LOW)),
    ("battery", controller(Mode.DISARMED, Level.DEGRADE, Phase.HALT, Condition.BATTERY_LOW)),
    ("held", controller(Mode.ARMED, Level.HOLD, Phase.HALT, Condition.MOTORS_FAILED)),
    ("fault", controller(Mode.DISARMED, Level.HOLD, Phase.HALT, Condition.MOTORS_FAILED)),
    ("fault", controller(Mode.DISARMED, Level.FAULT, Phase.HALT, Condition.COMPASS_LOST)),
    ("fault", controller(Mode.DISARMED, Level.FAULT, Phase.HALT, Condition.BATTERY_LOW, Condition.BATTERY_CRITICAL)),
]


LAST_ENDS = {"out": LastEnd.OUT, "stopped": LastEnd.STOPPED, "failed": LastEnd.FAILED, "unfinished": LastEnd.UNFINISHED}


def test_table_has_a_row_for_every_state() -> None:
    assert set(TABLE) == {state for state, _ in STATES} | set(LAST_ENDS)
    assert len(set(TABLE.values())) == len(TABLE), "no two states look the same"


@pytest.mark.parametrize(("state", "seen"), STATES)
def test_light_does_what_its_table_says(state: str, seen: Controller) -> None:
    shown, rhythm = TABLE[state]
    lit = [colour(seen, count / LIGHT_HZ) for count in range(int(2 * LIGHT_HZ))]
    assert lit == [shown if is_lit else OFF for is_lit in RHYTHMS[rhythm]]


@pytest.mark.parametrize(("told", "last_end"), LAST_ENDS.items())
def test_light_tells_how_the_last_mission_ended_only_while_all_is_well_and_disarmed(
    told: str, last_end: LastEnd
) -> None:
    assert set(LAST_ENDS.values()) == set(LastEnd)
    shown, rhythm = TABLE[told]
    for state, seen in STATES:
        lit = [colour(seen, count / LIGHT_HZ, last_end) for count in range(int(2 * LIGHT_HZ))]
        usual = [colour(seen, count / LIGHT_HZ) for count in range(int(2 * LIGHT_HZ))]
        assert lit == ([shown if is_lit else OFF for is_lit in RHYTHMS[rhythm]] if state == "disarmed" else usual)


def test_a_light_of_one_colour_tells_driving_escaping_and_limits_apart() -> None:
    assert len({TABLE[state][1] for state in ("driving", "escaping", "driving with limits", "arming")}) == 4


@given(st.integers(0, 10_000).map(lambda n: n / 1024), st.sampled_from([state for _, state in STATES]))
def test_no_flash_is_missed_whenever_the_light_is_shown(start_s: float, seen: Controller) -> None:
    """The light is refreshed twice a half period of the fastest rhythm, at times that are nobody's choice."""
    lit = [colour(seen, start_s + count / LIGHT_HZ) != OFF for count in range(int(2 * LIGHT_HZ))]
    assert sum(lit) in {sum(rhythm) for rhythm in RHYTHMS.values()}


@given(
    mode=st.sampled_from(Mode),
    phase=st.sampled_from(Phase),
    conditions=st.lists(st.sampled_from(Condition), max_size=4),
    ticked=st.booleans(),
    t_s=st.floats(0, 1e6),
)
def test_no_state_is_without_a_light_and_none_that_may_move_looks_disarmed(
    mode: Mode, phase: Phase, conditions: list[Condition], ticked: bool, t_s: float
) -> None:
    level = max((LEVELS[condition] for condition in conditions), default=Level.WELL)
    shown: set[Colour] = {
        colour(controller(mode, level, phase, *conditions, ticked=ticked), t_s + n / 16) for n in range(32)
    }
    assert shown - {OFF}
    if mode is not Mode.DISARMED and ticked:
        assert status_light.BLUE not in shown
