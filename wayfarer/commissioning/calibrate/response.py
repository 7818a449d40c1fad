"""Response of the body to wheel duty, fitted to measurements. Pure.

*Turning.* Tyres of a skid-steered rover must slide sideways before it turns, so nothing turns up to some duty, its dead
zone. Beyond that the rate grows along a straight line (Mandow 2007, and the closed form in docs/physics.md).

*Gaining speed.* A body that gains speed evenly is behind one that had full speed at once by half the time it takes.
Sums of displacement tell that well where single readings are noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import linear_regression
from typing import NamedTuple

from wayfarer.clamp import clamp
from wayfarer.config.calibration_file import SLOPE_MIN, SpeedGain, TurnResponse

# A compass with a noise of 1 degree, read for 0.6 s at 20 Hz, gives a rate within 1.7 deg/s (one standard deviation).
TURNS_FROM_DEG_S = 8.0
POINTS_MIN = 3  # of a line: two would not show that it is one
UNSEEN_MAX = 0.05  # share of readings without quality: the way made during them is missing
LAST_S = 1.0  # of a drive ahead, at its final speed: a sensor with an error of 3 % a reading tells it within 1 %
MOVED_MIN_SHARE = 0.2  # of the speed it was told: less is a sensor that sees nothing, or a body that is held


class Sample(NamedTuple):
    """One tick: the heading gained (clockwise, through any number of turns) and the way made ahead since the start.

    ``seen`` is whether the motion sensor saw the ground.
    """

    t_s: float
    turned_deg: float
    ahead_m: float
    seen: bool


def rate_deg_s(samples: Sequence[Sample]) -> float:
    """Return the rate of turn, clockwise: the slope of the heading.

    A shift of the heading by the motors' own field, which comes and goes with their current, is not in it.
    """
    slope, _ = linear_regression([each.t_s for each in samples], [each.turned_deg for each in samples])
    return slope


def turn_response(points: Sequence[tuple[float, float]]) -> TurnResponse | None:
    """Return the line through the points (duty, rate in the wanted direction) at which the body turned, least squares.

    Points are in rising order of duty; those up to the last one at which it stood are left out. None where fewer than
    ``POINTS_MIN`` are left: the body cannot turn, or hardly.
    """
    stood_at_duty, turning = 0.0, list(points)
    for index, (duty, rate) in enumerate(points):
        if rate < TURNS_FROM_DEG_S:
            stood_at_duty, turning = duty, list(points[index + 1 :])
    if len(turning) < POINTS_MIN:
        return None
    duties, rates = [duty for duty, _ in turning], [rate for _, rate in turning]
    slope, at_zero = linear_regression(duties, rates)
    if not slope >= SLOPE_MIN:  # NaN as well
        return None
    from_duty = clamp(-at_zero / slope, 0.0, duties[0])
    return TurnResponse(stood_at_duty=stood_at_duty, from_duty=from_duty, deg_s_per_duty=slope)


def speed_gain(samples: Sequence[Sample], commanded_m_s: float) -> SpeedGain | None:
    """Return how a body gained speed from rest; None where the motion sensor hardly saw the ground, or hardly a move.

    Its first command was given a tick before the first sample. It may still gain speed at the end, if evenly.
    """
    if sum(not each.seen for each in samples) > UNSEEN_MAX * len(samples):
        return None
    end_s, _, ahead_m, _ = samples[-1]
    last = [each for each in samples if each.t_s >= end_s - LAST_S]
    speed_m_s, _ = linear_regression([each.t_s for each in last], [each.ahead_m for each in last])
    if speed_m_s < MOVED_MIN_SHARE * commanded_m_s:
        return None
    tick_s = samples[1].t_s - samples[0].t_s
    driven_s = end_s - samples[0].t_s + tick_s
    takes_s = max(2.0 * (driven_s - ahead_m / speed_m_s), tick_s)  # ticks tell no shorter time
    return SpeedGain(speed_m_s=speed_m_s, takes_s=takes_s, gain_m_s2=speed_m_s / takes_s)
