"""Sensor models: what each simulated sensor measures of the world, in chip units, for both depths.

A sense is sampled once for each reading that a driver takes, so both depths draw the same chance in the same order.
"""

from __future__ import annotations

from math import degrees
from typing import Final

from mypy_extensions import mypyc_attr

from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_errors import SQUAL_SEEN, CompassErrors, blind_ground, compass_errs, flow_scale
from wayfarer.simhal.world.simulated_world import SimulatedWorld

# PMW3901 at 0.1 m above ground: 0.213 mm a count (hardware.md 8.2).
FLOW_M_PER_COUNT: Final = 0.00213195 * 0.1
TENTHS_PER_RAD: Final = degrees(10.0)


@mypyc_attr(allow_interpreted_subclasses=True)
class HeadingSensorModel:
    """Heading and tilt with noise, in tenths of a degree as in a CMPS14's 16-bit registers."""

    def __init__(self, world: SimulatedWorld, streams: RandomStreams) -> None:
        self._world = world
        self._attitude = CompassErrors(world, streams).attitude if compass_errs(world.physics) else world.attitude
        self._bias_deg = world.physics.compass_bias_deg
        self._noise_tenths = streams.normal("compass.heading", world.physics.compass_noise_deg * 10.0)
        self._tilt_noise_tenths = streams.normal("compass.tilt", world.physics.tilt_noise_deg * 10.0)

    def sample(self, t_s: float) -> tuple[int, int, int]:
        """Return heading in 0..3599, pitch (nose up) and roll (right side down), all in tenths of a degree."""
        world, tilt_noise_tenths = self._world, self._tilt_noise_tenths
        world.advance_to(t_s)
        heading_rad, pitch_deg, roll_deg = self._attitude()
        off_deg = world.field_deg + self._bias_deg
        return (
            round(heading_rad * TENTHS_PER_RAD + off_deg * 10.0 + self._noise_tenths()) % 3600,
            round(pitch_deg * 10.0 + tilt_noise_tenths()),
            (round(roll_deg * 10.0 + tilt_noise_tenths()) + 1800) % 3600 - 1800,
        )


@mypyc_attr(allow_interpreted_subclasses=True)
class FlowSensorModel:
    """Displacement over ground since the previous sample, in counts of a PMW3901.

    ``squal`` is what the picture of the latest sample is worth, as that chip reports it.
    """

    squal: int = SQUAL_SEEN

    def __init__(self, world: SimulatedWorld, streams: RandomStreams, m_per_count: float = FLOW_M_PER_COUNT) -> None:
        self._world = world
        self._m_per_count = m_per_count / flow_scale(world.physics, streams)
        self._blind = blind_ground(world, streams)
        self._noise_counts = world.physics.flow_noise_counts
        self._noise_share = world.physics.flow_noise_share
        self._noise = streams.normal("flow", 1.0)
        self._last_m = self._last_right_m = 0.0

    def sample(self, t_s: float) -> tuple[int, int]:
        """Return forward and right displacement in counts."""
        world, noise = self._world, self._noise
        world.advance_to(t_s)
        signed_m = world.forward_m - world.reverse_m
        counts, self._last_m = (signed_m - self._last_m) / self._m_per_count, signed_m
        forward = round(counts + (self._noise_counts + self._noise_share * abs(counts)) * noise())
        right_m = world.right_m
        right, self._last_right_m = (right_m - self._last_right_m) / self._m_per_count, right_m
        right_counts = round(right + self._noise_counts * noise())
        if self._blind is not None:
            if self._blind.is_under():
                self.squal = self._blind.squal
                return 0, 0
            self.squal = SQUAL_SEEN
        return forward, right_counts
