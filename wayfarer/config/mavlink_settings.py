"""Settings of the link to a ground station: section ``mavlink`` of a rover file. ``views.mavlink`` reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

StreamHertz = Annotated[float, Interval(ge=0.1, le=20)]


@dataclass(frozen=True, slots=True)
class MavlinkSettings:
    """The link to a ground station, of ``wayfarer run --mavlink``: what the station gets, and who may stop the rover.

    No station can start its wheels.
    """

    system_id: Annotated[int, Interval(ge=1, le=255)] = 1
    """The rover's number among the vehicles of a station."""
    network_may_stop: bool = False
    """Let a station on another computer hold and disarm the rover, as one on the rover's own computer or on a serial
    line can. MAVLink has no password, so everybody in that network can then."""
    on_link_lost: Literal["continue", "hold"] = "continue"
    """Whether an armed rover goes on when the link is lost, or holds its wheels until somebody resumes."""
    link_lost_s: Annotated[float, Interval(ge=1, le=600)] = 5.0
    """The link is lost after this time without a heartbeat of a station (5 s, as ArduPilot's FS_GCS_TIMEOUT)."""
    bytes_per_s: Annotated[int, Interval(ge=500, le=1_000_000)] = 2880
    """All messages together take at most so many bytes per second: half of what a radio of 57,600 baud carries, with
    10 bits a byte."""
    attitude_hz: StreamHertz = 4.0
    """Rate of the attitude."""
    position_hz: StreamHertz = 2.0
    """Rate of position and speed."""
    values_hz: StreamHertz = 1.0
    """Rate of the named values: phase, counter and others."""
