"""``wayfarer sim``: trials of the rover's own code in simulated forests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from wayfarer.cli import trial_options as options
from wayfarer.cli.options import AsJson, check_together, command_line, examples
from wayfarer.cli.trial_options import RUNNING, PhysicsName
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
    "wayfarer sim --slope-deg 0:15 --slope-direction-deg 0:360 --trials 200",
    "wayfarer sim --physics mujoco --friction 0.3:0.8 --rover forestrover --trials 20",
    "wayfarer sim --physics mujoco --friction 0.15 --rover forestrover --trial 9 --video trial.mp4",
    "wayfarer sim --trials 1000000 --out results --cluster tcp://10.0.0.7:8786",
)
TRIALS, MOST_TRIALS = 1000, 1_000_000
ONE_TRIAL = "One trial again"
MUJOCO = "Physics mujoco"

SiteName = Literal["extended-maze", "dense-obstruction", "forest-escape"]  # the names of ``simhal.world.sites``
Ground = Literal["ideal", "leaf-litter", "dry-soil", "mud"]  # the names of ``simhal.world.physics``

Trials = Annotated[
    int | None,
    typer.Option(min=1, max=MOST_TRIALS, metavar="N", help=f"Trials of each algorithm. (default: {TRIALS})"),
]
SiteOption = Annotated[
    SiteName | None,
    typer.Option(
        metavar="SITE",
        help="A site of the paper's field trials instead of a forest, with another layout in each trial: "
        "extended-maze, dense-obstruction or forest-escape.",
    ),
]
ClusterAddress = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Run on the workers of this Dask scheduler instead of local processes.",
        rich_help_panel=RUNNING,
    ),
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
Out = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="New or empty folder for trials.csv, trials.parquet and summary.json.",
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
Video = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Write a film of this trial (needs --physics mujoco): FILE.mp4 or FILE.webp; slower.",
        rich_help_panel=ONE_TRIAL,
    ),
]
VideoSpeed = Annotated[
    float | None,
    typer.Option(
        min=0.1,
        max=100.0,
        metavar="X",
        help="Speed of the film relative to the trial. (default: 1)",
        rich_help_panel=ONE_TRIAL,
    ),
]


# Of each pair, the first option has no effect without the second.
NEEDS = (
    ("resume", "out"),
    ("friction", "physics mujoco"),
    ("roughness_m", "physics mujoco"),
    ("torque_scale", "physics mujoco"),
    ("video", "physics mujoco"),
    ("video", "trial"),
    ("video_speed", "video"),
)
EXCLUDES = (
    ("log_dir", "resume"),  # each trial that is logged has to run again
    ("trial", "trials"),  # one trial is the same in a campaign of any size
    ("trial", "out"),  # one trial prints its row, and writes no folder
    ("site", "forests"),  # a site draws its own layouts
    ("ground leaf-litter", "physics mujoco"),  # which has --friction instead
    ("ground dry-soil", "physics mujoco"),
    ("ground mud", "physics mujoco"),
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
    site: SiteOption = None,
    rover: options.RoverName = "sim",
    seed: options.Seed = 0,
    jobs: options.Jobs = None,
    cluster: ClusterAddress = None,
    slip_mean_m: options.SlipMeanM = 10.0,
    budget_m: options.BudgetM = 1000.0,
    anomaly_source: options.AnomalySource = None,
    depth: options.DepthOption = "device",
    physics: PhysicsOption = "light",
    ground: GroundOption = "ideal",
    slope_deg: SlopeDeg = None,
    slope_direction_deg: SlopeDirectionDeg = None,
    friction: Friction = None,
    roughness_m: RoughnessM = None,
    torque_scale: TorqueScale = None,
    senses: options.SensesOption = "ideal",
    spl: options.Spl = False,
    out: Out = None,
    resume: options.Resume = False,
    trial: TrialNumber = None,
    log_dir: LogDir = None,
    video: Video = None,
    video_speed: VideoSpeed = None,
    as_json: AsJson = False,
) -> None:
    """Run the rover's code in simulated forests, and print success rate and path length per algorithm."""
    check_together(ctx, needs=NEEDS, excludes=EXCLUDES)
    in_mujoco = physics == "mujoco"
    _require(in_mujoco, video, out, cluster)
    from wayfarer.experiments import commands, sim_command
    from wayfarer.experiments.make_campaign import make_campaign

    terrain = {"friction": friction, "roughness_m": roughness_m, "torque_scale": torque_scale}
    campaign = make_campaign(
        algorithm, rover=rover, anomaly_source=anomaly_source, forests=forests, senses=senses, site=site,
        trials=trials or (TRIALS if trial is None else trial + 1), seed=seed, slip_mean_m=slip_mean_m,
        budget_m=budget_m, spl=spl, depth=depth,
        terrains=commands.terrains(terrain) if in_mujoco else None, ground=ground,
        slopes=commands.slopes({"slope_deg": slope_deg, "slope_direction_deg": slope_direction_deg}),
    )  # fmt: skip
    if trial is None:
        code = sim_command.run_all(
            campaign, out, resume=resume, jobs=jobs, cluster=cluster, forests=forests, log=log_dir, as_json=as_json,
            command=command_line(ctx),
        )  # fmt: skip
        raise typer.Exit(code)
    if video:
        raise typer.Exit(sim_command.film_alone(campaign, trial, log_dir, video, video_speed or 1.0, as_json=as_json))
    raise typer.Exit(sim_command.run_alone(campaign, trial, log_dir, as_json=as_json))


def _require(in_mujoco: bool, video: Path | None, out: Path | None, cluster: str | None) -> None:
    """Refuse to continue without the packages that a run needs."""
    require("simulating")
    if in_mujoco:
        require("--physics mujoco")
    if video:
        require("--video")
    if out:
        require("keeping results")
    if cluster is not None:
        require("a cluster")
