"""``wayfarer sweep``: how much the results depend on a setting."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from wayfarer.cli import trial_options as options
from wayfarer.cli.options import AsJson, command_line, complete_settings, examples
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

TRIALS = 200  # at each point: a sweep has several

Keys = Annotated[
    list[str],
    typer.Argument(
        metavar="KEY=VALUES",
        autocompletion=complete_settings,
        help="One key or two, each FIRST:LAST:STEP or a list, such as escape.turn_angle_deg=10:180:10 or "
        "sim.trees_per_ha=40,80. The keys are those of --set; wayfarer list --keys names them all.",
    ),
]


def sweep(
    ctx: typer.Context,
    keys: Keys,
    *,
    asked: dict[str, Any],
    out: options.Out,
    jobs: options.Jobs = None,
    resume: options.Resume = False,
    as_json: AsJson = False,
) -> None:
    """Run the same trials at each point of a grid of settings, and show how the results change."""
    require("simulating")
    from wayfarer.cli.run_trials import run_all
    from wayfarer.experiments.checks import check_points, make_campaign
    from wayfarer.experiments.settings import option_of
    from wayfarer.experiments.sweep import make_sweep, parse_axis

    axes = [parse_axis(text) for text in keys]
    plan = make_sweep(make_campaign(asked, option_of, [axis.key for axis in axes]), axes)
    check_points(plan.points, str(asked.get("rover", "sim")))
    raise typer.Exit(run_all(plan, out, resume=resume, jobs=jobs, as_json=as_json, command=command_line(ctx)))
