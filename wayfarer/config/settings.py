"""Sections of a rover file that no decision needs: ``chassis`` for the simulator, ``mavlink`` for a ground station."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from wayfarer.setting_ranges import PartMetres

Kilograms = Annotated[float, Interval(ge=0.1, le=500)]
NewtonMetres = Annotated[float, Interval(ge=0.01, le=200)]
StreamHertz = Annotated[float, Interval(ge=0.1, le=20)]

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True)
class Chassis:
    """Weight, motors and belly of a rover, for the simulator; None if its file does not say."""

    ground_clearance_m: PartMetres | None = None
    """Height of the belly: a branch that is no thicker passes under it. For ``--site``."""
    weight_kg: Kilograms | None = None
    """Mass of the rover with its batteries."""
    motors_n_m: NewtonMetres | None = None
    """Torque of all motors together."""
    wheel_radius_m: PartMetres | None = None
    """Radius of a wheel. For ``--ground`` and ``--physics mujoco``."""
    height_m: PartMetres | None = None
    """From the ground to the top of the body. For ``--ground`` and ``--physics mujoco``."""

    def missing(self, asked: Sequence[str]) -> tuple[str, ...]:
        """Return which of the keys that are asked for the file does not give."""
        return tuple(key for key in asked if getattr(self, key) is None)


CLIMBING_KEYS = ("ground_clearance_m", "weight_kg", "motors_n_m")  # what climbing a branch, as at a site, needs
WHEEL_KEYS = ("weight_kg", "motors_n_m", "wheel_radius_m", "height_m")  # what a simulated body with wheels needs


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
    10 bits per byte."""
    attitude_hz: StreamHertz = 4.0
    """Rate of the attitude."""
    position_hz: StreamHertz = 2.0
    """Rate of position and speed."""
    values_hz: StreamHertz = 1.0
    """Rate of the named values: phase, counter and others."""
