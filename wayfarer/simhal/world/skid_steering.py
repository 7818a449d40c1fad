"""Skid steering on ground of a given friction, for physics-light with ``--ground``; fast.

*Steady* driving has a closed form as long as curves are slow. A body that turns slides on all wheels; at any
speed and turn rate, the moment of friction then takes the same force of each side, ``mu W a / (2 sqrt(a2 + b2))`` with
a and b half the distances between axles and between sides. A difference of duties below that turns nothing, on the spot
as in an arc: the weaker side is dragged along. Beyond it rims turn at what is left, and slip by a2 / b times the turn
rate. What fast curves change is worked out once (``balance``) and kept as a table of factors.

*Gaining speed* takes the time constant of motors and masses, and no side pushes with more than its wheels' friction.

*On a slope* gravity along the body takes of each side what that share of the weight takes, or drives it. The grip is
that of level ground (cos 15 degrees is 0.97), and the body does not slide sideways.
"""

from __future__ import annotations

from functools import lru_cache
from math import copysign, exp, hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.world.wheeled_body import ROLLING_RESISTANCE, WheeledBody

Array = NDArray[np.float64]

# Friction is taken as viscous with the slip of the last round, which converges. After so many rounds speeds and rates
# are within 0.03 of full duty of those after 1,000, but for the fastest curves on mud, where they are within 0.08.
# Below ``CREEP_M_S`` a tyre counts as holding.
ROUNDS, SHARE_KEPT = 60, 0.5
CREEP_M_S = 0.001
CELLS = 10  # of the table, along mean and half difference of the duties, each from 0 to 1
SLOWEST_DUTY = 1e-3  # mean duty at which the factors of turning on the spot are taken
SLOWEST_RAD_S = 0.2  # a slower turn is as the closed form says

# Of a cell of the table, for speed and for turn rate: the value at its first corner, the slopes along both axes, and
# their twist.
Cell = tuple[float, float, float, float, float, float, float, float]
Factors = tuple[tuple[Cell, ...], ...]


class SlowCurves(NamedTuple):
    """The closed form, as speeds of rims: without load, and what the weight, drag and rolling resistance take.

    ``weight_m_s`` is taken by a force of the weight along the body, ``drag_m_s`` by friction sideways.
    """

    free_m_s: float
    weight_m_s: float
    drag_m_s: float
    resistance_m_s: float

    @classmethod
    def of(cls, body: WheeledBody, friction: float) -> SlowCurves:
        """Return that of a body on ground of this friction."""
        a_m, b_m, radius_m = body.wheels
        stall_n = body.motors_n_m / radius_m
        taken_m_s = body.free_speed_m_s * body.weight_kg * STANDARD_GRAVITY_M_S2 / stall_n  # by a force of the weight
        drag_m_s = friction * a_m / hypot(a_m, b_m) * taken_m_s
        return cls(body.free_speed_m_s, taken_m_s, drag_m_s, ROLLING_RESISTANCE * taken_m_s)

    def steady(self, mean_m_s: float, half_m_s: float) -> tuple[float, float]:
        """Return mean and half difference of the sides' rims under load, from those without; neither is negative."""
        faster_m_s = self.loaded(mean_m_s + half_m_s - self.drag_m_s)
        slower_m_s = self.loaded(mean_m_s - half_m_s + self.drag_m_s)
        if half_m_s <= self.drag_m_s or faster_m_s <= slower_m_s:
            return self.loaded(mean_m_s), 0.0
        return (faster_m_s + slower_m_s) / 2.0, (faster_m_s - slower_m_s) / 2.0

    def loaded(self, rim_m_s: float) -> float:
        """Return what rolling resistance leaves of the speed of a rim."""
        return copysign(max(abs(rim_m_s) - self.resistance_m_s, 0.0), rim_m_s)


class SkidSteering:
    """The motion of a body on even ground.

    Speeds of a side are those that would move a body of this effective track so if its wheels did not slip: half their
    sum is the speed, their difference over ``track_m`` the turn rate clockwise.

    Args:
        body: the rover.
        friction: of tyre on ground.
        track_m: the effective track.
        step_s: of the world.
    """

    def __init__(self, body: WheeledBody, friction: float, track_m: float, step_s: float) -> None:
        a_m, b_m, radius_m = body.wheels
        across_m2 = a_m * a_m + b_m * b_m
        grip_m_s2 = friction * STANDARD_GRAVITY_M_S2
        self.friction = friction
        self._slow = slow = SlowCurves.of(body, friction)
        self._factors = curve_factors(body, friction)
        self._cells_per_m_s = CELLS / slow.free_m_s
        self._turned_share = track_m / 2.0 * b_m / across_m2  # of half the difference of the rims' speeds
        self._drag_m_s, self._resistance_m_s = slow.drag_m_s * self._turned_share, slow.resistance_m_s
        self._sharpest_m2_s2 = grip_m_s2 * track_m / 2.0
        # In a step: the share of the distance that is covered, and what a side gains at most: each has half the load.
        s_per_kg = slow.free_m_s / (body.motors_n_m / radius_m)
        self._ahead_lag = 1.0 - exp(-step_s / (s_per_kg * (body.weight_kg + body.rims_kg)))
        self._turn_lag = 1.0 - exp(-step_s / (s_per_kg * (body.yaw_inertia_kg_m2 / across_m2 + body.rims_kg)))
        self._most_m_s = grip_m_s2 * step_s
        self._falls_m_s = STANDARD_GRAVITY_M_S2 * step_s  # what free fall gains in a step
        # Forces of the sides that differ by so much turn the body as fast as the same forces together move it ahead.
        self._ahead_per_turn = body.yaw_inertia_kg_m2 / (body.weight_kg * b_m * track_m / 2.0)
        self._rise = 0.0
        self._rims_m_s: tuple[float, float] | None = None
        self.drive(0.0, 0.0)

    def drive(self, left_m_s: float, right_m_s: float) -> None:
        """Push on so that without load the rims of the sides would come to these speeds."""
        if (left_m_s, right_m_s) == self._rims_m_s:
            return
        self._rims_m_s = left_m_s, right_m_s
        mean_m_s, half_m_s = (left_m_s + right_m_s) / 2.0, (left_m_s - right_m_s) / 2.0
        ahead_m_s, rims_m_s = self._slow.steady(abs(mean_m_s), abs(half_m_s))
        turn_m_s = rims_m_s * self._turned_share
        if turn_m_s:
            of_ahead, of_turn = self._factors_at(abs(mean_m_s), abs(half_m_s))
            ahead_m_s *= of_ahead
            turn_m_s *= of_turn
            if ahead_m_s * turn_m_s > self._sharpest_m2_s2:
                turn_m_s = self._sharpest_m2_s2 / ahead_m_s  # no ground pushes a body round faster
        # What half the sum and half the difference of the sides come to, and would if friction took nothing.
        self._ahead_m_s, self._turn_m_s = copysign(ahead_m_s, mean_m_s), copysign(turn_m_s, half_m_s)
        self._coasts_ahead_m_s, self._coasts_turning_m_s = mean_m_s, half_m_s * self._turned_share

    def rims_m_s(self, left_m_s: float, right_m_s: float) -> tuple[float, float]:
        """Return how fast the rims turn of sides of these speeds; in a turn they are faster than the ground."""
        ahead_m_s, rims_m_s = (left_m_s + right_m_s) / 2.0, (left_m_s - right_m_s) / 2.0 / self._turned_share
        return ahead_m_s + rims_m_s, ahead_m_s - rims_m_s

    def _factors_at(self, mean_m_s: float, half_m_s: float) -> tuple[float, float]:
        """Return the factors of speed and turn rate, between the points of the table."""
        x, y = mean_m_s * self._cells_per_m_s, half_m_s * self._cells_per_m_s
        row, column = min(int(x), CELLS - 1), min(int(y), CELLS - 1)
        x, y = x - row, y - column
        a, b, c, d, e, f, g, h = self._factors[row][column]
        return a + b * x + (c + d * x) * y, e + f * x + (g + h * x) * y

    def lean(self, rise: float) -> None:
        """Let gravity pull backwards with this share of the weight, negative ahead, from the next step on."""
        self._rise = rise

    def _aims_on_a_slope(self) -> tuple[float, float]:
        """Return what half the sum of the sides comes to, and would without friction.

        A side that turns against the other slides already, so rolling resistance has the same direction as on level
        ground.
        """
        pulled_m_s = self._rise * self._slow.weight_m_s
        coasts_m_s = self._coasts_ahead_m_s - pulled_m_s
        aim_m_s = self._ahead_m_s - pulled_m_s if self._turn_m_s else self._slow.loaded(coasts_m_s)
        return aim_m_s, coasts_m_s

    def step(self, left_m_s: float, right_m_s: float) -> tuple[float, float]:
        """Return the speeds of the sides a step later; friction helps to end a motion, but begins none."""
        most_m_s = self._most_m_s
        ahead_m_s = now_m_s = (left_m_s + right_m_s) / 2.0
        aim_m_s, coasts_m_s, fallen_m_s = self._ahead_m_s, self._coasts_ahead_m_s, 0.0
        if self._rise:
            aim_m_s, coasts_m_s = self._aims_on_a_slope()
            fallen_m_s = self._rise * self._falls_m_s
        if now_m_s * aim_m_s <= 0.0 and now_m_s:
            aim_m_s = coasts_m_s - copysign(self._resistance_m_s, now_m_s)
        gain_m_s = (aim_m_s - now_m_s) * self._ahead_lag + fallen_m_s  # by the wheels' push: that of gravity comes off
        turn_m_s, aim_m_s = (left_m_s - right_m_s) / 2.0, self._turn_m_s
        if turn_m_s or aim_m_s:
            gain_m_s, turn_m_s = self._turned(gain_m_s, turn_m_s, aim_m_s)
        elif abs(gain_m_s) > most_m_s:
            gain_m_s = copysign(most_m_s, gain_m_s)
        ahead_m_s += gain_m_s - fallen_m_s
        if ahead_m_s * now_m_s < 0.0:
            ahead_m_s = 0.0
        return ahead_m_s + turn_m_s, ahead_m_s - turn_m_s

    def _turned(self, gain_m_s: float, turn_m_s: float, aim_m_s: float) -> tuple[float, float]:
        """Return what a turning body gains in speed, and how fast it turns then."""
        most_m_s, per_turn = self._most_m_s, self._ahead_per_turn
        if turn_m_s * aim_m_s <= 0.0 and turn_m_s:
            aim_m_s = self._coasts_turning_m_s - copysign(self._drag_m_s, turn_m_s)
        wanted_m_s = (aim_m_s - turn_m_s) * self._turn_lag * per_turn
        left_m_s, right_m_s = gain_m_s + wanted_m_s, gain_m_s - wanted_m_s
        if abs(left_m_s) > most_m_s:
            left_m_s = copysign(most_m_s, left_m_s)
        if abs(right_m_s) > most_m_s:
            right_m_s = copysign(most_m_s, right_m_s)
        turned_m_s = turn_m_s + (left_m_s - right_m_s) / 2.0 / per_turn
        return (left_m_s + right_m_s) / 2.0, turned_m_s if turned_m_s * turn_m_s >= 0.0 else 0.0


@lru_cache(maxsize=32)
def curve_factors(body: WheeledBody, friction: float) -> Factors:
    """Return by what speed and turn rate differ from the closed form, for duties of means and half differences 0 to 1.

    It takes some 20 ms, once per process; if the closed form turns hardly or not at all both are 1.
    """
    slow, (a_m, b_m, _) = SlowCurves.of(body, friction), body.wheels
    means, halves = np.meshgrid(*[np.linspace(0.0, 1.0, CELLS + 1)] * 2, indexing="ij")
    means = np.maximum(means, SLOWEST_DUTY)
    found = balance(body, friction, (means + halves).ravel(), (means - halves).ravel())
    factors = np.ones((2, means.size))
    for point, duties in enumerate(zip(means.flat, halves.flat, strict=True)):
        slow_m_s, rims_m_s = slow.steady(*(float(duty) * slow.free_m_s for duty in duties))
        slow_rad_s = rims_m_s * b_m / (a_m * a_m + b_m * b_m)
        if slow_rad_s >= SLOWEST_RAD_S:
            factors[:, point] = found[0][point] / slow_m_s, found[1][point] / slow_rad_s
    grid = factors.reshape(2, CELLS + 1, CELLS + 1)
    first, by_mean, by_half = grid[:, :-1, :-1], np.diff(grid, axis=1)[:, :, :-1], np.diff(grid, axis=2)[:, :-1]
    twist = np.diff(np.diff(grid, axis=1), axis=2)
    cells = np.stack([first, by_mean, by_half, twist], axis=1).reshape(8, CELLS, CELLS)
    return tuple(tuple(tuple(cell) for cell in row) for row in np.moveaxis(cells, 0, -1).tolist())


def balance(body: WheeledBody, friction: float, left: Array, right: Array) -> tuple[Array, Array]:
    """Return the steady speed, m/s, and turn rate, rad/s clockwise, for pairs of duties of the sides.

    Each of the four wheels carries a quarter of the weight and slides at its foot point: along by how much its rim is
    faster than the ground, sideways because it does not steer. Coulomb friction opposes that (Pentzer 2014, wheels that
    stand on points). The motors give what their torque-speed line leaves. Forces along and across the body and the
    moment about it then have to balance; a body that goes round needs force towards the inside, so it slides outwards,
    which loosens the grip that keeps it from turning.
    """
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
