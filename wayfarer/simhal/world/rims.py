"""What the wheels of a body in physics-light do, beside what the body does: how their rims turn, and their load.

Each side has a motor whose torque falls in a line from stall to free speed. What it must push is what it takes to keep
the rim as fast as the ground under it, and never more than its grip, ``friction`` times half the weight. So a body that
something holds stalls its wheels if duty times stall force is below the grip; else they spin, and the load is the
grip. Wheels that slip, or hang in the air, spin.
"""

from __future__ import annotations

from math import copysign, exp
from typing import Final

from wayfarer.angles import clamp
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.physics import Senses
from wayfarer.simhal.world.wheeled_body import ROLLING_RESISTANCE, WheeledBody

# On ideal ground a body goes and turns as commanded, and its motors carry its rolling resistance and no more. Where it
# is held, its wheels have the grip of dry soil.
IDEAL_FRICTION: Final = 0.65
# Of wheels that slip: half of that of mud, as in ``DetectorSettings.gain_m_s2``.
SLIP_FRICTION: Final = 0.05
# Of a rover whose file gives no body: stall force over weight. ForestRover's is 1.16, MiniRover's 0.54.
PLAIN_PUSH: Final = 1.0


class Rims:
    """Follows the rims of both sides: how far they have turned, ``left_m`` and ``right_m``, and the load of the motors.

    A load is the size of the current as a share of that of a motor which is held at full duty: 0 to 2, as a motor
    that is reversed at full speed takes twice.

    Args:
        body: the rover; None if its file does not say.
        friction: of tyre on ground; None on ideal ground.
        senses: errors of the currents that show the loads.
        streams: their chance.
    """

    def __init__(
        self, body: WheeledBody | None, friction: float | None, senses: Senses, streams: RandomStreams
    ) -> None:
        push = PLAIN_PUSH
        if body is not None:
            push = body.motors_n_m / body.wheel_radius_m / (body.weight_kg * STANDARD_GRAVITY_M_S2)
        self._per_friction = 1.0 / push  # what friction takes of the stall force
        self._grip = (IDEAL_FRICTION if friction is None else friction) * self._per_friction
        self._resistance = ROLLING_RESISTANCE * self._per_friction
        self._is_ideal = friction is None
        scale = streams.generator("wheels.current_scale").normal(0.0, senses.current_scale_sd)
        self._scale, self._noise = exp(float(scale)), streams.normal("wheels.current", senses.current_noise_share)
        self.left_m = self.right_m = self.left_load = self.right_load = 0.0

    def held(self, step_s: float, left: float, right: float, full_m_s: tuple[float, float], *, slips: bool) -> None:
        """Take a step in which the body stood, for these duties and the sides' free speeds."""
        grip = SLIP_FRICTION * self._per_friction if slips else self._grip
        self._load(min(abs(left), grip), min(abs(right), grip))
        self.left_m += (left - clamp(left, -grip, grip)) * full_m_s[0] * step_s
        self.right_m += (right - clamp(right, -grip, grip)) * full_m_s[1] * step_s

    def rolled(
        self, step_s: float, left: float, right: float, full_m_s: tuple[float, float], rims_m_s: tuple[float, float]
    ) -> None:
        """Take a step in which the ground passed so fast under the rims; if it gives too little grip, they spin."""
        left_share, right_share = rims_m_s[0] / full_m_s[0], rims_m_s[1] / full_m_s[1]
        if self._is_ideal:
            left_load, right_load = left - left_share, right - right_share
            if left_share or right_share:
                left_load += copysign(self._resistance, left_share)
                right_load += copysign(self._resistance, right_share)
        else:
            left_load = clamp(left - left_share, -self._grip, self._grip)
            right_load = clamp(right - right_share, -self._grip, self._grip)
            left_share, right_share = left - left_load, right - right_load
        self._load(abs(left_load), abs(right_load))
        self.left_m += left_share * full_m_s[0] * step_s
        self.right_m += right_share * full_m_s[1] * step_s

    def _load(self, left: float, right: float) -> None:
        noise, scale = self._noise, self._scale
        self.left_load = clamp(left * scale * (1.0 + noise.draw()), 0.0, 2.0)
        self.right_load = clamp(right * scale * (1.0 + noise.draw()), 0.0, 2.0)
