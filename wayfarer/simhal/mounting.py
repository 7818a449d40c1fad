"""How the simulated sensors are mounted: as the rover file says, so that the driver's settings undo it."""

from __future__ import annotations

from collections.abc import Callable

from wayfarer.drivers.cmps14 import CMPS14Settings
from wayfarer.drivers.pmw3901 import PMW3901Settings
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import HeadingSensorModel
from wayfarer.simhal.world.simulated_world import SimulatedWorld


class MountedCompass(HeadingSensorModel):
    """What a compass feels that is mounted as the rover file says: the driver's settings, undone."""

    def __init__(self, world: SimulatedWorld, streams: RandomStreams, settings: CMPS14Settings) -> None:
        super().__init__(world, streams)
        self._settings = settings

    def sample(self, t_s: float) -> tuple[int, int, int]:
        """Return heading, pitch and roll in the part's own frame, in tenths of a degree."""
        heading, pitch, roll = super().sample(t_s)
        settings = self._settings
        pitch = -pitch if settings.reverse_pitch else pitch
        roll = -roll if settings.reverse_roll else roll
        if settings.swap_pitch_roll:
            pitch, roll = roll, pitch
        return (heading - round(settings.heading_offset_deg * 10.0)) % 3600, pitch, roll


def mounted(settings: PMW3901Settings) -> Callable[[int, int], tuple[int, int]]:
    """Return the flow chip's x and y for a displacement forward and right, mounted as the rover file says."""
    forward_is_x = settings.forward[1] == "x"
    forward_sign, right_sign = (1 if axis[0] == "+" else -1 for axis in (settings.forward, settings.right))

    def turned(forward: int, right: int) -> tuple[int, int]:
        forward, right = forward * forward_sign, right * right_sign
        return (forward, right) if forward_is_x else (right, forward)

    return turned
