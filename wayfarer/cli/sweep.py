"""``wayfarer sweep``: how much the results depend on a setting."""

from __future__ import annotations

from typing import Annotated

import typer

from wayfarer.cli import trial_options as options
from wayfarer.cli.options import AsJson, check_together, command_line, complete_sweep_keys, examples
from wayfarer.extras import require

EXAMPLES = examples(
    "wayfarer sweep escape.turn_angle_deg=10:180:10 --trials 200 --out angles",
    "wayfarer sweep footprint_m=0.2,0.4,0.6,0.8 slip_mean_m=2,5,10 --spl --out body",
    "wayfarer sweep ground=ideal,leaf-litter,dry-soil,mud --out grounds",
    "wayfarer sweep escape.back_off_m=0.1,0.2,0.4 --site dense-obstruction --rover minirover --out clutter",
    "wayfarer sweep sim.friction=0.3,0.5,0.8 --physics mujoco --rover forestrover --trials 20 --out friction",
    "wayfarer sweep sim.compass_noise_deg=0:20:2 --algorithm paper --forests reference --out noise",
    "wayfarer report angles",
)

Keys = Annotated[
    list[str],
    typer.Argument(
        metavar="KEY=VALUES",
        autocompletion=complete_sweep_keys,
        help="One key or two, each FIRST:LAST:STEP or a list. Any key of a rover file by its dotted name; "
        "footprint_m, length and width together; slip_mean_m; budget_m; ground; sim.trees_per_ha; "
        "sim. and any number of the simulated world, as sim.friction with --physics mujoco.",
    ),
]
Trials = Annotated[int, typer.Option(min=1, max=1_000_000, metavar="N", help="Trials of each algorithm at each point.")]


def sweep(
    ctx: typer.Context,
    keys: Keys,
    *,
    out: options.Out,
    trials: Trials = 200,
    algorithm: options.AlgorithmNames = "forest-pledge",
    forests: options.Forests = None,
    site: options.SiteOption = None,
    rover: options.RoverName = "sim",
    seed: options.Seed = 0,
    slip_mean_m: options.SlipMeanM = 10.0,
    budget_m: options.BudgetM = 1000.0,
    anomaly_source: options.AnomalySource = None,
    depth: options.DepthOption = "device",
    physics: options.PhysicsOption = "light",
    ground: options.GroundOption = "ideal",
    slope_deg: options.SlopeDeg = None,
    slope_direction_deg: options.SlopeDirectionDeg = None,
    friction: options.Friction = None,
    roughness_m: options.RoughnessM = None,
    torque_scale: options.TorqueScale = None,
    senses: options.SensesOption = "ideal",
    spl: options.Spl = False,
    jobs: options.Jobs = None,
    resume: options.Resume = False,
    as_json: AsJson = False,
) -> None:
    """Run the same trials at each point of a grid of settings, and show how the results change."""
    check_together(ctx, needs=options.WORLD_NEEDS, excludes=options.WORLD_EXCLUDES)
    require("simulating")
    from wayfarer.experiments.commands import check_points
    from wayfarer.experiments.make_campaign import make_campaign
    from wayfarer.experiments.pool import cores
    from wayfarer.experiments.sweep import make_sweep, parse_axis
    from wayfarer.experiments.sweep_command import run_all

    campaign = make_campaign(
        algorithm, rover=rover, anomaly_source=anomaly_source, forests=forests, senses=senses, site=site,
        trials=trials, seed=seed, slip_mean_m=slip_mean_m, budget_m=budget_m, spl=spl, depth=depth, ground=ground,
        physics=physics, friction=friction, roughness_m=roughness_m, torque_scale=torque_scale, slope_deg=slope_deg,
        slope_direction_deg=slope_direction_deg,
    )  # fmt: skip
    plan = make_sweep(campaign, [parse_axis(text) for text in keys])
    check_points(plan.points, rover)
    raise typer.Exit(
        run_all(plan, out, resume=resume, jobs=jobs or cores(), as_json=as_json, command=command_line(ctx))
    )
