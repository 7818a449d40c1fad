"""What the light shows is what its table says."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.control import status_light
from wayfarer.control.controller import Controller, Mode
from wayfarer.control.status_light import LIGHT_HZ, OFF, colour
from wayfarer.escape.api import Phase
from wayfarer.hal import Colour
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.responses import LEVELS

COLOURS = {name: getattr(status_light, name.upper()) for name in ("blue", "yellow", "green", "white", "magenta", "red")}
BLINKS_HZ = {"steady": 0.0, "slow": 1.0, "fast": 4.0}
TABLE = {
    meaning: (COLOURS[shown], BLINKS_HZ[rhythm])
    for shown, rhythm, meaning in re.findall(r"^(\w+) +(steady|slow|fast) +(\w+)", status_light.__doc__ or "", re.M)
}


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
    ("driving", controller(Mode.ARMED, Level.DEGRADE, Phase.FOLLOW, Condition.MOTION_UNKNOWN)),
    *(
        ("escaping", controller(Mode.ARMED, Level.WELL, phase))
        for phase in Phase
        if phase not in {Phase.FOLLOW, Phase.HALT}
    ),
    ("held", controller(Mode.ARMED, Level.HOLD, Phase.HALT, Condition.OPERATOR_HOLD)),
    ("held", controller(Mode.ARMED, Level.HOLD, Phase.HALT, Condition.COMPASS_STALE)),
    ("battery", controller(Mode.ARMED, Level.DEGRADE, Phase.FOLLOW, Condition.BATTERY_LOW)),
    ("battery", controller(Mode.DISARMED, Level.DEGRADE, Phase.HALT, Condition.BATTERY_LOW)),
    ("fault", controller(Mode.DISARMED, Level.FAULT, Phase.HALT, Condition.COMPASS_LOST)),
    ("fault", controller(Mode.DISARMED, Level.FAULT, Phase.HALT, Condition.BATTERY_LOW, Condition.BATTERY_CRITICAL)),
]


def test_table_has_a_row_for_every_state() -> None:
    assert set(TABLE) == {state for state, _ in STATES}
    assert len(set(TABLE.values())) == len(TABLE), "no two states look the same"


@pytest.mark.parametrize(("state", "seen"), STATES)
def test_light_does_what_its_table_says(state: str, seen: Controller) -> None:
    shown, blink_hz = TABLE[state]
    times_s = [count / LIGHT_HZ for count in range(int(2 * LIGHT_HZ))]
    lit = [colour(seen, t_s) for t_s in times_s]
    if blink_hz == 0.0:
        assert set(lit) == {shown}
    else:
        half = round(LIGHT_HZ / blink_hz / 2)
        assert lit == ([shown] * half + [OFF] * half) * round(2 * blink_hz)


@given(st.integers(0, 10_000).map(lambda n: n / 1024), st.sampled_from([state for _, state in STATES]))
def test_a_light_that_blinks_is_on_half_of_the_time_whenever_it_is_shown(start_s: float, seen: Controller) -> None:
    """The light is refreshed twice a half period of the fastest rhythm, at times that are nobody's choice."""
    lit = [colour(seen, start_s + count / LIGHT_HZ) != OFF for count in range(int(LIGHT_HZ))]
    assert sum(lit) in {len(lit), len(lit) // 2}


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
        colour(controller(mode, level, phase, *conditions, ticked=ticked), t_s + n / 16) for n in range(16)
    }
    assert shown - {OFF}
    if mode is not Mode.DISARMED and ticked:
        assert status_light.BLUE not in shown
