"""Control of turn rate and heading of a skid-steered body, with feedback from the compass.

Tyres resist sideways. A body therefore turns only if the *turn duty* (half the difference of both sides' duties,
clockwise positive) is more than the ground's friction takes up; that share is the *dead zone*. It depends on ground,
tyres, weight and motors: 0 on ideal ground, a tenth on mud, and half or more on dry soil (Kozlowski and Pazderski 2004,
Mandow 2007). It is learnt only while the body turns, because a blocked body shows nothing about the ground.

A body follows its wheels as a filter of the first order. What has lasted is forgotten in the same way.
"""

from __future__ import annotations

from math import cos, inf, radians
from typing import Final

from wayfarer.angles import DEG_PER_RAD, RAD_PER_DEG, clamp, wrap180
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.hal import WheelCommand

# A body follows its wheels with about this lag (``simhal.world.physics.Physics``: 0.1 s; ForestRover's mass and motors:
# 0.12 s).
BODY_LAG_S: Final = 0.1


def lagged(value: float, target: float, dt_s: float, lag_s: float) -> float:
    """Return what follows a target with a lag, after ``dt_s``: in small steps it comes nearer by 63 % in ``lag_s``."""
    return value + (target - value) * dt_s / (dt_s + lag_s)


def faded(value: float, dt_s: float, fade_s: float) -> float:
    """Return what is left of a value after ``dt_s``: the same as ``lagged`` towards 0."""
    return value * fade_s / (fade_s + dt_s)


# -- turns -------------------------------------------------------------------------------------------------------------

# Rates and duties are averaged alike before they are compared, so that the noise of a compass (1 degree, 20 readings
# per second) counts for 4 degrees per second.
AVERAGE_S: Final = 0.2
# Feedback: this share of the angle by which the heading lags is added to the turn rate per second. It is slow compared
# with lag and tick together.
CATCH_UP_PER_S: Final = 4.0
# A compass that lags shows late what was missing: feedback over a known lag is slower, this share of it in each lag.
CATCH_UP_IN_LAG: Final = 0.25
# While the body stands, nothing oscillates: once it has stood for longer than the lag, feedback is this quick until it
# is seen to turn. It must reach the duty at which the ground lets go before ``GIVE_UP_AFTER_S``. Chosen by us.
CATCH_UP_STANDING_PER_S: Final = 2.0
# The time constant with which the angle by which the heading lags is forgotten: a body that did not follow was held.
FORGET_S: Final = 1.5
# A body that turns faster than commanded by more than this was held and has come free: twice the noise of the latest
# rate.
FREE_SHARE: Final = 1.2
FREE_DEG_S: Final = 30.0
# Nothing is learnt from a body that may be held: one that turns more slowly than this, or than this share of the
# commanded rate.
LEARN_FROM_DEG_S: Final = 10.0
LEARN_FROM_SHARE: Final = 0.25
LEARN_S: Final = 0.5
DEAD_ZONE_MAX: Final = 0.9
# Below this rate, only a proportional part of the dead zone is compensated, so that a noisy compass does not jerk the
# wheels.
FULL_COMPENSATION_DEG_S: Final = 20.0
# In one tick the wheels turn a body by at most full duty on ideal ground, plus this for noise. If it turned further, a
# person turned it during a hold, while the clock of the logic was paused.
STRANGE_DEG: Final = 10.0
# Turn duty is not continued for long if the body does not turn. The heading must change by ``MOVED_DEG`` to count as
# turned: three times the noise of a compass. Fault catalogue, faults 29 and 58, allow 3 s; noise may look like a turn
# once in that time.
MOVED_DEG: Final = 3.0
GIVE_UP_AFTER_S: Final = 1.5
# On ground that takes up more turn duty than this, what a body is expected to turn is too unsure to predict it.
GRIP_MAX: Final = 0.5
# Shares of the duty: kept for feedback in a curve; and left for driving ahead on ground on which the body hardly turns.
RESERVE_DUTY: Final = 0.1
LEAST_DUTY: Final = 0.1


class PastTick:
    """A tick: its turn duty, and the turn rate that was expected then."""

    def __init__(self) -> None:
        self.duty = self.expected_deg_s = 0.0


class TurnController:
    """Calculates the wheel command for a forward speed and a turn rate.

    Call ``observe``, then ``wheels``, once per tick. If the wheels cannot deliver both, turning has priority over
    speed. ``dead_zone`` is the turn duty that was learnt. ``blocked`` is True when there was more turn duty than
    forward duty for ``GIVE_UP_AFTER_S`` of full duty, and the body did not turn.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._max_speed_m_s = vehicle.max_speed_m_s
        self._ideal_deg_s = vehicle.full_turn_deg_s
        self._most_behind_deg = self._ideal_deg_s / CATCH_UP_PER_S
        self._first_dead_zone = vehicle.turn_from_duty
        self.lag = CompassLag()
        self.reset()

    def reset(self) -> None:
        """Forget the learnt dead zone as well."""
        self.dead_zone = self._first_dead_zone
        self._t_s = -inf
        self._heading_deg = 0.0
        self._commanded_deg_s = self._duty = 0.0
        self._expected_deg_s = self._latest_deg_s = 0.0
        self._mean_duty = self._mean_rate_deg_s = self._shown_deg_s = 0.0
        self._catch_up_per_s = CATCH_UP_PER_S
        self._lagged_duty = 0.0  # as the body follows its wheels
        # The latest ticks, whose turns a compass that lags shows now; the oldest becomes the newest.
        self._past = [PastTick() for _ in range(LONGEST_TICKS + 1)]
        self._ticks = 0
        self.lag.forget()
        self.begin_manoeuvre()

    def begin_manoeuvre(self) -> None:
        """Forget the angle by which the heading lags."""
        self._behind_deg = self._pushed_s = self._pushed_deg = 0.0
        self._expected_deg_s = self._latest_deg_s
        self._pushes = self.blocked = False

    def observe(self, t_s: float, heading_deg: float, applied: WheelCommand | None) -> float:
        """Take the heading at a tick, and compare the turn since the last tick with the commands.

        ``applied`` is the wheel command that was applied since then; if it is None, the one that was returned counts.
        Returns the heading gained since then, 0 at the first tick: degrees, clockwise positive, half a turn at most.
        With a compass that lags, it is what the body is expected to have gained.
        """
        last_t_s, last_deg = self._t_s, self._heading_deg
        self._t_s, self._heading_deg = t_s, heading_deg
        if last_t_s == -inf:
            return 0.0
        gained_deg = wrap180(heading_deg - last_deg)
        dt_s = t_s - last_t_s
        if not dt_s > 0.0:
            return gained_deg
        if abs(gained_deg) > self._ideal_deg_s * dt_s + STRANGE_DEG:
            self._latest_deg_s = 0.0
            gained_deg -= self.lag.pending_deg
            self.lag.forget()
            self._ticks = 0
            self.begin_manoeuvre()
            return gained_deg
        duty = self._duty if applied is None else (applied.left - applied.right) / 2.0
        lag_s = self.lag.ticks * dt_s
        if lag_s * CATCH_UP_PER_S <= CATCH_UP_IN_LAG:
            self._catch_up_per_s = CATCH_UP_PER_S
        else:
            self._catch_up_per_s = CATCH_UP_STANDING_PER_S if self._pushed_s > lag_s else CATCH_UP_IN_LAG / lag_s
        shown_deg_s = gained_deg / dt_s
        self._lagged_duty = lagged(self._lagged_duty, duty, dt_s, BODY_LAG_S)
        if self.dead_zone > GRIP_MAX:
            gained_deg -= self.lag.pending_deg
            self.lag.forget()
        else:  # add what a compass that lags has not shown yet
            beyond = max(abs(self._lagged_duty) - self.dead_zone, 0.0)
            turn_deg = (beyond if self._lagged_duty > 0.0 else -beyond) * self._ideal_deg_s * dt_s
            gained_deg += self.lag.update(gained_deg, turn_deg)
        self._latest_deg_s = (self._latest_deg_s + gained_deg / dt_s) / 2.0
        expected_deg_s = lagged(self._expected_deg_s, self._commanded_deg_s, dt_s, BODY_LAG_S)
        self._expected_deg_s = expected_deg_s
        self._ticks += 1
        newest = self._past[self._ticks % len(self._past)]
        newest.duty, newest.expected_deg_s = duty, expected_deg_s
        # The angle is limited to what full duty can correct: anti-windup.
        behind_deg = faded(self._behind_deg + expected_deg_s * dt_s - gained_deg, dt_s, FORGET_S)
        self._behind_deg = clamp(behind_deg, -self._most_behind_deg, self._most_behind_deg)
        self._learn(shown_deg_s, dt_s)
        if self._pushes:  # in seconds of full duty: less duty does less harm, and turns less
            self._pushed_s += dt_s * abs(self._duty)
            self._pushed_deg += gained_deg if self._duty > 0.0 else -gained_deg
            if self._pushed_deg >= MOVED_DEG:
                self._pushed_s = self._pushed_deg = 0.0
            self.blocked = self._pushed_s >= GIVE_UP_AFTER_S
        return gained_deg

    def wheels(self, speed_m_s: float, turn_deg_s: float) -> WheelCommand:
        """Return the wheels for a forward speed and a turn rate, clockwise positive."""
        share = clamp(turn_deg_s / FULL_COMPENSATION_DEG_S, -1.0, 1.0)
        duty = (turn_deg_s + self._catch_up_per_s * self._behind_deg) / self._ideal_deg_s + share * self.dead_zone
        duty = clamp(duty, -1.0, 1.0)
        self._commanded_deg_s, self._duty = turn_deg_s, duty
        room = 1.0 - abs(duty)
        forward = clamp(speed_m_s / self._max_speed_m_s, -room, room)
        pushes = abs(duty) > abs(forward)
        if pushes is not self._pushes:
            self._pushes, self._pushed_s, self._pushed_deg = pushes, 0.0, 0.0
        return WheelCommand(forward + duty, forward - duty)

    def curve_speed_m_s(self, wanted_m_s: float, radius_m: float) -> float:
        """Return the highest speed, up to the wanted one, at which the wheels can follow a curve on this ground."""
        duty = max(1.0 - self.dead_zone - RESERVE_DUTY, LEAST_DUTY)
        return min(duty / (1.0 / self._max_speed_m_s + 1.0 / radius_m * DEG_PER_RAD / self._ideal_deg_s), wanted_m_s)

    def _learn(self, shown_deg_s: float, dt_s: float) -> None:
        """Learn the dead zone: the turn duty beyond what the turn rate needs on ideal ground.

        The turn is the one that the compass shows. A predicted turn follows from the dead zone that is assumed, and
        would confirm any. The feedback of a body that has come free is reduced.
        """
        lag_ticks = self.lag.ticks
        if lag_ticks >= self._ticks:
            return
        shown = self._past[(self._ticks - lag_ticks) % len(self._past)]
        duty, expected_deg_s = shown.duty, shown.expected_deg_s
        share = dt_s / (dt_s + AVERAGE_S)
        self._mean_duty += (duty - self._mean_duty) * share
        self._mean_rate_deg_s += (shown_deg_s - self._mean_rate_deg_s) * share
        self._shown_deg_s = (self._shown_deg_s + shown_deg_s) / 2.0
        if abs(expected_deg_s) < LEARN_FROM_DEG_S:
            return
        duty, rate, latest = self._mean_duty, self._mean_rate_deg_s, self._shown_deg_s
        if expected_deg_s < 0.0:
            expected_deg_s, duty, rate, latest = -expected_deg_s, -duty, -rate, -latest
        least_deg_s = max(LEARN_FROM_SHARE * expected_deg_s, LEARN_FROM_DEG_S)
        if rate > least_deg_s and latest > least_deg_s:
            seen = clamp(duty - rate / self._ideal_deg_s, 0.0, DEAD_ZONE_MAX)
            self.dead_zone += (seen - self.dead_zone) * dt_s / LEARN_S
            if latest > FREE_SHARE * expected_deg_s + FREE_DEG_S:
                self._behind_deg /= 2.0


# -- a compass that lags -----------------------------------------------------------------------------------------------

# A tilt-compensated or fused compass under vibration shows the heading of up to half a second ago, with a new time. A
# loop over such a heading oscillates. So the turns that the compass shows are correlated with the turns that the wheels
# were expected to give, at several delays: with the right one the correlation is largest. The heading plus the expected
# turn of that delay is the heading of now (a Smith predictor).

# Delays that are compared, in control ticks; at 20 ticks per second they are 0.1 s apart, up to 0.6 s.
STEP: Final = 2
DELAYS: Final = 7
LONGEST_TICKS: Final = STEP * (DELAYS - 1)
# A delay must be this much better than none, and at least so many steps: a body's own lag differs by some hundredths of
# a second from the expected, and 0.1 s is harmless.
CLEARER: Final = 1.6
LEAST: Final = 2
# Turns so far are forgotten by 63 % after this much excitation: three turns of 30 degrees, each in 15 ticks of 2
# degrees or more. Nothing is concluded before half of it was seen, nor if the body did less than this share of it.
MEMORY_DEG2: Final = 400.0
LEAST_SHARE: Final = 0.2
EXACT_DEG: Final = 1.0 / 64.0


class Delay:
    """A delay that is compared: the sum of the products of shown and expected turns with it.

    ``newer_deg`` and ``older_deg`` are the turns that were expected so many ticks ago, and one tick before.
    """

    def __init__(self) -> None:
        self.product = self.newer_deg = self.older_deg = 0.0


class CompassLag:
    """Predicts the turn that a compass has not shown yet: ``pending_deg``, clockwise positive, 0 without a lag.

    ``ticks`` is the lag in control ticks, 0 if none is known.
    """

    def __init__(self) -> None:
        self._delays = [Delay() for _ in range(DELAYS)]  # 0, STEP, ... ticks
        self._energy = 0.0  # of expected turns
        self.ticks = 0
        self.forget()

    def forget(self) -> None:
        """Forget the latest turns, as after a hold; the lag is kept, because it is a property of the compass."""
        for delay in self._delays:
            delay.newer_deg = delay.older_deg = 0.0
        self.pending_deg = 0.0

    def update(self, shown_deg: float, expected_deg: float) -> float:
        """Take in a tick: the turn that the compass shows, and the one that the wheels were expected to give.

        Returns how much ``pending_deg`` has changed.
        """
        # Add the tick to the sums; a body that is held shows nothing and changes nothing.
        energy = expected_deg * expected_deg
        keep = MEMORY_DEG2 / (MEMORY_DEG2 + energy)
        self._energy = (self._energy + energy) * keep
        delays, best, most, turn_deg = self._delays, 0, 0.0, expected_deg
        for n, delay in enumerate(delays):
            older_deg, delay.older_deg, delay.newer_deg = delay.older_deg, delay.newer_deg, turn_deg
            product = delay.product = (delay.product + shown_deg * turn_deg) * keep
            if n == 0 or product > most:
                best, most = n, product
            turn_deg = older_deg
        if self._energy >= MEMORY_DEG2 / 2.0 and most >= LEAST_SHARE * self._energy:  # else nothing is concluded
            if best < LEAST:
                self.ticks = 0
            elif most > CLEARER * delays[0].product:
                self.ticks = best * STEP
        before_deg, self.pending_deg = self.pending_deg, 0.0
        if self.ticks:
            # The share of the expected turns that the body does.
            steps = self.ticks // STEP
            share = clamp(delays[steps].product / self._energy, 0.0, 1.0)
            hidden_deg = [turn_deg for delay in delays[:steps] for turn_deg in (delay.newer_deg, delay.older_deg)]
            # In steps of which sums are exact: a mirrored world must give mirrored wheels.
            self.pending_deg = round(share * sum(hidden_deg) / EXACT_DEG) * EXACT_DEG
        return self.pending_deg - before_deg


# -- headings ----------------------------------------------------------------------------------------------------------

# Bound of the integral, in rad s: with the default gain it adds at most 17 degrees per second. It learns unequal sides,
# and must not wind up while something holds the rover.
INTEGRAL_MAX_RAD_S: Final = 1.5
# Beyond this error it turns on the spot. A body that is still further from its heading after the time of half a turn
# is held by something.
PIVOT_BEYOND_DEG: Final = 60.0


class HeadingControl:
    """Drives along a heading, by a PID controller from heading error to turn rate (paper, section III-A).

    Beyond ``PIVOT_BEYOND_DEG`` of error it turns on the spot instead.
    """

    def __init__(self, settings: EscapeSettings, turns: TurnController) -> None:
        self._p, self._i, self._d = settings.heading_p, settings.heading_i, settings.heading_d
        self._cruise_m_s = settings.cruise_m_s
        self._turn_limit_rad_s = radians(settings.turn_deg_s)
        self._turns = turns
        self._integral = 0.0
        self._last_error: float | None = None
        self._last_t_s = 0.0

    def wheels(self, t_s: float, error_deg: float) -> WheelCommand:
        """Return the wheels for a heading error in [-180, 180), positive when the goal lies clockwise."""
        error = error_deg * RAD_PER_DEG
        turn = self._p * error
        if self._last_error is not None:
            dt_s = t_s - self._last_t_s
            self._integral = clamp(self._integral + error * dt_s, -INTEGRAL_MAX_RAD_S, INTEGRAL_MAX_RAD_S)
            turn += self._i * self._integral
            if self._d and dt_s > 0.0:
                turn += self._d * (error - self._last_error) / dt_s
        self._last_error, self._last_t_s = error, t_s
        turn_deg_s = clamp(turn, -self._turn_limit_rad_s, self._turn_limit_rad_s) * DEG_PER_RAD
        if abs(error_deg) < PIVOT_BEYOND_DEG:
            return self._turns.wheels(self._cruise_m_s * cos(error), turn_deg_s)
        self._integral = 0.0  # the error during a pivot is not a steady offset to learn
        return self._turns.wheels(0.0, turn_deg_s)
