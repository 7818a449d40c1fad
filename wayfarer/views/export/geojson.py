"""A run as GeoJSON (RFC 7946): lines of what the receiver said and of the path, points where something happened.

``kind`` of a line is ``track`` (fixes), ``fitted`` (dead reckoning fitted to them) or ``reckoned`` (from an origin).

Times, errors and ``elapsed_s`` of the positions of a line stand in its ``coordinateProperties``, as converters from GPX
write them. A fix with none within ten seconds is a point. geojson-pydantic is imported here only, and only where a file
is written.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from geojson_pydantic import Feature, FeatureCollection, LineString, Point
from geojson_pydantic.types import Position, Position2D

from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.typed import Fix
from wayfarer.views.export.gps_places import Waypoint, read_places
from wayfarer.views.export.placed_path import Origin, PathPoint
from wayfarer.views.export.wall_time import utc_time

AnyFeature = Feature[LineString | Point, dict[str, Any]]


class RunCollection(FeatureCollection[AnyFeature]):
    """The features of a run, with the name of its folder and what ran."""

    run: str
    about: str


def write_geojson(run: Path, file: TextIO, origin: Origin | None = None) -> Damage:
    """Write a run as GeoJSON, and return what could not be read; ``origin`` is where one without a receiver began.

    Raises:
        BadInput: the run cannot be read, or has neither positions nor an origin.
    """
    places = read_places(run, "geojson", origin)
    features = [_track(segment, places.zero_s) for segment in places.segments]
    kind = "fitted" if places.segments else "reckoned"
    features += [_path(points, kind, places.zero_s) for points in places.path]
    features += [_event(waypoint, places.zero_s) for waypoint in places.waypoints]
    document = RunCollection(type="FeatureCollection", run=places.title, about=places.about, features=features)
    json.dump(document.model_dump(mode="json"), file, allow_nan=False)
    file.write("\n")
    return places.damage


def _track(segment: Sequence[Fix], zero_s: float) -> AnyFeature:
    """Return a piece of the track; a line has two positions or more."""
    times = [utc_time(zero_s + fix.t_s) for fix in segment]
    positions: list[Position] = [Position2D(fix.longitude_deg, fix.latitude_deg) for fix in segment]
    if len(segment) == 1:
        (fix,) = segment
        properties = {"kind": "fix", "time": times[0], "elapsed_s": fix.elapsed_s, "error_m": fix.error_m}
        return _feature(Point(type="Point", coordinates=positions[0]), properties)
    along = {
        "times": times,
        "elapsed_s": [fix.elapsed_s for fix in segment],
        "error_m": [fix.error_m for fix in segment],
    }
    line = LineString(type="LineString", coordinates=positions)
    return _feature(line, {"kind": "track", "coordinateProperties": along})


def _path(points: Sequence[PathPoint], kind: str, zero_s: float) -> AnyFeature:
    positions: list[Position] = [Position2D(each.longitude_deg, each.latitude_deg) for each in points]
    along = {
        "times": [utc_time(zero_s + each.t_s) for each in points],
        "elapsed_s": [each.elapsed_s for each in points],
    }
    line = LineString(type="LineString", coordinates=positions)
    return _feature(line, {"kind": kind, "coordinateProperties": along})


def _event(waypoint: Waypoint, zero_s: float) -> AnyFeature:
    event = waypoint.placed_event
    properties = {
        "kind": event.kind,
        "name": event.text,
        "time": utc_time(zero_s + event.t_s),
        "elapsed_s": event.elapsed_s,
        "placed": waypoint.placed,
    }
    position = Position2D(waypoint.longitude_deg, waypoint.latitude_deg)
    return _feature(Point(type="Point", coordinates=position), properties)


def _feature(geometry: LineString | Point, properties: dict[str, Any]) -> AnyFeature:
    return AnyFeature(type="Feature", geometry=geometry, properties=properties)
