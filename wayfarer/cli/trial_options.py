"""Options that the commands share which run trials: ``sim`` and ``sweep``; others share some of them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from wayfarer.cli.options import complete_algorithms, rover_option

RUNNING = "Running"
MUJOCO = "Physics mujoco"


DepthName = Literal["device", "bus"]  # the values of ``simhal.build_rover.Depth``
PhysicsName = Literal["light", "mujoco"]
SiteName = Literal["extended-maze", "dense-obstruction", "forest-escape"]  # the names of ``simhal.world.sites``
Ground = Literal["ideal", "leaf-litter", "dry-soil", "mud"]  # the names of ``simhal.world.physics``


def _positive(value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value:g} is not a finite number above 0")
    return value


AlgorithmNames = Annotated[
    str,
    typer.Option(
        metavar="NAME[,NAME...]",
        autocompletion=complete_algorithms,
        help="Escape algorithms; 'paper' means all ten of the paper. A name given twice runs once.",
    ),
]
Forests = Annotated[
    str | None,
    typer.Option(
        metavar="FILE|reference",
        help="Forest file, used in file order; 'reference': the 500 of the paper's released simulator. "
        "(default: generated, another layout in each trial)",
    ),
]
SiteOption = Annotated[
    SiteName | None,
    typer.Option(
        metavar="SITE",
        help="A site of the paper's field trials instead of a forest, with another layout in each trial: "
        "extended-maze, dense-obstruction or forest-escape.",
    ),
]
RoverName = Annotated[str, rover_option("Name of a built-in rover, or a rover file (TOML).")]
Seed = Annotated[int, typer.Option(min=0, metavar="N", help="Random seed of the campaign.")]
SlipMeanM = Annotated[float, typer.Option(callback=_positive, metavar="M", help="Mean distance between slip events.")]
BudgetM = Annotated[
    float, typer.Option(callback=_positive, metavar="M", help="Path length after which a rover counts as entrapped.")
]
AnomalySource = Annotated[
    Literal["motion", "contact"] | None,
    typer.Option(help="Detect an obstacle by lack of motion, or by contact as well. (default: from the rover file)"),
]
DepthOption = Annotated[
    DepthName, typer.Option(help="device: simulated parts; bus: the real drivers over simulated chips (slower).")
]
PhysicsOption = Annotated[
    PhysicsName,
    typer.Option(help="light: fast built-in physics; mujoco: rigid bodies, wheels that grip and slip (slower)."),
]
GroundOption = Annotated[
    Ground,
    typer.Option(
        metavar="GROUND",
        help="Ground in physics-light. The rover turns as commanded on 'ideal'; "
        "the wheels slip on leaf-litter, dry-soil and mud.",
    ),
]


def _terrain_option(unit: str, help_text: str) -> Any:
    """Return an option for a value that is fixed, or drawn for each trial."""
    return typer.Option(metavar=f"{unit}|MIN:MAX", help=help_text, rich_help_panel=MUJOCO)


Friction = Annotated[
    str | None,
    _terrain_option("MU", "Friction of tyres on ground and bark, fixed or drawn for each trial. (default: 0.5)"),
]
RoughnessM = Annotated[
    str | None, _terrain_option("M", "Standard deviation of the ground's height; slower above 0. (default: 0)")
]
TorqueScale = Annotated[
    str | None,
    _terrain_option(
        "X",
        "Stall torque divided by the rover file's chassis.motors_n_m; 3 if that is the rated torque. (default: 1)",
    ),
]
SlopeDeg = Annotated[
    str | None,
    typer.Option(metavar="DEG|MIN:MAX", help="Slope of all the ground, fixed or drawn for each trial. (default: 0)"),
]
SlopeDirectionDeg = Annotated[
    str | None,
    typer.Option(
        metavar="DEG|MIN:MAX",
        help="Where the ground rises to, clockwise from the way to the goal: 0 is a goal straight uphill, 180 straight "
        "downhill. (default: 0)",
    ),
]
SensesOption = Annotated[
    str,
    typer.Option(
        metavar="NAME|KEY=VALUE",
        help="How compass and flow sensor err: 'ideal', 'field' (as in a wood), or errors by name, such as "
        "blind_share=0.3; several with commas between them.",
    ),
]
Spl = Annotated[
    bool,
    typer.Option("--spl", help="Compute unknown shortest paths, for SPL (success weighted by path length); slower."),
]
Jobs = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="Number of processes. (default: one per core)", rich_help_panel=RUNNING),
]
ClusterAddress = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Run on the workers of this Dask scheduler instead of local processes.",
        rich_help_panel=RUNNING,
    ),
]
Out = Annotated[Path, typer.Option(metavar="DIR", help="New or empty folder for the results.", rich_help_panel=RUNNING)]
Resume = Annotated[
    bool, typer.Option("--resume", help="Continue what was interrupted in --out.", rich_help_panel=RUNNING)
]

# Of each pair, the first option has no effect without the second.
WORLD_NEEDS = (
    ("friction", "physics mujoco"),
    ("roughness_m", "physics mujoco"),
    ("torque_scale", "physics mujoco"),
)
WORLD_EXCLUDES = (
    ("site", "forests"),  # a site draws its own layouts
    ("ground leaf-litter", "physics mujoco"),  # which has --friction instead
    ("ground dry-soil", "physics mujoco"),
    ("ground mud", "physics mujoco"),
)
