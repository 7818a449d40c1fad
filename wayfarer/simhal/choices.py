"""What a simulation can be: its depth, its physics, and the ground of physics-light.

Every command's start imports this.
"""

from __future__ import annotations

from enum import StrEnum


class Depth(StrEnum):
    """The depth of the simulation: simulated parts, or simulated chips under the real drivers."""

    DEVICE = "device"
    BUS = "bus"


class PhysicsName(StrEnum):
    """How a body moves: by closed forms, or as a rigid body in MuJoCo."""

    light = "light"
    mujoco = "mujoco"


class GroundName(StrEnum):
    """What the wheels stand on; on ``ideal`` the body goes and turns as commanded, as in the paper's simulator."""

    ideal = "ideal"
    leaf_litter = "leaf-litter"
    dry_soil = "dry-soil"
    mud = "mud"
