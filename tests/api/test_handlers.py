"""What a program gives in place of a rover file: nonsense is refused in one sentence with the value and the range."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer import EscapeSettings, FailSafe, StuckDetector, Vehicle, WayfarerError, make_handler
from wayfarer.errors import OutOfRange
from wayfarer.escape.catalogue import BUILT_IN, CATALOGUE

BODY = {"length_m": 0.6, "width_m": 0.5, "track_m": 0.6, "max_speed_m_s": 1.2}
VEHICLE = Vehicle(**BODY)
NONSENSE: st.SearchStrategy[Any] = st.one_of(
    st.floats(max_value=-1e-9), st.sampled_from([nan, inf, -inf, 1e300, 10**400, True, None, "0.6", 0.6j, [0.6], {}])
)
MAKERS: dict[str, Callable[..., Any]] = {
    "Vehicle": lambda **given: Vehicle(**BODY | given),
    "EscapeSettings": EscapeSettings,
    "StuckDetector": lambda **given: StuckDetector(VEHICLE, **given),
    "FailSafe": lambda **given: FailSafe(make_handler(vehicle=VEHICLE), VEHICLE, **given),
}
NUMBERS = [
    *(("Vehicle", key) for key in Vehicle.__dataclass_fields__),
    *(("EscapeSettings", key) for key in EscapeSettings.__dataclass_fields__),
    *(("StuckDetector", key) for key in ("stuck_s", "tilt_deg", "heading_stale_s", "motion_stale_s")),
    *(("FailSafe", key) for key in ("free_run_m", "free_run_max_m", "relapse_s")),
]


@pytest.mark.parametrize(("who", "key"), NUMBERS)
@given(value=NONSENSE)
def test_number_that_cannot_be_is_refused_with_its_name_and_range(who: str, key: str, value: Any) -> None:
    with pytest.raises(OutOfRange) as refused:
        MAKERS[who](**{key: value})
    text = str(refused.value)
    assert text.startswith(f"{who}: {key} = {value!r:.80}: ")
    assert "allowed is " in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"max_speed_m_s": 0}, "Vehicle: max_speed_m_s = 0: allowed is 0.01 to 5 metres per second"),
        ({"track_m": "wide"}, "Vehicle: track_m = 'wide': not a number; allowed is 0.1 to 5 metres"),
        ({"length_m": 600}, "Vehicle: length_m = 600: allowed is 0.1 to 5 metres; if it is in millimetres, write 0.6"),
        (
            {"length_m": np.bool_(True)},
            "Vehicle: length_m = True: not a number; allowed is 0.1 to 5 metres",
        ),
        (
            {"turn_from_duty": 1.0},
            "Vehicle: turn_from_duty = 1.0: allowed is 0 to below 1; if it is in percent, write 0.01",
        ),
    ],
)
def test_body_that_cannot_be_is_refused_in_these_words(given: dict[str, Any], said: str) -> None:
    with pytest.raises(OutOfRange) as refused:
        Vehicle(**BODY | given)
    assert str(refused.value) == said


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.float16, int, np.int64, np.uint8, np.array])
def test_numbers_of_numpy_are_numbers(kind: type) -> None:
    vehicle = Vehicle(**{key: kind(2) for key in BODY})
    assert vehicle == Vehicle(2.0, 2.0, 2.0, 2.0)
    assert {type(getattr(vehicle, key)) for key in BODY} == {float}
    assert make_handler("levy-walk", vehicle=vehicle, seed=np.int64(3))


@pytest.mark.parametrize("name", BUILT_IN)
def test_algorithm_is_made_only_for_observations_that_have_what_it_needs(name: str) -> None:
    needs = "contact" in BUILT_IN[name].requires
    assert make_handler(name, vehicle=VEHICLE, contact=True)
    if not needs:
        assert make_handler(name, vehicle=VEHICLE)
        return
    with pytest.raises(
        WayfarerError, match=f"^algorithm '{name}' needs a contact sensor: pass contact=True"
    ) as refused:
        make_handler(name, vehicle=VEHICLE)
    assert "forest-pledge" in str(refused.value)
    assert not [other for other, row in CATALOGUE.items() if row.requires and f", {other}" in str(refused.value)]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"algorithm": None}, "make_handler: algorithm = None is not a str"),
        ({"algorithm": "forest-plegde"}, "unknown algorithm 'forest-plegde': did you mean forest-pledge"),
        ({"vehicle": BODY}, "make_handler: vehicle = {'length_m': 0.6,"),
        ({"settings": 0.5}, "make_handler: settings = 0.5 is not an EscapeSettings"),
        ({"seed": 0.5}, "make_handler: seed = 0.5 is not a whole number"),
        ({"seed": "zero"}, "make_handler: seed = 'zero' is not a whole number"),
    ],
)
def test_what_is_no_part_of_a_handler_is_refused_in_a_line(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(WayfarerError) as refused:
        make_handler(**{"vehicle": VEHICLE} | wrong)
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)
