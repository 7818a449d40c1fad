"""Calibration of turning on the ground under the rover: dead zone, turn rate, arc, time to cruising speed.

On the spot the duty is raised in steps up to the highest that the rover file allows, once clockwise and once the other
way. Arcs at cruising speed are driven ahead and back again, each with a larger difference between the sides, and so is
a straight line, so that the rover needs little room. It is the person's to choose the ground: numbers of a smooth floor
are of no use in a forest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, degrees
from statistics import fmean

from wayfarer.commissioning.calibrate.free_ground import (
    REST_S,
    TURNS_FROM_DEG_S,
    FreeGround,
    rate_deg_s,
    speed_gain,
    turn_response,
)
from wayfarer.commissioning.checks.api import StandaloneInspection
from wayfarer.commissioning.checks.calibrated import EASE_TURNING
from wayfarer.commissioning.manual_drive import Operator
from wayfarer.config.calibration_file import GROUND_MAX, Calibration, SpeedGain, TurningEntry, TurnResponse, load, stamp
from wayfarer.config.factory import calibrated
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import WayfarerError
from wayfarer.hal import WheelCommand

STEPS = 20  # of the duty on the spot
ARCS = 8
SETTLES_S, WATCHED_S = 0.3, 0.6  # of each step: motors and body follow, then the rate is taken
ARC_SETTLES_S = 0.6  # from rest
AHEAD_S = 3.0  # a body with a gain of 0.5 m/s2, on the most slippery ground, takes 2 s to 1 m/s
SPARE_M = 0.5
# Sides of a rover differ by some per cent; beyond this something drags. From no source.
UNEVEN_DUTY, UNEVEN_SHARE = 0.1, 0.2
ON_FREE_GROUND = (
    "The rover is going to turn on the spot both ways, up to its highest duty, and to drive forwards and backwards, for"
    " about {minutes:.1f} minutes. Does it stand on free, level ground of the kind that it will drive on, with"
    " nothing and nobody within {room_m:g} m of it? (Ctrl-C stops it at once)"
)


async def calibrate_turning(inspection: StandaloneInspection, operator: Operator) -> TurningEntry | None:
    """Measure an open rover's turn response and gain of speed; None where the person declines.

    Args:
        inspection: the rover, compass and motors open; the scale of its motion sensor is in its calibration file.
        operator: agrees before a wheel turns, and names the ground.

    Raises:
        DriverError: a part stopped answering; the wheels were stopped.
        WayfarerError: the motors may not drive it on the ground, it tilted, or turned the other way; the wheels
            were stopped.
    """
    config = inspection.config
    motion, flow = inspection.rover.motion, load(inspection.host.calibration_file).flow
    ground = FreeGround(inspection, flow.scale if flow and motion and flow.part == motion.name else 1.0)
    await ground.refuse_unsafe()
    drives_s = 2 * STEPS * (SETTLES_S + WATCHED_S) + 2 * ARCS * (ARC_SETTLES_S + WATCHED_S + REST_S) + 2 * AHEAD_S
    room_m = ceil(2.0 * (config.escape.cruise_m_s * AHEAD_S + config.vehicle.length_m + SPARE_M)) / 2.0
    if not await operator.ask(ON_FREE_GROUND.format(minutes=drives_s / 60.0, room_m=room_m)):
        return None
    noted = (await operator.note("What ground is it, in a few words?")).strip()[:GROUND_MAX]
    entry = TurningEntry(
        **stamp(inspection.rover.motors.name, inspection.host.t_wall),
        ground=noted,
        duty_max=config.safety.duty_max,
        clockwise=await _on_the_spot(ground, config.safety.duty_max, 1.0),
        anticlockwise=await _on_the_spot(ground, config.safety.duty_max, -1.0),
        arc=await _arcs(ground, config),
        speed=await _ahead(ground, config) if motion is not None else None,
    )
    for line in table(entry, config):
        await operator.say(line)
    return entry


async def _on_the_spot(ground: FreeGround, duty_max: float, way: float) -> TurnResponse | None:
    """Return how the body turns on the spot; ``way`` is 1 for clockwise and -1 for the other way."""
    points = []
    async with ground.drives():
        for duty in _steps(STEPS, duty_max):
            wanted = WheelCommand(way * duty, -way * duty)
            await ground.drive(wanted, SETTLES_S)
            points.append((duty, way * rate_deg_s(await ground.drive(wanted, WATCHED_S))))
            if points[-1][1] < -TURNS_FROM_DEG_S:
                raise WayfarerError(
                    "stopped: the rover turns opposite to its command; a side is reversed, or left and right are"
                    " swapped: put it on blocks; wayfarer check finds which setting to change"
                )
    return turn_response(points)


async def _arcs(ground: FreeGround, config: RoverConfig) -> TurnResponse | None:
    """Return how the body turns while it cruises: ahead it curves clockwise, and back on the same arc.

    None as well where it cruises at its highest duty, which leaves no difference.
    """
    cruise, most, points = cruise_duty(config), arc_duty_max(config), []
    for half_difference in _steps(ARCS, most) if most > 0.0 else ():
        rates_deg_s = []
        for way in (1.0, -1.0):
            wanted = WheelCommand(way * (cruise + half_difference), way * (cruise - half_difference))
            async with ground.drives():
                await ground.drive(wanted, ARC_SETTLES_S)
                rates_deg_s.append(way * rate_deg_s(await ground.drive(wanted, WATCHED_S)))
        points.append((half_difference, fmean(rates_deg_s)))
    return turn_response(points)


async def _ahead(ground: FreeGround, config: RoverConfig) -> SpeedGain | None:
    """Return how the body gains speed up to cruising, and drive it back; None where the ground was not seen well."""
    cruise = cruise_duty(config)
    async with ground.drives():
        samples = await ground.drive(WheelCommand(cruise, cruise), AHEAD_S)
    async with ground.drives():
        await ground.drive(WheelCommand(-cruise, -cruise), AHEAD_S)
    return speed_gain(samples, cruise * config.vehicle.max_speed_m_s)


def _steps(count: int, most: float) -> Sequence[float]:
    return [most * step / count for step in range(1, count + 1)]


# -- table and advice --------------------------------------------------------------------------------------------------


def table(entry: TurningEntry, config: RoverConfig) -> Iterator[str]:
    """Give the lines of a small table of results, and advice where something is wrong."""
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
