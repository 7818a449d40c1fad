"""Sensor models: what each simulated sensor measures of the world, in chip units, for both depths.

A sensor is sampled once for each reading that a driver takes, so both depths draw the same chance in the same order. In
the field a compass also has errors of iron, the motors' field, a gyro with a dead band, vibration and lag, and a flow
sensor those of a false height above the ground and of ground on which it sees nothing (``physics.Senses``).
"""

from __future__ import annotations

from collections import deque
from math import ceil, cos, degrees, exp, radians, remainder, sin, tau
from typing import Final

import numpy as np
from mypy_extensions import mypyc_attr
from numpy.typing import NDArray

from wayfarer.drivers.buses import Frame
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import WORLD_SIZE_M
from wayfarer.simhal.world.physics import Senses
from wayfarer.simhal.world.simulated_world import ROUNDING_S, SimulatedWorld

Attitude = tuple[float, float, float]  # heading in radians, pitch and roll in degrees

SQUAL_FULL: Final = 95  # what the driver of a PMW3901 takes as quality 1, by default
SQUAL_SEEN: Final = 76  # of ordinary ground
# PMW3901 at 0.1 m above ground: 0.213 mm per count (docs/reference/hardware.md).
FLOW_M_PER_COUNT: Final = 0.00213195 * 0.1
TENTHS_PER_RAD: Final = degrees(10.0)
# Adding it to a float below 2**51 and taking it away again rounds as ``round`` does, in a tenth of the time.
TO_WHOLE: Final = 1.5 * 2.0**52


def compass_errs(senses: Senses) -> bool:
    """Return whether a compass has any of these errors."""
    return bool(
        senses.hard_iron_deg
        or senses.soft_iron_deg
        or senses.motor_field_deg
        or senses.compass_freezes_below_deg_s
        or senses.tilt_vibration_deg
        or senses.compass_lag_s
    )


class CompassErrors:
    """What a compass makes of a world's attitude, each time that it is asked.

    The errors come in the order in which a reading does: the field at the sensor is bent, the heading is fused with the
    gyro, the tilt is shaken, and all of it is late.
    """

    def __init__(self, world: SimulatedWorld, streams: RandomStreams) -> None:
        senses = world.physics
        self._world = world
        self._hard_rad, self._soft_rad = radians(senses.hard_iron_deg), radians(senses.soft_iron_deg)
        self._motor_rad = radians(senses.motor_field_deg)
        phases = streams.generator("compass.field").uniform(0.0, tau, 4).tolist()
        self._hard_phase, self._soft_phase, self._left_phase, self._right_phase = phases
        self._freezes_below_rad_s = radians(senses.compass_freezes_below_deg_s)
        self._shaken_deg = streams.normal("compass.vibration", senses.tilt_vibration_deg)
        self._lag_s = senses.compass_lag_s
        self._earlier: deque[tuple[float, Attitude]] = deque()
        self._looked_s, self._heading_rad = world.t_s, world.heading_rad
        self._bent_rad = self._fused_rad = self._bent(world.heading_rad)

    def attitude(self) -> Attitude:
        """Return what the compass feels now: heading in radians, pitch and roll in degrees."""
        world = self._world
        heading_rad, pitch_deg, roll_deg = world.attitude()
        left, right = world.commanded
        duty = (abs(left) + abs(right)) / 2.0
        fused_rad = self._fuse(heading_rad)
        felt = fused_rad, pitch_deg + duty * self._shaken_deg.draw(), roll_deg + duty * self._shaken_deg.draw()
        return self._late(felt) if self._lag_s else felt

    def _bent(self, heading_rad: float) -> float:
        """Return the magnetic heading of a body with this heading."""
        left, right = self._world.commanded
        return (
            heading_rad
            + self._hard_rad * sin(heading_rad + self._hard_phase)
            + self._soft_rad * sin(2.0 * heading_rad + self._soft_phase)
            + self._motor_rad * left * sin(heading_rad + self._left_phase)
            + self._motor_rad * right * sin(heading_rad + self._right_phase)
        )

    def _fuse(self, heading_rad: float) -> float:
        """Return the heading with what it has changed since the last look, unless the gyro noticed no turn."""
        bent_rad, t_s = self._bent(heading_rad), self._world.t_s
        if not self._freezes_below_rad_s:
            return bent_rad
        turned_rad = remainder(heading_rad - self._heading_rad, tau)
        if abs(turned_rad) >= self._freezes_below_rad_s * (t_s - self._looked_s):
            self._fused_rad += remainder(bent_rad - self._bent_rad, tau)
        self._looked_s, self._heading_rad, self._bent_rad = t_s, heading_rad, bent_rad
        return self._fused_rad

    def _late(self, felt: Attitude) -> Attitude:
        """Return what was felt that long ago; at the beginning, what was felt first."""
        earlier, t_s = self._earlier, self._world.t_s
        earlier.append((t_s, felt))
        while len(earlier) > 1 and earlier[1][0] <= t_s - self._lag_s + ROUNDING_S:
            earlier.popleft()
        return earlier[0][1]


class BlindGround:
    """Where a flow sensor sees nothing: square cells that depend on the trial alone, so that a place stays blind.

    A larger share adds cells to those of a smaller one. Beyond the edges of the world the pattern repeats. The cell of
    the start is never blind: a rover that sees nothing is not armed.
    """

    def __init__(self, world: SimulatedWorld, streams: RandomStreams) -> None:
        senses = world.physics
        self._world = world
        self._cell_m = senses.blind_cell_m
        self._side = side = ceil(WORLD_SIZE_M / senses.blind_cell_m)
        drawn = streams.generator("flow.blind").random(side * side) < senses.blind_share
        self._cells = bytearray(drawn.tobytes())
        self._cells[self._cell_under()] = False
        self.squal = round(senses.blind_quality * SQUAL_FULL)  # as the sensor reports it there

    def is_under(self) -> bool:
        """Return whether the body stands on such a cell."""
        return bool(self._cells[self._cell_under()])

    def _cell_under(self) -> int:
        column, row = int(self._world.x_m // self._cell_m), int(self._world.y_m // self._cell_m)
        return row % self._side * self._side + column % self._side


def blind_ground(world: SimulatedWorld, streams: RandomStreams) -> BlindGround | None:
    """Return where the sensor sees nothing, None if it sees all of the ground."""
    return BlindGround(world, streams) if world.physics.blind_share else None


def flow_scale(senses: Senses, streams: RandomStreams) -> float:
    """Return this trial's factor on each displacement, which is above 0."""
    sd = senses.flow_scale_sd
    return exp(float(streams.generator("flow.scale").normal(0.0, sd))) if sd else 1.0


@mypyc_attr(allow_interpreted_subclasses=True)
class HeadingSensorModel:
    """Heading and tilt with noise, in tenths of a degree as in a CMPS14's 16-bit registers."""

    def __init__(self, world: SimulatedWorld, streams: RandomStreams) -> None:
        self._world = world
        self._errors = CompassErrors(world, streams) if compass_errs(world.physics) else None
        self._bias_deg = world.physics.compass_bias_deg
        self._noise_tenths = streams.normal("compass.heading", world.physics.compass_noise_deg * 10.0)
        self._tilt_noise_tenths = streams.normal("compass.tilt", world.physics.tilt_noise_deg * 10.0)

    def sample(self, t_s: float) -> tuple[int, int, int]:
        """Return heading in 0..3599, pitch (nose up) and roll (right side down), all in tenths of a degree."""
        heading, pitch, roll = self.whole_tenths(t_s)
        return int(heading), int(pitch), int(roll)

    def whole_tenths(self, t_s: float) -> tuple[float, float, float]:
        """Return the same as floats, for a part without registers: that takes less time."""
        world, tilt_noise_tenths = self._world, self._tilt_noise_tenths
        world.advance_to(t_s)
        heading_rad, pitch_deg, roll_deg = world.attitude() if self._errors is None else self._errors.attitude()
        off_deg = world.field_deg + self._bias_deg
        return (
            (heading_rad * TENTHS_PER_RAD + off_deg * 10.0 + self._noise_tenths.draw() + TO_WHOLE - TO_WHOLE) % 3600.0,
            pitch_deg * 10.0 + tilt_noise_tenths.draw() + TO_WHOLE - TO_WHOLE,
            (roll_deg * 10.0 + tilt_noise_tenths.draw() + TO_WHOLE - TO_WHOLE + 1800.0) % 3600.0 - 1800.0,
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
        forward, right = self.whole_counts(t_s)
        return int(forward), int(right)

    def whole_counts(self, t_s: float) -> tuple[float, float]:
        """Return the same as floats, for a part without registers: that takes less time."""
        world, noise = self._world, self._noise
        world.advance_to(t_s)
        signed_m = world.forward_m - world.reverse_m
        counts, self._last_m = (signed_m - self._last_m) / self._m_per_count, signed_m
        noisy = counts + (self._noise_counts + self._noise_share * abs(counts)) * noise.draw()
        forward = noisy + TO_WHOLE - TO_WHOLE
        right_m = world.right_m
        right, self._last_right_m = (right_m - self._last_right_m) / self._m_per_count, right_m
        right_counts = right + self._noise_counts * noise.draw() + TO_WHOLE - TO_WHOLE
        if self._blind is not None:
            if self._blind.is_under():
                self.squal = self._blind.squal
                return 0.0, 0.0
            self.squal = SQUAL_SEEN
        return forward, right_counts


# -- a camera that looks straight down ---------------------------------------------------------------------------------
# Its picture is a texture with detail of all sizes, as leaves, twigs and earth have, that repeats after ``TILE_PX``
# pixels: 0.8 m if a pixel shows 1.5 mm. Chosen by us, to be plain: grey of a shaded forest floor, and the noise of a
# small sensor.

TILE_PX: Final = 512  # a power of two, so that wrapping is a mask
GREY_MEAN: Final = 110.0
GREY_SD: Final = 35.0
NOISE_SD: Final = 2.0


class GroundCamera:
    """A camera above the middle of the rover, the picture's top ahead.

    ``render`` is what ``buses.FakeBuses.cameras`` wants. ``m_per_pixel`` is the ground that one pixel shows, in
    metres, and also the finest detail of the ground: finer detail would be only noise. If ``Senses`` have
    blind ground, the picture is black.
    """

    def __init__(self, world: SimulatedWorld, streams: RandomStreams, m_per_pixel: float) -> None:
        self._world = world
        self._px_per_m = flow_scale(world.physics, streams) / m_per_pixel
        self._blind = blind_ground(world, streams)
        self._noise = streams.generator("camera.noise")
        self._ground = texture(streams.generator("camera.ground"))

    def render(self, t_s: float, width: int, height: int) -> Frame:
        """Return what the camera sees at a time: luma of shape (height, width)."""
        self._world.tick_chips()  # a deadman may have tripped since
        self._world.advance_to(t_s)
        is_dark = self._blind is not None and self._blind.is_under()
        seen = 0.0 if is_dark else self._look(width, height)
        grey = seen + NOISE_SD * self._noise.standard_normal((height, width), dtype=np.float32)
        return Frame(t_s, np.clip(np.rint(grey), 0, 255).astype(np.uint8))

    def _look(self, width: int, height: int) -> NDArray[np.float32]:
        """Return the ground under each pixel; columns of the texture run east, its rows north."""
        world = self._world
        right = np.arange(width) - (width - 1) / 2
        ahead = ((height - 1) / 2 - np.arange(height))[:, None]
        sin_h, cos_h = sin(world.heading_rad), cos(world.heading_rad)
        east = world.x_m * self._px_per_m + ahead * sin_h + right * cos_h
        north = world.y_m * self._px_per_m + ahead * cos_h - right * sin_h
        return _between(self._ground, north, east)


def texture(rng: np.random.Generator) -> NDArray[np.float32]:
    """Return a square texture that continues at its opposite edges: noise whose amplitude falls as its detail grows."""
    rows, columns = np.fft.fftfreq(TILE_PX)[:, None], np.fft.rfftfreq(TILE_PX)
    detail = np.hypot(rows, columns)
    detail[0, 0] = np.inf  # no mean
    spectrum = np.fft.rfft2(rng.standard_normal((TILE_PX, TILE_PX))) / detail
    waves = np.fft.irfft2(spectrum, (TILE_PX, TILE_PX))
    ground: NDArray[np.float32] = (GREY_MEAN + waves * (GREY_SD / waves.std())).astype(np.float32)
    return ground


def _between(tile: NDArray[np.float32], rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the texture at points between its own, from the four around each."""
    row, column = np.floor(rows).astype(np.int64), np.floor(columns).astype(np.int64)
    down, along = (rows - row).astype(np.float32), (columns - column).astype(np.float32)
    wrap = TILE_PX - 1
    row, column, row_1, column_1 = row & wrap, column & wrap, (row + 1) & wrap, (column + 1) & wrap
    upper = tile[row, column] * (1 - along) + tile[row, column_1] * along
    lower = tile[row_1, column] * (1 - along) + tile[row_1, column_1] * along
    between: NDArray[np.float32] = upper * (1 - down) + lower * down
    return between
