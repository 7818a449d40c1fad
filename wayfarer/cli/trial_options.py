"""Options that the commands share which run trials: ``sim`` and ``sweep``; other commands share some of them."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import typer

from wayfarer.cli.options import complete_algorithms, rover_option

RUNNING = "Running"


DepthName = Literal["device", "bus"]  # the values of ``simhal.build_rover.Depth``
PhysicsName = Literal["light", "mujoco"]


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
        "(default: generated layouts, each with two noise seeds)",
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
Resume = Annotated[
    bool, typer.Option("--resume", help="Continue what was interrupted in --out.", rich_help_panel=RUNNING)
]
