"""Settings of the link to a ground station: section ``mavlink`` of a rover file. ``views.mavlink`` reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, MaxLen

StreamHertz = Annotated[float, Interval(ge=0.1, le=20)]


@dataclass(frozen=True, slots=True)
class MavlinkSettings:
    """What a ground station gets, and what it may do.

    ``system_id`` is the rover's number among the vehicles of a station. ``key_file`` is a file with the passphrase that
    signs (16 characters or more, only for its owner to read, mode 0600); empty: none. Without it no other computer can
    command the rover, and none can start its wheels. ``may_arm`` lets a station arm the rover; it needs the key.
    A link is lost without a heartbeat of a station for ``link_lost_s`` (5 s, as ArduPilot's FS_GCS_TIMEOUT);
    ``on_link_lost`` says whether an armed rover then goes on or holds its wheels until somebody resumes. All messages
    together take at most ``bytes_per_s``: half of what a radio of 57,600 baud carries, which has 10 bits a byte.
    ``attitude_hz``, ``position_hz`` and ``values_hz`` are the rates of attitude, of position and speed, and of the
    named values.
    """

    system_id: Annotated[int, Interval(ge=1, le=255)] = 1
    key_file: Annotated[str, MaxLen(255)] = ""
    may_arm: bool = False
    on_link_lost: Literal["continue", "hold"] = "continue"
    link_lost_s: Annotated[float, Interval(ge=1, le=600)] = 5.0
    bytes_per_s: Annotated[int, Interval(ge=500, le=1_000_000)] = 2880
    attitude_hz: StreamHertz = 4.0
    position_hz: StreamHertz = 2.0
    values_hz: StreamHertz = 1.0

    def __post_init__(self) -> None:
        if self.may_arm and not self.key_file:
            raise ValueError("may_arm = true needs key_file: a rover is armed by signed messages only")
