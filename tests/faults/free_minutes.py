"""What the detector says in free driving: of healthy rovers (nothing, if it is right), and of broken drives (how soon).

``python -m tests.faults.free_minutes silence`` drives each healthy rover for ten minutes on each ground of
both worlds and prints what was said (a quarter of an hour).
``python -m tests.faults.free_minutes faults`` breaks a side after 20 s and prints how often and how soon that
was told, as a Markdown table (ten minutes).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from math import inf
from statistics import median

from tests.faults.free_driving import drive_freely
from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.drawn_ranges import Range
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.world import Drive
from wayfarer.simhal.mujoco.terrain import Terrains
from wayfarer.simhal.world.physics import GroundName

ROVERS = ("sim", "forestrover", "minirover")
FRICTIONS = (0.1, 0.15, 0.3, 0.5, 0.8)
TORQUE_SCALES = (1.0, 3.0)
# Full duty does not turn MiniRover there (1.03 of it would, closed form), and the detector says so: rightly.
CANNOT_TURN = ("minirover", 0.8, 1.0)
TEN_MINUTES_S = 600.0

SIDES = {
    "left dead": Drive(left_gain=0.0),
    "right dead": Drive(right_gain=0.0),
    "left reversed": Drive(left_gain=-1.0),
    "right reversed": Drive(right_gain=-1.0),
}
BREAKS_AT_S, TOLD_WITHIN_S = 20.0, 30.0
SEEDS = 4
OF_THE_DRIVE = {"drive_suspected", "drive_weak", "drive_reversed"}


def ground(friction: float, torque_scale: float = 1.0) -> Terrains:
    """Return level ground of this friction."""
    return Terrains(Range(friction, friction), torque_scale=Range(torque_scale, torque_scale))


def cells() -> Iterator[tuple[str, float, float]]:
    """Yield rover, friction and torque scale wherever the rover can turn."""
    for rover in ROVERS:
        for friction in FRICTIONS:
            for torque_scale in TORQUE_SCALES:
                if (rover, friction, torque_scale) != CANNOT_TURN:
                    yield rover, friction, torque_scale


def told_after_s(rover: str, friction: float, side: Drive, seed: int) -> float:
    """Return how long after a side broke that was told, infinite if it was not."""
    fault = Fault(BREAKS_AT_S, inf, "world", "drive", side)
    said = drive_freely(load_rover(rover), ground(friction), BREAKS_AT_S + TOLD_WITHIN_S, seed, [fault])
    return min((t_s - BREAKS_AT_S for t_s, name in said if t_s > BREAKS_AT_S and name in OF_THE_DRIVE), default=inf)


def print_silence() -> None:
    """Print a line for each ground: what was said in ten minutes."""
    for name in ROVERS:
        for light in GroundName:
            print(name, light, drive_freely(load_rover(name), None, TEN_MINUTES_S, 0, ground=light), flush=True)
    for name, friction, torque_scale in cells():
        said = drive_freely(load_rover(name), ground(friction, torque_scale), TEN_MINUTES_S, 0)
        print(name, friction, f"{torque_scale:g}x", said, flush=True)


def print_faults() -> None:
    """Print a row for each rover and ground: of each side how many were told, and the median of the delays."""
    print("| rover | mu |", " | ".join(SIDES), "|")
    print("|---|---|" + "---|" * len(SIDES))
    for rover in ROVERS:
        for friction in (0.15, 0.3, 0.5, 0.8):
            shown = []
            for side in SIDES.values():
                delays_s = [told_after_s(rover, friction, side, seed) for seed in range(SEEDS)]
                found_s = [delay_s for delay_s in delays_s if delay_s < inf]
                shown.append(f"{len(found_s)} of {SEEDS}" + (f", {median(found_s):.1f} s" if found_s else ""))
            print(f"| {rover} | {friction} |", " | ".join(shown), "|", flush=True)


if __name__ == "__main__":
    {"silence": print_silence, "faults": print_faults}[sys.argv[1]]()
