"""Steady motion of a skid-steered body: the balance of tyre forces, motor forces and those of a curve.

Each of the four wheels carries a quarter of the weight and slides at its foot point: along by how much its rim is
faster than the ground, sideways because it does not steer. Coulomb friction opposes that (Pentzer 2014, wheels that
stand on points). The motors give what their torque-speed line leaves. Forces along and across the body and the moment
about it then have to balance; a body that goes round needs force towards the inside, so it slides outwards, which
loosens the grip that keeps it from turning.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayfarer.config.chassis import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.world.wheeled_body import ROLLING_RESISTANCE, WheeledBody

Array = NDArray[np.float64]

# Friction is taken as viscous with the slip of the last round, which converges. After so many rounds speeds and rates
# are within 0.03 of full duty of those after 1,000, but for the fastest curves on mud, where they are within 0.08.
# Below ``CREEP_M_S`` a tyre counts as holding.
ROUNDS, SHARE_KEPT = 60, 0.5
CREEP_M_S = 0.001


def balance(body: WheeledBody, friction: float, left: Array, right: Array) -> tuple[Array, Array]:
    """Return the steady speed, m/s, and turn rate, rad/s clockwise, for pairs of duties of the sides."""
    a_m, b_m, radius_m = body.wheels
    weight_n = body.weight_kg * STANDARD_GRAVITY_M_S2
    stall_n, resistance_n = body.motors_n_m / radius_m / 2.0, ROLLING_RESISTANCE * weight_n / 2.0  # of a side
    per_m_s = stall_n / body.free_speed_m_s
    reach_m = np.array([b_m, -b_m])[:, None]  # of the left and the right side, and so are all pairs below
    pushed_n = stall_n * np.stack([left, right])
    # Speed ahead, to the right, and turn rate; the rims begin with some slip.
    state = np.stack([left + right, 0.0 * left, (left - right) / (2.0 * b_m)]) * (body.free_speed_m_s / 2.0)
    slip_m_s = 0.1 * np.sign(np.stack([left - right, right - left]))
    for _ in range(ROUNDS):
        ahead_m_s, aside_m_s, turn_rad_s = state
        side_m_s = ahead_m_s + reach_m * turn_rad_s
        front, rear = (
            friction * weight_n / 4.0 / np.sqrt(slip_m_s**2 + (aside_m_s + at_m * turn_rad_s) ** 2 + CREEP_M_S**2)
            for at_m in (a_m, -a_m)
        )
        grip = front + rear  # newtons for each m/s of slip
        drive_n = pushed_n - np.clip(pushed_n + grip * side_m_s, -resistance_n, resistance_n)
        # What reaches the ground of a side is ``steady_n - drag * speed of the side``.
        share = grip / (per_m_s + grip)
        steady_n, drag = share * drive_n, share * per_m_s
        across, lever = front.sum(0) + rear.sum(0), a_m * (front.sum(0) - rear.sum(0))
        skew, curve = b_m * (drag[0] - drag[1]), body.weight_kg * turn_rad_s
        moment = b_m**2 * drag.sum(0) + a_m**2 * across
        rows = [[drag.sum(0), -curve, skew], [curve, across, lever], [skew, lever, moment]]
        forces = [steady_n.sum(0), 0.0 * across, b_m * (steady_n[0] - steady_n[1])]
        found = np.linalg.solve(np.moveaxis(np.array(rows), (0, 1), (-2, -1)), np.stack(forces, -1)[..., None])
        state = SHARE_KEPT * state + (1.0 - SHARE_KEPT) * np.moveaxis(found[..., 0], -1, 0)
        side_m_s = state[0] + reach_m * state[2]
        rim_m_s = (drive_n + grip * side_m_s) / (per_m_s + grip)
        slip_m_s = SHARE_KEPT * slip_m_s + (1.0 - SHARE_KEPT) * (rim_m_s - side_m_s)
    return state[0], state[2]
