"""``wayfarer sim``: trials of the rover's own code in simulated forests."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli.extras import require
from wayfarer.errors import BadInput

EXAMPLES = """Examples:

wayfarer sim --trials 1000 --out results

wayfarer sim --trials 1000 --out results --resume

wayfarer sim --trials 200 --algorithm paper --slip-mean-m 2

wayfarer sim --trials 500 --algorithm paper --forests reference

wayfarer sim --algorithm levy-walk,my_rules:spiral --spl

wayfarer sim --trial 17 --log logs/17

wayfarer sim --trials 50 --log logs

wayfarer sim --trials 100 --rover minirover --depth bus

wayfarer sim --scenario extended-maze --rover forestrover --algorithm forest-pledge,levy-walk --trials 200

wayfarer sim --ground mud --trials 200

wayfarer sim --physics mujoco --friction 0.3:0.8 --rover forestrover --trials 20

wayfarer sim --physics mujoco --friction 0.15 --rover forestrover --trial 9 --video trial.mp4

wayfarer sim --trials 1000000 --out results --cluster tcp://10.0.0.7:8786
"""
RUNNING = "Running"
ONE_TRIAL = "One trial again"
MUJOCO = "Physics mujoco"


class SiteOption(StrEnum):
    """The sites of the paper's field trials."""

    extended_maze = "extended-maze"
    dense_obstruction = "dense-obstruction"
    forest_escape = "forest-escape"


class AnomalySource(StrEnum):
    """How the rover detects that it is blocked."""

    motion = "motion"
    contact = "contact"


class DepthOption(StrEnum):
    """The depth of the simulation: simulated parts, or simulated chips under the real drivers."""

    device = "device"
    bus = "bus"


class GroundOption(StrEnum):
    """The ground under the wheels in physics-light; the names of ``simhal.world.grounds``."""

    ideal = "ideal"
    leaf_litter = "leaf-litter"
    dry_soil = "dry-soil"
    mud = "mud"


class PhysicsOption(StrEnum):
    """The physics that moves the body."""

    light = "light"
    mujoco = "mujoco"


def _positive(value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value:g} is not a finite number above 0")
    return value


def sim(
    *,
    trials: Annotated[int, typer.Option(min=1, max=1_000_000, metavar="N", help="Trials of each algorithm.")] = 1000,
    algorithm: Annotated[
        str,
        typer.Option(
            metavar="NAME[,NAME...]|paper",
            help="Escape algorithms; 'paper' means all ten of the paper. A name given twice runs once.",
        ),
    ] = "forest-pledge",
    forests: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|reference",
            help="Forest file, used in file order; 'reference': the 500 of the paper's released simulator. Default: "
            "generated layouts, each with two noise seeds.",
        ),
    ] = None,
    scenario: Annotated[
        SiteOption | None,
        typer.Option(help="A site of the paper's field trials instead of a forest; each trial has its own layout."),
    ] = None,
    rover: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="Name of a built-in rover, or a rover file (TOML).")
    ] = "sim",
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Random seed of the campaign.")] = 0,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Number of processes. (default: one per core)", rich_help_panel=RUNNING),
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Run on the workers of this Dask scheduler instead of local processes.",
            rich_help_panel=RUNNING,
        ),
    ] = None,
    slip_mean_m: Annotated[
        float, typer.Option(callback=_positive, metavar="M", help="Mean distance between slip events.")
    ] = 10.0,
    budget_m: Annotated[
        float,
        typer.Option(callback=_positive, metavar="M", help="Path length after which a rover counts as entrapped."),
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
    physics: Annotated[
        PhysicsOption,
        typer.Option(help="light: fast built-in physics; mujoco: rigid bodies, wheels that grip and slip (slower)."),
    ] = PhysicsOption.light,
    ground: Annotated[
        GroundOption,
        typer.Option(
            help="Ground in physics-light: on 'ideal' the rover turns as commanded, on the others wheels slip."
        ),
    ] = GroundOption.ideal,
    friction: Annotated[
        str | None,
        typer.Option(
            metavar="MU|MIN:MAX",
            help="Friction of tyres on ground and bark, fixed or drawn for each trial. (default: 0.5)",
            rich_help_panel=MUJOCO,
        ),
    ] = None,
    roughness_m: Annotated[
        str | None,
        typer.Option(
            metavar="M|MIN:MAX",
            help="Standard deviation of the ground's height; slower above 0. (default: 0)",
            rich_help_panel=MUJOCO,
        ),
    ] = None,
    torque_scale: Annotated[
        str | None,
        typer.Option(
            metavar="X|MIN:MAX",
            help="Stall torque over the rover file's chassis.motors_n_m; 3 if that is the rated torque. (default: 1)",
            rich_help_panel=MUJOCO,
        ),
    ] = None,
    spl: Annotated[
        bool,
        typer.Option(
            "--spl", help="Compute unknown shortest paths, for SPL (success weighted by path length); slower."
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="New or empty folder for trials.csv and summary.json.",
            rich_help_panel=RUNNING,
        ),
    ] = None,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Continue the interrupted campaign in --out.", rich_help_panel=RUNNING),
    ] = False,
    trial: Annotated[
        int | None,
        typer.Option(min=0, metavar="N", help="Run this one trial and print its row.", rich_help_panel=ONE_TRIAL),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="New or empty folder for the trials' full field logs; slower."),
    ] = None,
    video: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a film of this trial (needs --physics mujoco): FILE.mp4 or FILE.webp; slower.",
            rich_help_panel=ONE_TRIAL,
        ),
    ] = None,
    video_speed: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=100.0,
            metavar="X",
            help="Speed of the film relative to the trial. (default: 1)",
            rich_help_panel=ONE_TRIAL,
        ),
    ] = None,
) -> None:
    """Run the rover's code in simulated forests, and print success rate and path length per algorithm."""
    _refuse_odd_pairs(out, resume, trial, log)
    if scenario and forests:
        raise BadInput("--scenario draws its own layouts; leave out --forests, or --scenario")
    terrain = {"friction": friction, "roughness_m": roughness_m, "torque_scale": torque_scale}
    _refuse_without_mujoco(physics, terrain)
    _refuse_what_cannot_be_filmed(physics, trial, video, video_speed)
    if ground is not GroundOption.ideal and physics is PhysicsOption.mujoco:
        raise BadInput(
            f"--ground {ground} belongs to physics-light; with --physics mujoco use --friction, or leave it out"
        )
    require("simulating")
    if physics is PhysicsOption.mujoco:
        require("--physics mujoco")
    if video:
        require("--video")
        from wayfarer.experiments.film.screen import backend

        backend()  # before the engine is imported, whose own words about missing OpenGL would be a traceback
    if out:
        require("keeping results")
    if cluster is not None:
        _refuse_beside_cluster(jobs, trial, log)
        require("a cluster")
    from wayfarer.config.rover_file import load_rover
    from wayfarer.experiments import commands
    from wayfarer.experiments.campaign import Campaign, read_forest_file
    from wayfarer.simhal.world.grounds import GroundName

    config = load_rover(rover)
    campaign = Campaign(
        commands.algorithms(algorithm),
        trials,
        config.with_anomaly_source(anomaly_source.value) if anomaly_source else config,
        seed=seed,
        slip_mean_m=slip_mean_m,
        budget_m=budget_m,
        spl=spl,
        depth=depth.value,
        forests=read_forest_file(forests) if forests else None,
        terrains=commands.terrains(terrain) if physics is PhysicsOption.mujoco else None,
        ground=GroundName(ground.value),
    )
    if scenario:
        campaign = commands.at_site(campaign, scenario.value)
    commands.check_body(campaign, rover)
    commands.check_rover(campaign.rover, campaign.depth, rover)
    if trial is None:
        raise typer.Exit(
            commands.run_all(campaign, out, resume=resume, jobs=jobs, cluster=cluster, forests=forests, log=log)
        )
    if video:
        raise typer.Exit(commands.film_alone(campaign, trial, log, video, video_speed or 1.0))
    raise typer.Exit(commands.run_alone(campaign, trial, log))


def _refuse_odd_pairs(out: Path | None, resume: bool, trial: int | None, log: Path | None) -> None:
    if resume and not out:
        raise BadInput("--resume continues the campaign in a folder; name it with --out DIR")
    if log and resume:
        raise BadInput("--log needs every trial to run again; leave out --resume, or --log")
    if out and trial is not None:
        raise BadInput("--trial runs one trial and prints its row, and writes no folder; leave out --out")


def _refuse_without_mujoco(physics: PhysicsOption, terrain: dict[str, str | None]) -> None:
    given = [name for name, text in terrain.items() if text is not None]
    if given and physics is PhysicsOption.light:
        raise BadInput(
            f"--{given[0].replace('_', '-')} has an effect only with --physics mujoco; add that, or leave it out"
        )


def _refuse_what_cannot_be_filmed(
    physics: PhysicsOption, trial: int | None, video: Path | None, video_speed: float | None
) -> None:
    if video is None:
        if video_speed is not None:
            raise BadInput("--video-speed needs a film; name its file with --video FILE")
    elif physics is PhysicsOption.light:
        raise BadInput("--video works only with MuJoCo; add --physics mujoco")
    elif trial is None:
        raise BadInput("--video films one trial; choose it with --trial N")


def _refuse_beside_cluster(jobs: int | None, trial: int | None, log: Path | None) -> None:
    if jobs is not None:
        raise BadInput("--jobs sets local processes, and --cluster uses remote workers; leave one of them out")
    if trial is not None:
        raise BadInput("--trial runs one trial here; leave out --cluster")
    if log is not None:
        raise BadInput("--log would be written on the machines of the cluster; leave out --log, or --cluster")
