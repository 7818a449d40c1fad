"""The named grounds of physics-light."""

from __future__ import annotations

from enum import StrEnum


class GroundName(StrEnum):
    """What the wheels stand on; on ``ideal`` the body goes and turns as commanded, as in the paper's simulator."""

    ideal = "ideal"
    leaf_litter = "leaf-litter"
    dry_soil = "dry-soil"
    mud = "mud"


# Friction of a tyre on the ground. Nobody measured these tyres. Dry soil: a tyre that slides on a dry earth road (Wong,
# Theory of Ground Vehicles). Mud and leaf litter: the middle of what is said of them, 0.1 to 0.2 and 0.3 to 0.5; Wong
# has 0.4 to 0.5 for a wet earth road, and no leaves.
FRICTIONS = {GroundName.leaf_litter: 0.4, GroundName.dry_soil: 0.65, GroundName.mud: 0.15}
