"""Position fixes in metres beside dead reckoning."""

from __future__ import annotations

from math import cos, isnan, nan, radians

import pytest

from wayfarer.views.run_report.data import MapFix
from wayfarer.views.run_report.position import local_metres


def fix(
    latitude_deg: float, longitude_deg: float, north_m: float = 0.0, east_m: float = 0.0, error_m: float = nan
) -> MapFix:
    return MapFix(0.0, latitude_deg, longitude_deg, error_m, north_m, east_m)


@pytest.mark.parametrize("latitude_deg", [0.0, 47.0, -33.0, 69.0])
def test_fixes_are_metres_from_the_first(latitude_deg: float) -> None:
    """A degree of the WGS 84 ellipsoid has 110,574 to 111,694 m to the north: a plane is within 0.7 % of that."""
    first, north, east = local_metres(
        [fix(latitude_deg, 8.0), fix(latitude_deg + 0.001, 8.0), fix(latitude_deg, 8.001)]
    )
    assert (first.north_m, first.east_m) == (0.0, 0.0)
    assert (north.north_m, north.east_m) == pytest.approx((111.13, 0.0), rel=0.007)
    assert (east.north_m, east.east_m) == pytest.approx((0.0, 111.32 * cos(radians(latitude_deg))), rel=0.007)


def test_first_fix_lies_where_dead_reckoning_had_the_rover() -> None:
    first, second = local_metres([fix(47.0, 8.0, 10.0, -4.0), fix(47.0001, 8.0, 99.0, 99.0)])
    assert (first.north_m, first.east_m) == (10.0, -4.0)
    assert (second.north_m, second.east_m) == pytest.approx((21.132, -4.0))


def test_first_fix_before_any_heading_is_the_origin() -> None:
    (first,) = local_metres([fix(47.0, 8.0, nan, nan, 2.5)])
    assert first == (0.0, 0.0, 2.5)


def test_fixes_across_the_date_line_stay_together() -> None:
    east_m = [placed.east_m for placed in local_metres([fix(0.0, 179.9999), fix(0.0, -179.9999)])]
    assert east_m == pytest.approx([0.0, 22.264])


def test_a_fix_on_another_continent_is_left_out() -> None:
    placed = local_metres([fix(0.0, 0.0), *(fix(47.0 + step * 1e-5, 8.0) for step in range(5))])
    assert len(placed) == 5
    assert placed[0][:2] == (0.0, 0.0)
    assert all(isnan(each.error_m) for each in placed)


def test_without_fixes_there_is_nothing_to_draw() -> None:
    assert local_metres([]) == []
