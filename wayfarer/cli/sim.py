"""``wayfarer sim``: trials of the rover's own code in simulated forests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli import trial_options as options
from wayfarer.cli.options import AsJson, Faults, check_together, command_line, examples
from wayfarer.cli.trial_options import RUNNING
from wayfarer.extras import require

EXAMPLES = examples(
    "wayfarer sim --trials 1000 --out results",
    "wayfarer sim --trials 1000 --out results --resume",
    "wayfarer sim --trials 200 --algorithm paper --slip-mean-m 2",
    "wayfarer sim --trials 500 --algorithm paper --forests reference",
    "wayfarer sim --algorithm levy-walk,my_rules:spiral --spl",
    "wayfarer sim --trial 17 --log-dir logs/17",
    "wayfarer sim --trials 50 --log-dir logs",
    "wayfarer sim --trials 100 --rover minirover --depth bus",
    "wayfarer sim --site extended-maze --rover forestrover --algorithm forest-pledge,levy-walk --trials 200",
    "wayfarer sim --ground mud --trials 200",
    "wayfarer sim --senses field --trials 200",
    "wayfarer sim --fault silent:compass --trials 200",
    "wayfarer sim --slope-deg 0:15 --slope-direction-deg 0:360 --trials 200",
    "wayfarer sim --physics mujoco --friction 0.3:0.8 --rover forestrover --trials 20",
    "wayfarer sim --trials 1000000 --out results --cluster tcp://10.0.0.7:8786",
)
TRIALS, MOST_TRIALS = 1000, 1_000_000
ONE_TRIAL = "One trial again"

Trials = Annotated[
    int | None,
    typer.Option(min=1, max=MOST_TRIALS, metavar="N", help=f"Trials of each algorithm. (default: {TRIALS})"),
]
Out = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="New or empty folder for trials.csv.",
        rich_help_panel=RUNNING,
    ),
]
TrialNumber = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=MOST_TRIALS - 1,
        metavar="N",
        help="Run this one trial and print its row.",
        rich_help_panel=ONE_TRIAL,
    ),
]
LogDir = Annotated[
    Path | None, typer.Option(metavar="DIR", help="New or empty folder for the trials' full field logs; slower.")
]

# Of each pair, the first option has no effect without the second.
NEEDS = (("resume", "out"), *options.WORLD_NEEDS)
EXCLUDES = (
    ("log_dir", "resume"),  # each trial that is logged has to run again
    ("trial", "trials"),  # one trial is the same in a campaign of any size
    ("trial", "out"),  # one trial prints its row, and writes no folder
    *options.WORLD_EXCLUDES,
    ("jobs", "cluster"),
    ("trial", "cluster"),
    ("log_dir", "cluster"),  # logs would be written on the machines of the cluster
)


def sim(
    ctx: typer.Context,
    *,
    trials: Trials = None,
    algorithm: options.AlgorithmNames = "forest-pledge",
    forests: options.Forests = None,
    site: options.SiteOption = None,
    rover: options.RoverName = "sim",
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    cluster: options.ClusterAddress = None,
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
    fault: Faults = None,
    spl: options.Spl = False,
    out: Out = None,
    resume: options.Resume = False,
    trial: TrialNumber = None,
    log_dir: LogDir = None,
    as_json: AsJson = False,
) -> None:
    """Run the rover's code in simulated forests, and print success rate and path length per algorithm."""
    check_together(ctx, needs=NEEDS, excludes=EXCLUDES)
    require("simulating")
    if cluster is not None:
        require("a cluster")
    from wayfarer.experiments import sim_command
    from wayfarer.experiments.make_campaign import make_campaign

    campaign = make_campaign(
        algorithm, rover=rover, anomaly_source=anomaly_source, forests=forests, senses=senses, site=site,
        trials=trials or (TRIALS if trial is None else trial + 1), seed=seed, slip_mean_m=slip_mean_m,
        budget_m=budget_m, spl=spl, depth=depth, ground=ground, physics=physics, friction=friction,
        roughness_m=roughness_m, torque_scale=torque_scale, slope_deg=slope_deg,
        slope_direction_deg=slope_direction_deg, faults=fault or (),
    )  # fmt: skip
    if trial is None:
        code = sim_command.run_all(
            campaign, out, resume=resume, jobs=jobs, cluster=cluster, forests=forests, log=log_dir, as_json=as_json,
            command=command_line(ctx),
        )  # fmt: skip
        raise typer.Exit(code)
    sim_command.run_alone(campaign, trial, log_dir, as_json=as_json)
