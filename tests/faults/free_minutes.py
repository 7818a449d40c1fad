"""What the detector says of healthy rovers in free driving: nothing, if it is right.

``python -m tests.faults.free_minutes`` drives each rover for ten minutes on each ground of both worlds and prints what
was said (a quarter of an hour).
"""

from __future__ import annotations

from collections.abc import Iterator

from tests.faults.free_driving import drive_freely
from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.world.physics import GroundName, Terrain

ROVERS = ("sim", "forestrover", "minirover")
FRICTIONS = (0.1, 0.15, 0.3, 0.5, 0.8)
TORQUE_SCALES = (1.0, 3.0)
# Full duty does not turn MiniRover there (1.03 of it would, closed form), and the detector says so: rightly.
CANNOT_TURN = ("minirover", 0.8, 1.0)
TEN_MINUTES_S = 600.0


def ground(friction: float, torque_scale: float = 1.0) -> Terrain:
    """Return level ground of this friction."""
    return Terrain(friction, torque_scale=torque_scale)


def cells() -> Iterator[tuple[str, float, float]]:
    """Yield rover, friction and torque scale wherever the rover can turn."""
    for rover in ROVERS:
        for friction in FRICTIONS:
            for torque_scale in TORQUE_SCALES:
                if (rover, friction, torque_scale) != CANNOT_TURN:
                    yield rover, friction, torque_scale


def print_silence() -> None:
    """Print a line for each ground: what was said in ten minutes."""
    for name in ROVERS:
        for light in GroundName:
            print(name, light, drive_freely(load_rover(name), None, TEN_MINUTES_S, 0, ground=light), flush=True)
    for name, friction, torque_scale in cells():
        said = drive_freely(load_rover(name), ground(friction, torque_scale), TEN_MINUTES_S, 0)
        print(name, friction, f"{torque_scale:g}x", said, flush=True)


if __name__ == "__main__":
    print_silence()
