"""External forces on the body during a fault: gravity on a slope, and a shove."""

from __future__ import annotations

from math import cos, radians, sin

from wayfarer.config.chassis import STANDARD_GRAVITY_M_S2

SHOVE_S = 0.1  # in which a shove brings the body to its speed
MOST_WEIGHTS = 2.0  # and with no more force than this many times its weight


def gravity_m_s2(pitch_deg: float, roll_deg: float, heading_rad: float) -> tuple[float, float, float]:
    """Return gravity east, north and up as it pulls on ground that slopes so under a body with this heading."""
    pitch_rad, roll_rad = radians(pitch_deg), radians(roll_deg)
    sin_h, cos_h = sin(heading_rad), cos(heading_rad)
    ahead_m_s2 = -STANDARD_GRAVITY_M_S2 * sin(pitch_rad)
    right_m_s2 = STANDARD_GRAVITY_M_S2 * cos(pitch_rad) * sin(roll_rad)
    down_m_s2 = STANDARD_GRAVITY_M_S2 * cos(pitch_rad) * cos(roll_rad)
    return ahead_m_s2 * sin_h + right_m_s2 * cos_h, ahead_m_s2 * cos_h - right_m_s2 * sin_h, -down_m_s2


def shove_n(weight_kg: float, wanted_m_s: float, speed_m_s: float) -> float:
    """Return the force ahead that brings a body from one speed to another."""
    most_n = MOST_WEIGHTS * weight_kg * STANDARD_GRAVITY_M_S2
    return max(-most_n, min(most_n, weight_kg * (wanted_m_s - speed_m_s) / SHOVE_S))
