"""``wayfarer sweep``: how much the results depend on a setting."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli.extras import require
from wayfarer.cli.sim import RUNNING, AnomalySource, DepthOption

EXAMPLES = """Examples:

wayfarer sweep escape.turn_angle_deg=10:180:10 --trials 200 --out angles

wayfarer sweep footprint_m=0.2,0.4,0.6,0.8 slip_mean_m=2,5,10 --spl --out body

wayfarer sweep ground=ideal,leaf-litter,dry-soil,mud --out grounds

wayfarer sweep sim.compass_noise_deg=0:20:2 --algorithm paper --forests reference --out noise

wayfarer report angles
"""


def sweep(
    keys: Annotated[
        list[str],
        typer.Argument(
            metavar="KEY=VALUES...",
            help="One key or two, each FIRST:LAST:STEP or a list. Any key of a rover file by its dotted name; "
            "footprint_m, length and width together; slip_mean_m; budget_m; ground; sim.trees_per_ha; "
            "sim. and any number of the simulated world.",
        ),
    ],
    *,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="New or empty folder for the results.", rich_help_panel=RUNNING)
    ],
    trials: Annotated[
        int, typer.Option(min=1, max=1_000_000, metavar="N", help="Trials of each algorithm at each point.")
    ] = 200,
    algorithm: Annotated[
        str, typer.Option(metavar="NAME[,NAME...]|paper", help="Escape algorithms; 'paper' means all ten of the paper.")
    ] = "forest-pledge",
    forests: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|reference",
            help="Forest file, used in file order; 'reference': the 500 of the paper's released simulator. Default: "
            "generated layouts, each with two noise seeds.",
        ),
    ] = None,
    rover: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="Name of a built-in rover, or a rover file (TOML).")
    ] = "sim",
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Random seed of the campaign.")] = 0,
    slip_mean_m: Annotated[float, typer.Option(metavar="M", help="Mean distance between slip events.")] = 10.0,
    budget_m: Annotated[
        float, typer.Option(metavar="M", help="Path length after which a rover counts as entrapped.")
    ] = 1000.0,
    anomaly_source: Annotated[
        AnomalySource | None,
        typer.Option(
            help="Detect an obstacle by lack of motion, or by contact as well. (default: from the rover file)"
        ),
    ] = None,
    depth: Annotated[
        DepthOption, typer.Option(help="device: simulated parts; bus: the real drivers over simulated chips (slower).")
    ] = DepthOption.device,
    spl: Annotated[
        bool,
        typer.Option(
            "--spl", help="Compute unknown shortest paths, for SPL (success weighted by path length); slower."
        ),
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Number of processes. (default: one per core)", rich_help_panel=RUNNING),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the interrupted sweep in --out.", rich_help_panel=RUNNING)
    ] = False,
) -> None:
    """Run the same trials at each point of a grid of settings, and show how the results change."""
    require("sweeping")
    from wayfarer.config.rover_file import load_rover
    from wayfarer.experiments.campaign import Campaign, read_forest_file
    from wayfarer.experiments.commands import algorithms, check_body, check_rover, cores
    from wayfarer.experiments.sweep.axes import parse_axis
    from wayfarer.experiments.sweep.command import run_all
    from wayfarer.experiments.sweep.grid import make_sweep

    config = load_rover(rover)
    campaign = Campaign(
        algorithms(algorithm),
        trials,
        config.with_anomaly_source(anomaly_source.value) if anomaly_source else config,
        seed=seed,
        slip_mean_m=slip_mean_m,
        budget_m=budget_m,
        spl=spl,
        depth=depth.value,
        forests=read_forest_file(forests) if forests else None,
    )
    plan = make_sweep(campaign, [parse_axis(text) for text in keys])
    for point in plan.points:
        check_body(point.campaign, rover)
        check_rover(point.campaign.rover, point.campaign.depth, rover)
    raise typer.Exit(run_all(plan, out, resume=resume, jobs=jobs or cores()))
