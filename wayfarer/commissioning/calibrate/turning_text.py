"""Texts of the turning calibration: a small table of results, and advice where something is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees

from wayfarer.commissioning.checks.calibrated import EASE_TURNING
from wayfarer.config.calibration_file import Calibration, TurningEntry, TurnResponse
from wayfarer.config.factory import calibrated
from wayfarer.config.rover_file import RoverConfig

# Sides of a rover differ by some per cent; beyond this something drags. From no source.
UNEVEN_DUTY, UNEVEN_SHARE = 0.1, 0.2


def table(entry: TurningEntry, config: RoverConfig) -> Iterator[str]:
    """Give the lines."""
    cruise_m_s = config.escape.cruise_m_s
    where = f"On {entry.ground}" if entry.ground else ""
    yield f"{where:<26}{'stood at':>10}{'turns from':>12}{'at duty':>9}{'deg/s':>8}"
    rows = {
        "on the spot, clockwise": (entry.clockwise, entry.duty_max),
        "on the spot, anticlockwise": (entry.anticlockwise, entry.duty_max),
        f"in an arc at {cruise_m_s:g} m/s": (entry.arc, arc_duty_max(config)),
    }
    for name, (response, duty) in rows.items():
        yield f"{name:<26}{_row(response, duty)}"
    yield "Turn duty: half the difference of the two sides. It turns from where the line through its rates begins."
    if entry.speed is not None:
        speed = entry.speed
        yield f"Ahead it gains {speed.speed_m_s:.2f} m/s in {speed.takes_s:.2f} s: {speed.gain_m_s2:.2f} m/s2."
    else:
        yield "Gaining speed was not measured: the motion sensor is not there, or it hardly saw the rover move."
    yield from _advice(entry, config)


def _row(response: TurnResponse | None, duty: float) -> str:
    if response is None:
        return f"{'does not':>22}{duty:>9.2f}"
    rate_deg_s = max(0.0, duty - response.from_duty) * response.deg_s_per_duty
    return f"{response.stood_at_duty:>10.2f}{response.from_duty:>12.2f}{duty:>9.2f}{rate_deg_s:>8.0f}"


def _advice(entry: TurningEntry, config: RoverConfig) -> Iterator[str]:
    one, other = entry.clockwise, entry.anticlockwise
    if one is None or other is None:
        which = "either way" if one is other else "clockwise" if one is None else "anticlockwise"
        yield f"It hardly turns on the spot {which}, or not at all: {EASE_TURNING}."
        return
    if _uneven(one, other):
        yield "It turns less easily in one direction: look for a gear that drags, a soft tyre, or weight on one side."
    escape = config.escape
    if entry.arc is None:
        yield f"It hardly turns in an arc at {escape.cruise_m_s:g} m/s: lower [escape] cruise_m_s, or {EASE_TURNING}."
    else:
        turn_deg_s = degrees(escape.cruise_m_s / escape.probe_radius_m)
        duty = entry.arc.from_duty + turn_deg_s / entry.arc.deg_s_per_duty
        yield f"A probe's curve (radius {escape.probe_radius_m:g} m) needs a turn duty of {duty:.2f}."
    vehicle = calibrated(config, Calibration(turning=entry)).vehicle
    yield (
        f"From its next start wayfarer run takes vehicle.track_m = {vehicle.track_m:.2f} and"
        f" turn_from_duty = {vehicle.turn_from_duty:.2f} in place of the rover file's."
    )


def cruise_duty(config: RoverConfig) -> float:
    """Return the duty of both sides at cruising speed, as far as the rover file allows it."""
    return min(config.vehicle.mix(config.escape.cruise_m_s, 0.0).left, config.safety.duty_max)


def arc_duty_max(config: RoverConfig) -> float:
    """Return half the largest difference in duty that leaves the mean of both sides at that of cruising."""
    return config.safety.duty_max - cruise_duty(config)


def _uneven(one: TurnResponse, other: TurnResponse) -> bool:
    """Return whether a body turns clearly better one way than the other."""
    slope = max(one.deg_s_per_duty, other.deg_s_per_duty)
    return (
        abs(one.from_duty - other.from_duty) > UNEVEN_DUTY
        or abs(one.deg_s_per_duty - other.deg_s_per_duty) > UNEVEN_SHARE * slope
    )
