"""Dead reckoning laid onto the receiver's fixes as a whole."""

from __future__ import annotations

import cmath
from math import nan, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.angles import coordinates_deg
from wayfarer.logview.receiver_fit import MapFix, Places, believable, fit
from wayfarer.reports.data import RunData
from wayfarer.reports.map import TimedPath, Track

ORIGIN = MapFix(0.0, 47.0, 8.0, 3.0, 0.0, 0.0)
LOOP_M = 30.0 * np.exp(1j * np.linspace(0.0, 5.0, 200))  # a way of 150 m
NOISE = np.random.default_rng(1)


def fixes(reckoned_m: Places, true_m: Places, every_s: float = 2.0) -> list[MapFix]:
    """What a receiver says of true places, while dead reckoning has the rover elsewhere."""
    return [
        MapFix(every_s * at, *coordinates_deg(ORIGIN, true.imag, true.real), 3.0, reckoned.imag, reckoned.real)
        for at, (reckoned, true) in enumerate(zip(reckoned_m, true_m, strict=True))
    ]


def noisy(places_m: Places, sigma_m: float) -> Places:
    noise: Places = NOISE.normal(0.0, sigma_m, (places_m.size, 2)) @ np.array([1.0, 1.0j])
    return places_m + noise


@given(st.floats(-15.0, 15.0), st.floats(0.85, 1.15), st.complex_numbers(max_magnitude=500.0))
def test_a_compass_error_slip_and_the_start_are_found(clockwise_deg: float, stretched: float, start_m: complex) -> None:
    true_m = stretched * cmath.exp(-1j * radians(clockwise_deg)) * LOOP_M + start_m
    found = fit(fixes(LOOP_M, true_m), ORIGIN)
    assert found is not None
    assert found.turned_deg == pytest.approx(clockwise_deg, abs=0.01)
    assert found.stretched == pytest.approx(stretched, abs=0.001)
    assert np.abs(found(LOOP_M) - true_m).max() < 0.02


def test_first_fix_is_one_of_many() -> None:
    true_m = noisy(LOOP_M + 100.0, 3.0)
    true_m[0] += 12.0  # metres: a receiver that just woke up
    found = fit(fixes(LOOP_M, true_m), ORIGIN)
    assert found is not None
    assert np.median(np.abs(found(LOOP_M) - (LOOP_M + 100.0))) < 1.0  # 3 m a fix, 200 fixes, 4 unknowns


def test_wild_fixes_do_not_count() -> None:
    true_m = noisy(LOOP_M, 1.0)
    true_m[::5] += 200.0
    found = fit(fixes(LOOP_M, true_m), ORIGIN)
    assert found is not None
    assert np.median(np.abs(found(LOOP_M) - LOOP_M)) < 1.0


def test_a_rover_that_hardly_moved_is_not_turned_by_noise() -> None:
    short_m = LOOP_M / 30.0
    found = fit(fixes(short_m, noisy(short_m + 50.0, 5.0)), ORIGIN)
    assert found is not None
    assert abs(found.turned_deg) < 10.0
    assert 0.8 < found.stretched < 1.2


def test_one_fix_moves_the_way_and_no_fix_leaves_it() -> None:
    found = fit(fixes(LOOP_M[:1], LOOP_M[:1] + 7.0), ORIGIN)
    assert found is not None
    assert found.factor == pytest.approx(1.0)
    assert found(LOOP_M[:1])[0] == pytest.approx(LOOP_M[0] + 7.0, abs=1e-3)
    assert fit([], ORIGIN) is None
    assert fit([ORIGIN._replace(north_m=nan)], ORIGIN) is None


def test_distance_from_the_true_way_is_small_only_where_all_fixes_count() -> None:
    told = fixes(LOOP_M, noisy(LOOP_M, 3.0))
    told[0] = told[0]._replace(latitude_deg=told[0].latitude_deg + 1e-4)  # 11 m
    times_s, unknown = np.array([fix.t_s for fix in told]), np.full(LOOP_M.size, nan)
    true = TimedPath(times_s, LOOP_M.real, LOOP_M.imag, unknown)
    track = Track(RunData(), true, origin=ORIGIN, fixes=told, fit=fit(told, ORIGIN))
    pinned_m, fitted_m = track.missed_m(true=True)
    assert pinned_m > 5.0
    assert fitted_m < 1.0
    assert track.missed_m()[1] > 2.0, "the fixes themselves are noisy"


def test_way_is_moved_to_where_it_shall_begin() -> None:
    way = TimedPath(*(np.array(column) for column in ([1.0, 2.0], [5.0, 6.0], [7.0, 9.0], [0.0, 0.0]))).beginning_at(
        1.0, -1.0
    )
    assert (way.east_m.tolist(), way.north_m.tolist()) == ([1.0, 2.0], [-1.0, 1.0])


def test_fix_in_another_country_is_left_out() -> None:
    near = fixes(LOOP_M, LOOP_M)
    assert believable([ORIGIN._replace(latitude_deg=0.0), *near]) == near
    assert believable([]) == []
