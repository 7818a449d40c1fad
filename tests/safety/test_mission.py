"""The limits of a mission: time, distance, and a radius that a receiver measures better than dead reckoning."""

from __future__ import annotations

from math import asin, cos, degrees, hypot, inf, nan, radians, sin, sqrt

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wayfarer.angles import METRES_PER_DEG
from wayfarer.hal import PositionFix
from wayfarer.safety.mission import Mission, Place
from wayfarer.safety.settings import SafetySettings

SETTINGS = SafetySettings(mission_time_s=600.0, mission_distance_m=400.0, mission_radius_m=100.0)
STARTS_S = 1000.0
EARTH_M = 6_371_000.0
FIX_FRESH_S = 3.0  # fault catalogue, fault 56: after that, dead reckoning counts
FIXES_BEYOND = 5


def somewhere() -> Place:
    """Return a place far from where the run began: a mission's limits count from its own start."""
    place = Place()
    place.move(37.0, -5.0, 123.0)
    return place


def go(under_test: Mission, commanded_m: float, ahead_m: float, heading_deg: float) -> None:
    """Drive in a tick: what the wheels were commanded, and what the body did."""
    under_test.place.move(ahead_m, 0.0, heading_deg)
    under_test.advance(commanded_m)


def mission() -> Mission:
    return Mission(SETTINGS, STARTS_S, somewhere())


def reason(under_test: Mission, t_s: float = STARTS_S + 1.0) -> str | None:
    end = under_test.end(t_s)
    return None if end is None else end.reason


def fix(north_m: float, t_s: float = STARTS_S, latitude_deg: float = 52.0) -> PositionFix:
    return PositionFix(t_s, latitude_deg + north_m / METRES_PER_DEG, 13.0, 3.0)


def great_circle_m(a: PositionFix, b: PositionFix) -> float:
    """The haversine formula on a sphere: what the flat reckoning must agree with over a mission's distances."""
    lat_a, lat_b = radians(a.latitude_deg), radians(b.latitude_deg)
    half_lat, half_lon = (lat_b - lat_a) / 2, radians(b.longitude_deg - a.longitude_deg) / 2
    return 2 * EARTH_M * asin(sqrt(sin(half_lat) ** 2 + cos(lat_a) * cos(lat_b) * sin(half_lon) ** 2))


def test_time_counts_from_the_start_of_the_mission() -> None:
    assert reason(mission(), STARTS_S) is None
    assert reason(mission(), STARTS_S + 599.99) is None
    end = mission().end(STARTS_S + 600.0)
    assert end is not None
    assert (end.reason, end.text) == ("mission_time", "the mission limit of 600 s was reached")


def test_distance_counts_both_ways() -> None:
    under_test = mission()
    for step in range(399):
        go(under_test, 1.0 if step % 2 else -1.0, 1.0 if step % 2 else -1.0, 0.0)
    assert reason(under_test) is None
    go(under_test, -1.0, -1.0, 0.0)
    assert reason(under_test) == "mission_distance"


STEPS = st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(0, 360, exclude_max=True)), max_size=15)


@given(STEPS)
def test_dead_reckoning_adds_up_covered_ground_along_the_compass(steps: list[tuple[float, float, float]]) -> None:
    under_test = mission()
    for commanded_m, covered_m, heading_deg in steps:
        go(under_test, commanded_m, covered_m, heading_deg)
    north_m = sum(covered_m * cos(radians(heading_deg)) for _, covered_m, heading_deg in steps)
    east_m = sum(covered_m * sin(radians(heading_deg)) for _, covered_m, heading_deg in steps)
    assert under_test.travelled_m == pytest.approx(sum(abs(commanded_m) for commanded_m, _, _ in steps))
    assert (under_test.north_m, under_test.east_m) == pytest.approx((north_m, east_m), abs=1e-6)
    off_m = hypot(north_m, east_m)
    assume(abs(off_m - 100.0) > 1e-6)
    assert (reason(under_test) == "mission_radius") is (off_m > 100.0)


@given(
    latitude_deg=st.floats(-70, 70),
    longitude_deg=st.floats(-180, 180),
    north_m=st.floats(-300, 300),
    east_m=st.floats(-300, 300),
)
def test_radius_by_fixes_is_that_on_the_globe(
    latitude_deg: float, longitude_deg: float, north_m: float, east_m: float
) -> None:
    """Also across the date line."""
    home = PositionFix(STARTS_S, latitude_deg, longitude_deg, None)
    east_deg = degrees(east_m / (EARTH_M * cos(radians(latitude_deg))))
    there = PositionFix(
        STARTS_S,
        latitude_deg + degrees(north_m / EARTH_M),
        (longitude_deg + east_deg + 180.0) % 360.0 - 180.0,
        None,
    )
    off_m = great_circle_m(home, there)
    assume(abs(off_m - 100.0) > 1.0)
    under_test = mission()
    under_test.position(home)
    for number in range(1, FIXES_BEYOND + 1):
        under_test.position(there._replace(t_s=STARTS_S + 0.2 * number))
    assert (reason(under_test) == "mission_radius") is (off_m > 100.0)


@given(st.lists(st.sampled_from([0.0, 99.0, 101.0, 1e6]), max_size=30))
def test_only_fixes_beyond_in_a_row_end_a_mission(norths_m: list[float]) -> None:
    under_test = mission()
    under_test.position(fix(0.0))
    beyond = 0
    for t_s, north_m in enumerate(norths_m, start=int(STARTS_S) + 1):
        under_test.position(fix(north_m, t_s))
        beyond = beyond + 1 if north_m > 100.0 else 0
        assert (reason(under_test, t_s) == "mission_radius") is (beyond >= FIXES_BEYOND)


def test_fix_that_jumped_and_is_read_many_times_counts_once() -> None:
    """``rates.position_hz`` may be higher than the rate of the receiver."""
    under_test = mission()
    under_test.position(fix(0.0))
    for seconds in range(1, FIXES_BEYOND + 1):
        assert reason(under_test, STARTS_S + seconds) is None
        for _ in range(2 * FIXES_BEYOND):
            under_test.position(fix(150.0, STARTS_S + seconds))
    assert reason(under_test, STARTS_S + FIXES_BEYOND) == "mission_radius"


def test_first_fix_is_the_start_wherever_that_is() -> None:
    under_test = mission()
    for seconds in range(20):
        under_test.position(fix(5000.0, STARTS_S + seconds))
    assert reason(under_test, STARTS_S + 20.0) is None


@pytest.mark.parametrize("first_error_m", [40.0, None])
def test_start_is_where_the_best_fix_puts_it_not_the_first(first_error_m: float | None) -> None:
    """A receiver that starts is off by tens of metres: the mission ended 60 m too early, or went 60 m too far."""
    for off_m in (60.0, -60.0):
        under_test = mission()
        under_test.position(fix(off_m)._replace(error_m=first_error_m))
        for seconds in range(1, 200):  # a metre a second to the north
            go(under_test, 1.0, 1.0, 0.0)
            t_s = STARTS_S + seconds
            under_test.position(fix(float(seconds), t_s))
            ends = seconds >= 100.0 + FIXES_BEYOND - 1
            assert (reason(under_test, t_s) == "mission_radius") is ends


def test_fix_after_a_person_has_driven_does_not_move_the_start_however_good_it_is() -> None:
    """Who drives by hand may carry the rover as well, and dead reckoning knows nothing of that."""
    under_test = mission()
    under_test.position(fix(0.0)._replace(error_m=5.0))
    under_test.wait(1.0)
    for seconds in range(1, FIXES_BEYOND + 1):
        under_test.position(fix(150.0, STARTS_S + seconds)._replace(error_m=0.5))
    assert reason(under_test, STARTS_S + FIXES_BEYOND) == "mission_radius"


def test_first_fix_after_a_person_has_driven_is_better_than_none() -> None:
    under_test = mission()
    under_test.wait(1.0)
    for seconds in range(1, FIXES_BEYOND + 1):
        under_test.position(fix(0.0, STARTS_S + seconds))
    assert reason(under_test, STARTS_S + FIXES_BEYOND) is None


def test_late_fix_that_is_as_good_does_not_move_the_start() -> None:
    """Dead reckoning is off by a share of the way, here by all of it: the wheels spin."""
    under_test = mission()
    under_test.position(fix(0.0))
    for seconds in range(1, 150):
        go(under_test, 1.0, 1.0, 0.0)
        under_test.position(fix(0.0, STARTS_S + seconds))
    assert reason(under_test, STARTS_S + 150.0) is None


@pytest.mark.parametrize("error_m", [3.0, None, nan, -1.0])
@pytest.mark.parametrize(("further_m", "ends"), [(5.0, False), (15.0, True)])
def test_start_of_a_mission_whose_first_fix_comes_late_is_reckoned_back(
    error_m: float | None, further_m: float, ends: bool
) -> None:
    under_test = mission()
    go(under_test, 90.0, 90.0, 0.0)
    under_test.position(fix(0.0)._replace(error_m=error_m))
    for seconds in range(1, FIXES_BEYOND + 1):
        under_test.position(fix(further_m, STARTS_S + seconds)._replace(error_m=error_m))
    assert (reason(under_test, STARTS_S + FIXES_BEYOND) == "mission_radius") is ends


def test_fresh_fix_at_home_counts_more_than_dead_reckoning_and_an_old_one_less() -> None:
    under_test = mission()
    go(under_test, 150.0, 150.0, 30.0)
    assert reason(under_test) == "mission_radius"
    under_test.position(fix(0.0, STARTS_S + 10.0))
    assert reason(under_test, STARTS_S + 10.0 + FIX_FRESH_S) is None
    assert reason(under_test, STARTS_S + 10.1 + FIX_FRESH_S) == "mission_radius"


def test_fix_of_the_future_counts_less_than_dead_reckoning() -> None:
    under_test = mission()
    go(under_test, 150.0, 150.0, 30.0)
    under_test.position(fix(0.0, STARTS_S + 10.0))
    assert reason(under_test, STARTS_S + 9.9) == "mission_radius"
    assert reason(under_test, STARTS_S + 10.0) is None


def test_old_fixes_beyond_the_radius_end_nothing() -> None:
    under_test = mission()
    under_test.position(fix(0.0))
    for seconds in range(1, FIXES_BEYOND + 1):
        under_test.position(fix(150.0, STARTS_S + seconds))
    old_s = STARTS_S + FIXES_BEYOND + FIX_FRESH_S
    assert reason(under_test, old_s) == "mission_radius"
    assert reason(under_test, old_s + 0.1) is None


def test_the_first_limit_of_several_is_told() -> None:
    under_test = mission()
    go(under_test, 500.0, 500.0, 0.0)
    assert reason(under_test) == "mission_distance"
    assert reason(under_test, inf) == "mission_time"


def test_without_any_fix_dead_reckoning_counts_from_the_first_second_on() -> None:
    under_test = Mission(SETTINGS, 0.0, somewhere())
    go(under_test, 150.0, 150.0, 30.0)
    for t_s in (0.0, 0.05, 2.9, 3.1):
        assert reason(under_test, t_s) == "mission_radius"


BAD_FIXES = [
    fix(0.0)._replace(**{field: value})
    for field in ("t_s", "latitude_deg", "longitude_deg")
    for value in (nan, inf, -inf)
] + [fix(0.0)._replace(latitude_deg=90.1), fix(0.0)._replace(longitude_deg=-180.1)]


@pytest.mark.parametrize("bad", BAD_FIXES, ids=str)
def test_fix_that_no_receiver_can_give_is_not_taken_for_the_start_and_lifts_no_limit(bad: PositionFix) -> None:
    """Fault catalogue, fault 8: around a start that is no number every place would be within the radius."""
    under_test = mission()
    under_test.position(bad)
    under_test.position(fix(0.0))
    for seconds in range(1, FIXES_BEYOND + 1):
        under_test.position(bad)
        under_test.position(fix(150.0, STARTS_S + seconds))
    assert reason(under_test, STARTS_S + FIXES_BEYOND) == "mission_radius"
