"""The numbers of the simulated world."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Physics:
    """Physics-light: what makes a blind rover's life hard, and no more.

    From the paper and its released simulator (section IV-A; units as measured from the released code): the rover goes
    off its heading by ``steer_noise_rad`` in each step (0.05 m at cruise), its heading wanders by
    ``heading_noise_deg`` in each 0.05 m, and it slips 0.5 m plus an exponentially distributed distance
    (``slip_mean_m``) after the last slip.

    From no source, chosen to be plain: first-order motor lag; gain of each side and effective track off by a few per
    cent from one rover to the next; a rover that pushes onto a trunk rears up at ``climb_deg_s`` for full duty, falls
    back with ``settle_s``, and tips over beyond ``tip_deg``.
    """

    step_s: float = 0.05
    motor_lag_s: float = 0.1
    side_gain_sd: float = 0.02
    track_sd: float = 0.05
    steer_noise_rad: float = 0.2
    heading_noise_deg: float = 1.0
    noise_per_m: float = 0.05
    slip_free_m: float = 0.5
    slip_mean_m: float = 10.0
    climb_deg_s: float = 40.0
    settle_s: float = 0.2
    tip_deg: float = 60.0
