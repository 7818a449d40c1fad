"""A run on a map: GPX, checked against its schema and read back by another library."""

from __future__ import annotations

import io
from datetime import UTC, datetime, timedelta
from functools import cache
from itertools import pairwise
from math import atan2, cos, degrees, hypot, radians, sin
from pathlib import Path
from typing import Any

import gpxpy
import pytest
from gpxpy.gpx import GPX
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.logview.records import BEGAN_WALL_S, HEADER, Json, drive, event, noted, outcome, record, tick, write
from wayfarer.angles import METRES_PER_DEG
from wayfarer.errors import BadInput
from wayfarer.export import ExportFormat
from wayfarer.fieldlog.reader import Damage

BEGAN = datetime.fromtimestamp(BEGAN_WALL_S, UTC)


def fix(t_s: float, north_m: float = 0.0, longitude_deg: float = 8.0, error_m: float | None = 4.0) -> Json:
    place = {"latitude_deg": 47.0 + north_m / METRES_PER_DEG, "longitude_deg": longitude_deg}
    return record("position", t_s, **place, error_m=error_m)


# North at 0.5 m/s, with a fix every second up to 2 s, and events between the fixes and after them.
EVENTFUL = [
    HEADER,
    fix(0.0),
    *drive(0.0, 1.0),
    fix(1.0, 0.5),
    *drive(1.0, 1.4),
    noted(1.4, "hit <log> & stone"),
    *drive(1.4, 2.0),
    fix(2.0, 1.0),
    *drive(2.0, 3.2),
    *drive(3.2, 4.0, anomalies=["immobilised"]),
    event("health", 4.0, level="hold", cause="compass_stale"),
    event("health", 4.0, level="degrade", cause="battery_low"),
    tick(4.0, anomalies=["immobilised", "nose_up"], applied_left=0.0, applied_right=0.0),
    tick(5.0, north_m=2.0, applied_left=0.0, applied_right=0.0),
    outcome(5.0),
]


@cache
def schema() -> Any:
    import xmlschema  # half a second, which the workers without these tests do not need

    return xmlschema.XMLSchema(Path(__file__).with_name("gpx.xsd"))


def gpx(folder: Path, records: list[Json], origin: str | None = None) -> GPX:
    text = io.StringIO()
    (folder / "17" / "run.00001.jsonl").unlink(missing_ok=True)
    assert ExportFormat.gpx.write(write(folder / "17", records), text, origin) == Damage()
    schema().validate(text.getvalue())
    return gpxpy.parse(text.getvalue())


def test_gpx_has_the_fixes_with_their_times(tmp_path: Path) -> None:
    track = gpx(tmp_path, EVENTFUL).tracks[0]
    (segment,) = track.segments
    assert (track.name, str(track.type)) == ("17", "fixes")
    assert [(point.latitude, point.longitude) for point in segment.points] == [
        (round(47.0 + north_m / METRES_PER_DEG, 8), 8.0) for north_m in (0.0, 0.5, 1.0)
    ]
    assert [point.time for point in segment.points] == [BEGAN + timedelta(seconds=count) for count in range(3)]
    elapsed, error = segment.points[1].extensions
    assert (elapsed.text, error.text) == ("1.000", "4.00")


def test_gpx_has_what_happened_where_it_happened(tmp_path: Path) -> None:
    """The place is on the path: 0.5 m/s to the north, until the wheels are stopped."""
    waypoints = gpx(tmp_path, EVENTFUL).waypoints
    assert [(each.type, each.name) for each in waypoints] == [
        ("mark", "Mark: hit <log> & stone"),
        ("anomaly", "stalled"),
        ("hold", "hold: the compass is silent"),
        ("anomaly", "nose up"),
        ("end", "The run has ended: enough"),
    ]
    north_m = [(each.latitude - 47.0) * METRES_PER_DEG for each in waypoints]
    assert north_m == pytest.approx([0.7, 1.6, 2.0, 2.0, 2.0], abs=0.03)
    assert all(each.longitude == 8.0 for each in waypoints)
    mark = waypoints[0]
    assert mark.time == BEGAN + timedelta(seconds=1.4)
    assert [each.extensions[0].text for each in waypoints] == ["1.400", "3.200", "4.000", "4.000", "5.000"]
    assert {each.description for each in waypoints} == {"dead reckoning fitted to the fixes"}


def test_path_is_dead_reckoning_fitted_to_the_fixes(tmp_path: Path) -> None:
    """The compass is 10 degrees off: the rover drove to the north-east, and says that it drove north by east."""
    fixes, way = [], radians(45.0)
    for t_s in range(0, 240, 2):
        north_m, east_m = (0.5 * t_s * part for part in (cos(way), sin(way)))
        fixes.append(fix(float(t_s), north_m, 8.0 + east_m / METRES_PER_DEG / cos(radians(47.0)), error_m=1.0))
    driven = [each for t_s in range(0, 238, 2) for each in drive(float(t_s), t_s + 2.0, heading_deg=35.0)]
    records = [HEADER, *sorted((*fixes, *driven), key=lambda each: each["t_s"])]
    *_, path = gpx(tmp_path, records).tracks
    assert str(path.type) == "fitted"
    (segment,) = path.segments
    begin, end = segment.points[0], segment.points[-1]
    north_m = (end.latitude - begin.latitude) * METRES_PER_DEG
    east_m = (end.longitude - begin.longitude) * METRES_PER_DEG * cos(radians(47.0))
    assert degrees(atan2(east_m, north_m)) == pytest.approx(45.0, abs=1.0)
    assert hypot(north_m, east_m) == pytest.approx(0.5 * 238.0, rel=0.02)
    steps_m = [
        hypot(after.latitude - before.latitude, (after.longitude - before.longitude) * cos(radians(47.0)))
        * METRES_PER_DEG
        for before, after in pairwise(segment.points)
    ]
    assert all(0.15 < step_m < 0.3 for step_m in steps_m)


def test_path_begins_at_the_given_origin_where_there_is_no_receiver(tmp_path: Path) -> None:
    records = [HEADER, *drive(0.0, 4.0), noted(4.0, "here"), outcome(4.0)]
    told = gpx(tmp_path, records, origin="47.0,-8.0")
    (track,) = told.tracks
    assert (str(track.type), track.name) == ("reckoned", "17: dead reckoning from the given origin")
    (segment,) = track.segments
    assert (segment.points[0].latitude, segment.points[0].longitude) == pytest.approx((47.0, -8.0), abs=1e-6)
    assert (segment.points[-1].latitude - 47.0) * METRES_PER_DEG == pytest.approx(2.0, abs=0.25)
    mark, _ = told.waypoints
    assert (mark.latitude - 47.0) * METRES_PER_DEG == pytest.approx(2.0, abs=0.1)
    assert mark.description == "dead reckoning from the given origin"


@pytest.mark.parametrize(
    ("form", "origin", "records", "refusal"),
    [
        (ExportFormat.gpx, "47,8", EVENTFUL, "has GPS positions, which say where it was: leave --origin out"),
        (ExportFormat.gpx, "47", EVENTFUL, "--origin 47: give latitude and longitude in degrees"),
        (ExportFormat.gpx, "8,190", EVENTFUL, "--origin 8,190: give latitude"),
        (ExportFormat.gpx, "nan,8", EVENTFUL, "--origin nan,8: give latitude"),
        (ExportFormat.gpx, "47,8", [HEADER, noted(1.0, "x")], "has no heading, so no path leads away"),
        (ExportFormat.csv, "47,8", EVENTFUL, "--origin is for gpx, and this is csv"),
    ],
)
def test_origin_that_is_of_no_use_is_refused(
    tmp_path: Path, form: ExportFormat, origin: str, records: list[Json], refusal: str
) -> None:
    with pytest.raises(BadInput, match=rf"^[^\n]*{refusal}[^\n]*$"):
        form.write(write(tmp_path / "17", records), io.StringIO(), origin)


def test_track_is_cut_where_fixes_are_missing(tmp_path: Path) -> None:
    records = [HEADER, *(fix(t_s) for t_s in (0.0, 10.0, 20.1, 21.0, 60.0))]
    assert [len(segment.points) for segment in gpx(tmp_path, records).tracks[0].segments] == [2, 2, 1]


def test_track_is_cut_at_the_date_line(tmp_path: Path) -> None:
    records = [HEADER, *(fix(t_s, 0.0, degrees) for t_s, degrees in enumerate([179.9998, 179.9999, 180.0, -179.9999]))]
    segments = gpx(tmp_path, records).tracks[0].segments
    assert [[point.longitude for point in each.points] for each in segments] == [
        [179.9998, 179.9999], [-180.0, -179.9999],
    ]  # fmt: skip


def test_without_any_path_what_happened_is_at_the_nearest_fix(tmp_path: Path) -> None:
    (mark,) = gpx(tmp_path, [HEADER, fix(0.0), fix(1.0, 5.0), fix(2.0), noted(1.2, "here")]).waypoints
    assert (mark.latitude - 47.0) * METRES_PER_DEG == pytest.approx(5.0, abs=1e-3)
    assert mark.description == "the fix at 0:00:01.00 (error 4.0 m)"


def test_receiver_that_tells_no_error_has_none(tmp_path: Path) -> None:
    records = [HEADER, fix(0.0, error_m=None), fix(1.0, error_m=None), noted(1.0, "here")]
    told = gpx(tmp_path, records)
    assert [len(point.extensions) for point in told.tracks[0].segments[0].points] == [1, 1]
    assert told.waypoints[0].description == "the fix at 0:00:01.00"


def test_run_without_a_position_is_refused_with_the_reason(tmp_path: Path) -> None:
    run = write(
        tmp_path / "17", [HEADER, *drive(0.0, 1.0), record("position", 1.0, latitude_deg=None, longitude_deg=1.0)]
    )
    with pytest.raises(
        BadInput, match=r"^[^\n]*no GPS position, so there is no gpx: dead[^\n]*--origin LAT,LON[^\n]*$"
    ):
        ExportFormat.gpx.write(run, io.StringIO())


NAMES = st.text(max_size=8)
LIKELY = st.one_of(
    st.builds(
        lambda latitude_deg, longitude_deg, error_m: record(
            "position", 0.0, latitude_deg=latitude_deg, longitude_deg=longitude_deg, error_m=error_m
        ),
        st.floats(-90.0, 90.0),
        st.floats(-180.0, 180.0),
        st.none() | st.floats(0.0, 1e8),
    ),
    st.builds(lambda text: noted(0.0, text), NAMES),
    st.builds(lambda found: tick(0.0, anomalies=[found]), NAMES),
    st.builds(lambda moved, degrees: tick(0.0, heading_deg=degrees, applied_left=moved), st.floats(-1.0, 1.0),
              st.floats(-360.0, 360.0)),
)  # fmt: skip


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(said=st.lists(LIKELY, max_size=8), speed_m_s=st.floats(0.0, 1e9))
def test_whatever_a_log_says_the_file_is_valid(tmp_path: Path, said: list[Json], speed_m_s: float) -> None:
    header = HEADER | {"config": {"vehicle": {"max_speed_m_s": speed_m_s}}}
    records = [header, fix(0.0), *(each | {"t_s": 100.0 + 0.5 * count} for count, each in enumerate(said))]
    assert len(gpx(tmp_path, records).waypoints) <= len(said)
