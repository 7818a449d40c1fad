"""Wall times as ISO 8601 in UTC, as GPX and GeoJSON readers take them. Pure."""

from __future__ import annotations

from wayfarer.fieldlog.fields import local_time


def utc_text(wall_s: float) -> str:
    """Return a time since 1970 with its milliseconds, as ``2026-11-22T06:14:05.250Z``; never one before 1970."""
    milliseconds = round(max(wall_s, 0.0) * 1e3)
    return f"{local_time(milliseconds // 1000, '%Y-%m-%dT%H:%M:%S', utc=True)}.{milliseconds % 1000:03}Z"
