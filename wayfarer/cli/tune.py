"""``wayfarer tune``: a search for better settings of a rover."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from wayfarer.cli import trial_options as options
from wayfarer.cli.options import AlgorithmOption, AsJson, check_together, command_line, examples
from wayfarer.extras import require

EXAMPLES = examples(
    "wayfarer tune --out tuned",
    "wayfarer tune --out tuned --resume",
    "wayfarer tune --rover forestrover --forests reference --ground leaf-litter --slip-mean-m 2 --out litter",
    "wayfarer tune --site dense-obstruction --rover minirover --objective time --out clutter",
    "wayfarer tune --search escape.turn_angle_deg=10:90 --search escape.back_off_m=0.05:0.5:log --points 40 --out two",
    "wayfarer sim --rover tuned/tuned.toml --forests tuned/held-out/light/tuned/forests.jsonl --trials 400",
)
CONFIRMING = "Confirming"

Search = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=LOW:HIGH[:log]",
        help="A number of the rover file and its bounds; several times for several keys. "
        "(default: turn angle, back-off, probe, reset and stall detection around their present values)",
    ),
]
Objective = Annotated[
    Literal["spl", "time", "anomalies"] | None,
    typer.Option(help="What to make better. (default: spl; at a site time)"),
]
Points = Annotated[int, typer.Option(min=1, max=10_000, metavar="N", help="Number of settings to try.")]
Trials = Annotated[
    int, typer.Option(min=2, max=100_000, metavar="N", help="Trials of each of them, all on the same forests.")
]
ConfirmTrials = Annotated[
    int,
    typer.Option(
        min=2,
        max=100_000,
        metavar="N",
        rich_help_panel=CONFIRMING,
        help="Trials of the present and of the best settings on held-out forests.",
    ),
]
ConfirmMujoco = Annotated[
    int,
    typer.Option(
        min=0,
        max=100_000,
        metavar="N",
        rich_help_panel=CONFIRMING,
        help="The same in MuJoCo, for a rover with a chassis; 0 for none. A trial takes seconds.",
    ),
]


def tune(
    ctx: typer.Context,
    *,
    out: options.Out,
    search: Search = None,
    objective: Objective = None,
    points: Points = 96,
    trials: Trials = 200,
    algorithm: AlgorithmOption = "forest-pledge",
    rover: options.RoverName = "sim",
    forests: options.Forests = None,
    site: options.SiteOption = None,
    ground: options.GroundOption = "ideal",
    slope_deg: options.SlopeDeg = None,
    slope_direction_deg: options.SlopeDirectionDeg = None,
    slip_mean_m: options.SlipMeanM = 10.0,
    budget_m: options.BudgetM = 1000.0,
    senses: options.SensesOption = "ideal",
    seed: options.Seed = 0,
    confirm_trials: ConfirmTrials = 400,
    confirm_mujoco: ConfirmMujoco = 40,
    jobs: options.Jobs = None,
    cluster: options.ClusterAddress = None,
    resume: options.Resume = False,
    as_json: AsJson = False,
) -> None:
    """Search for better settings of a rover, and confirm the best ones on forests that the search never saw."""
    check_together(ctx, excludes=(("site", "forests"), ("jobs", "cluster")))
    for needed in ("sweeping", "comparing", "a report", "tuning", *(["a cluster"] if cluster is not None else [])):
        require(needed)
    from wayfarer.experiments.make_campaign import make_campaign
    from wayfarer.experiments.tuning.command import HeldOutTrials, run_all
    from wayfarer.experiments.tuning.make_plan import make_plan

    campaign = make_campaign(
        algorithm, rover=rover, forests=forests, senses=senses, site=site, trials=trials, seed=seed,
        slip_mean_m=slip_mean_m, budget_m=budget_m, ground=ground,
        slope_deg=slope_deg, slope_direction_deg=slope_direction_deg,
    )  # fmt: skip
    plan = make_plan(campaign, search or [], objective or ("spl" if site is None else "time"), points)
    code = run_all(
        plan, rover, HeldOutTrials(confirm_trials, confirm_mujoco), out, resume=resume, jobs=jobs, cluster=cluster,
        as_json=as_json, command=command_line(ctx),
    )  # fmt: skip
    raise typer.Exit(code)
