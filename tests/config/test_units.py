"""Every setting of a rover file that has a unit refuses its usual wrong units, and says what may be meant."""

from __future__ import annotations

import re
from dataclasses import asdict
from functools import reduce
from math import radians
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wayfarer.config.rover_file import RoverConfig, flat, laid_over, load_rover, part_settings
from wayfarer.errors import BadConfig

ROVERS = ("forestrover", "minirover")
TO_KM_H = 3.6
RADIANS = radians(1.0)
# By the end of a key's name: what a number is multiplied by if it is in a wrong unit.
WRONG = {
    "_deg_s": (RADIANS, 1000, 0.001),
    "_m_s": (1000, 100, 0.001),
    "bytes_per_s": (1000, 0.001),
    "_per_s": (100, 1000, 0.001),
    "_n_m": (1000, 0.001),
    "_kg": (1000, 0.001),
    "_deg": (RADIANS, 1000, 0.001),
    "_us": (0.001, 1000),
    "_hz": (1000, 0.001),
    "_mb": (1000, 0.001),
    "_m": (1000, 100, 0.001),
    "_s": (1000, 0.001),
    "_v": (1000, 0.001),
    # shares, and what has a unit by its nature
    "duty_max": (100,), "duty_limit": (100,), "quality_min": (100,), "immobilised_below": (100,),
    "rad_per_count": (57.3, 1000, 0.001),
}  # fmt: skip
# What no range can tell.
EXEMPT = {
    ("safety.mission_distance_m", 1000), ("safety.mission_distance_m", 100), ("safety.mission_distance_m", 0.001),
    ("safety.mission_radius_m", 1000), ("safety.mission_radius_m", 100),  # up to 1,000 km: no limit
    ("safety.start_delay_s", 0.001), ("safety.resume_warning_s", 0.001),  # may be 0, so also nearly 0
    ("detector.tilt_s", 0.001), ("detector.tipping_s", 0.001), ("log.free_mb", 0.001),
}  # fmt: skip


def wrong_units(key: str) -> tuple[float, ...]:
    return next((factors for end, factors in WRONG.items() if key.endswith(end)), ())


def settings(rover: RoverConfig) -> dict[str, float]:
    """Return each number of a rover that has a unit, defaults included, by its key."""
    whole = rover.model_dump(mode="json")
    whole["parts"] = {part: asdict(part_settings(part, table)[1]) for part, table in rover.parts.items()}
    numbers = {key: value for key, value in flat(whole).items() if isinstance(value, int | float)}
    return {key: value for key, value in numbers.items() if wrong_units(key) and value and value is not True}


def with_setting(rover: RoverConfig, key: str, value: float) -> RoverConfig:
    *tables, last = key.split(".")
    laid: dict[str, Any] = reduce(lambda inner, table: {table: inner}, reversed(tables), {last: value})
    return laid_over(rover, laid)


CASES = [
    (name, key, value, factor)
    for name in ROVERS
    for key, value in settings(load_rover(name)).items()
    for factor in wrong_units(key)
    if (key, factor) not in EXEMPT
]


@pytest.mark.parametrize(("name", "key", "value", "factor"), CASES)
def test_number_of_a_rover_in_a_wrong_unit_is_refused_with_key_value_and_range(
    name: str, key: str, value: float, factor: float
) -> None:
    wrong = value * factor if isinstance(value, float) else int(value * factor)
    with pytest.raises(BadConfig) as refused:
        with_setting(load_rover(name), key, wrong)
    said = str(refused.value)
    assert said.startswith(f"key '{key}' = ")
    assert "\n" not in said
    assert "; allowed is " in said


# Of these the message says what may be meant.
TOLD = {
    "_deg_s": (RADIANS,), "_m_s": (TO_KM_H, 1000, 100), "_per_s": (100,), "_kg": (1000,), "_deg": (RADIANS,),
    "_us": (0.001,), "_hz": (0.001,), "_mb": (1000, 0.001), "_m": (1000, 100, 0.001), "_s": (1000,), "_v": (1000,),
    "duty_max": (100,), "quality_min": (100,),
}  # fmt: skip
MEANT = [
    (key, value, factor)
    for key, value in settings(load_rover("forestrover")).items()
    for factor in next((factors for end, factors in TOLD.items() if key.endswith(end)), ())
    if key != "mavlink.bytes_per_s"
]


@given(st.sampled_from(MEANT), st.floats(0.5, 2.0))
def test_what_may_be_meant_is_offered_whatever_the_number(case: tuple[str, float, float], share: float) -> None:
    key, usual, factor = case
    rover, meant = load_rover("forestrover"), usual * share if isinstance(usual, float) else max(1, int(usual * share))
    try:
        with_setting(rover, key, meant)
    except BadConfig:
        assume(False)  # such a number is not allowed, in whatever unit
    try:
        with_setting(rover, key, meant * factor)
    except BadConfig as error:
        offered = [float(each) for each in re.findall(r", write ([0-9.e+-]+)", str(error))]
        assert any(abs(each - meant) <= 0.01 * meant for each in offered), (meant * factor, str(error))


@pytest.mark.parametrize(
    ("key", "wrong", "said"),
    [
        ("vehicle.length_m", 437, "; allowed is 0.1 to 5 metres; if it is in millimetres, write 0.437"),
        ("detector.tilt_deg", 0.26, "; allowed is 5 to 180 degrees; if it is in radians, write 14.9"),
        ("safety.duty_max", 80, "; allowed is above 0 to 1; if it is in percent, write 0.8"),
        ("detector.immobilised_s", 300, "; allowed is 0.02 to 10 seconds; if it is in milliseconds, write 0.3"),
        ("vehicle.max_speed_m_s", 5.04, "; if it is in km/h, write 1.4"),
        ("escape.cruise_m_s", 1.512, "vehicle.max_speed_m_s is 1.4 metres per second; if it is in km/h, write 0.42"),
        ("manual.speed_m_s", 1.8, "vehicle.max_speed_m_s is 1.4 metres per second; if it is in km/h, write 0.5"),
        ("safety.calibration_min", 7, "; allowed is 0 to 3"),
    ],
)
def test_usual_mistakes_are_told_in_these_words(key: str, wrong: float, said: str) -> None:
    with pytest.raises(BadConfig) as refused:
        with_setting(load_rover("forestrover"), key, wrong)
    assert str(refused.value).startswith(f"key '{key}' = {wrong}")
    assert said in str(refused.value)


@pytest.mark.parametrize("value", [10**400, -(10**400), 1e308], ids=["long", "long and negative", "large"])
def test_endless_number_is_refused_in_one_short_line(value: float) -> None:
    with pytest.raises(BadConfig) as refused:
        with_setting(load_rover("forestrover"), "vehicle.length_m", value)
    assert len(str(refused.value)) < 300


def test_no_setting_is_left_out() -> None:
    assert len({key for _, key, _, _ in CASES}) > 70
    assert {"vehicle.length_m", "detector.tilt_deg", "control_hz", "parts.motion.height_m"} <= {
        key for _, key, *_ in CASES
    }
