"""Implementation of ``wayfarer sim`` after its options are parsed: a whole campaign, or one trial."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from wayfarer.config.chassis import AT_A_BRANCH
from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import RoverConfig, with_place
from wayfarer.errors import BadConfig, BadInput, MissingPackage
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.experiments import run_campaign as campaigns
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.executors import RunTrial, TrialRunner, field_trial, logged_trial
from wayfarer.experiments.progress_bar import drawing, fault_line, say, shown_progress
from wayfarer.experiments.results_folder import ResultsFolder
from wayfarer.experiments.rows import columns_of, csv_line
from wayfarer.experiments.run_campaign import CampaignResult
from wayfarer.experiments.tables import FORESTS, Layout, print_table
from wayfarer.simhal.world.forest_file import content_of
from wayfarer.simhal.world.grounds import GroundName

if TYPE_CHECKING:
    from wayfarer.experiments.dask_cluster import Cluster
    from wayfarer.simhal.mujoco.terrain import Terrains
    from wayfarer.simhal.world.wheeled_body import WheeledBody

PAPER = "paper"  # stands for the ten of the paper, which are the catalogue
INTERRUPTED = 130  # as a shell reports a command that SIGINT ended
FAULT_FILE = "fault.txt"
LEGEND = "success: escaped or left bounds; path: of the successes; time, anomalies: mean a trial"
SITE_LEGEND = "time: from arming to the destination line, of the successes; interventions (overturned/off its wheels)"


def algorithms(names: str) -> tuple[str, ...]:
    """Return the algorithms that a comma-separated list names, each once, in the order asked.

    Raises:
        UnknownName: no such algorithm; the text offers the nearest names.
        BadInput: a third party's algorithm cannot be loaded.
    """
    asked = [name.strip() for name in names.split(",")]
    unfolded = dict.fromkeys(name for item in asked for name in (CATALOGUE if item == PAPER else [item]))
    for name in unfolded:
        find_algorithm(name)
    return tuple(unfolded)


def terrains(asked: Mapping[str, str | None]) -> Terrains:
    """Return the terrains that options ask for, by the names of their fields; the rest as by default.

    Raises:
        BadInput: an option is no number or range, or out of bounds.
    """
    from wayfarer.simhal.mujoco.terrain import BOUNDS, Terrains, parse_range

    ranges = {
        name: parse_range(f"--{name.replace('_', '-')}", text, getattr(BOUNDS, name))
        for name, text in asked.items()
        if text is not None
    }
    return Terrains(**ranges)


def check_body(campaign: Campaign, where: str) -> None:
    """Make sure that wheels that slip can have this rover's body, before the first trial; ``where`` as ``check_rover``.

    Raises:
        BadConfig: its file does not say enough of the body, or says what cannot be built.
    """
    from wayfarer.simhal.world.wheeled_body import body_of

    if campaign.terrains is None and campaign.ground is GroundName.ideal:
        return
    asked_by = f"--ground {campaign.ground}" if campaign.terrains is None else "--physics mujoco"
    rover = campaign.rover
    try:
        body = body_of(rover.name, rover.vehicle, rover.chassis, asked_by)
    except BadConfig as error:
        raise BadConfig(f"{where}: {error}") from None
    if campaign.terrains is not None:
        _check_model(body, where)


def _check_model(body: WheeledBody, where: str) -> None:
    """Make sure that the engine takes this body.

    Raises:
        BadConfig: it does not.
    """
    from wayfarer.simhal.mujoco.model import build
    from wayfarer.simhal.mujoco.terrain import Terrain

    try:
        build(body, Terrain(0.5, 0.0, 1.0), None, [])
    except ValueError as error:
        what = " ".join(str(error).split())
        raise BadConfig(f"{where}: MuJoCo cannot build this rover ({what}); correct its vehicle or chassis") from None


def check_rover(config: RoverConfig, depth: str, where: str) -> None:
    """Build a rover once: what would end every trial in a fault is told before the first.

    Args:
        config: the rover.
        depth: ``device`` or ``bus``.
        where: the rover's file, or the name of a shipped one.

    Raises:
        BadConfig: at bus depth the rover wants a part, or a chip for one; at device depth every rover can be built.
            The text names file, key and line.
        MissingPackage: at bus depth one of its drivers needs a package that is not installed.
    """
    if depth == "device":
        return
    from wayfarer.config.factory import NEEDED
    from wayfarer.simhal.build_rover import Depth, bus_depth, missing_package
    from wayfarer.simhal.buses import ChipMisuse, FakeBuses
    from wayfarer.simhal.random_streams import RandomStreams
    from wayfarer.simhal.world.forest import Forest
    from wayfarer.simhal.world.physics import Physics
    from wayfarer.simhal.world.world import World

    if missing := [part for part in NEEDED if part not in config.parts]:
        lacks = f"rover '{config.name}' has no [parts.{missing[0]}] to run the driver of; use --depth device"
        raise BadConfig(with_place(where, f"key 'parts.{missing[0]}' is missing: {lacks}"))
    if why := missing_package(config, Depth.BUS):
        raise MissingPackage(f"{why}; or use --depth device")
    clearing, streams = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ()), RandomStreams(0)
    world = World(clearing, config.vehicle, Physics(), streams)
    try:
        bus_depth(world, streams, config, lambda: 0.0, FakeBuses())
    except BadConfig as error:
        raise BadConfig(with_place(where, str(error))) from None
    except ChipMisuse as error:
        raise BadConfig(f"{where}: {error}; correct its parts") from None


def at_site(campaign: Campaign, scenario: str) -> Campaign:
    """Return a campaign whose trials take place at the site of a scenario, with a receiver where it logs positions.

    Raises:
        BadConfig: the rover's file does not say how it meets a branch.
    """
    if missing := campaign.rover.chassis.missing(AT_A_BRANCH):
        raise BadConfig(
            f"rover '{campaign.rover.name}' gives no chassis.{missing[0]}, and --scenario asks how it meets a branch;"
            " take --rover forestrover or minirover, or add it to [chassis] of its file as theirs have it"
        )
    here = replace(campaign, scenario=scenario)
    return replace(here, rover=here.site.equip(campaign.rover)) if here.site else here


def run_all(
    campaign: Campaign,
    out: Path | None,
    *,
    resume: bool = False,
    jobs: int | None = None,
    cluster: str | None = None,
    forests: str | Path | None = None,
    log: Path | None = None,
    run_trial: RunTrial = field_trial,
) -> int:
    """Run a campaign, show it, print its table, and return the exit code.

    ``forests`` is what the campaign's forests were read from (``campaign.read_forest_file``); ``out`` keeps a copy.
    With ``log`` each trial's full field log goes into a separate folder there. With ``cluster``, the address of a
    Dask scheduler, the trials run on its workers, else in ``jobs`` processes.

    Raises:
        BadInput: ``out`` cannot be used, or there is no such cluster; nothing is left behind then. ``log`` is not new
            or empty.
        WayfarerError: a worker died, the cluster was lost, or ``out`` cannot be written any more; finished trials are
            kept.
    """
    aside = Console(stderr=True)
    total = len(campaign.algorithms) * campaign.trials
    if log:
        make_empty_folder(log, "the log")
        run_trial = partial(logged_trial, log)
    with (
        _connected(cluster) as workers,
        ResultsFolder(out, campaign.settings(), resume=resume) if out else nullcontext() as folder,
    ):
        if folder and forests:
            folder.keep_forests(content_of(forests))
        kept = len(folder.kept) if folder else 0
        if kept:
            say(aside, f"{kept} of {total} trials are in {out} already")
        with shown_progress(aside, kept, total) as progress:
            finished = campaigns.run(
                campaign,
                folder,
                jobs=workers.jobs if workers else jobs or cores(),
                progress=progress,
                executor=workers.executor if workers else None,
                run_trial=run_trial,
            )
    if finished.interrupted:
        say(aside, _interruption(finished, total, out))
        return INTERRUPTED
    console = Console()
    print_table(console, finished.summaries, _layout(campaign))
    say(console, SITE_LEGEND if campaign.scenario else LEGEND)
    say(console, _effort(finished))
    if out:
        say(aside, f"the results are in {out}")
    return 0


def run_alone(campaign: Campaign, trial: int, log: Path | None, run_trial: RunTrial = field_trial) -> int:
    """Run one trial, print its row as in ``trials.csv``, and return the exit code: 1 after a fault.

    With ``log`` the full field log goes there, and after a fault the traceback.

    Raises:
        BadInput: the campaign has no such trial or several algorithms, or ``log`` is not new or empty.
    """
    if trial >= campaign.trials:
        raise BadInput(f"--trial {trial}: the trials of this campaign are 0 to {campaign.trials - 1} (see --trials)")
    if len(campaign.algorithms) > 1:
        raise BadInput(f"--trial runs one trial of one algorithm; choose one of {', '.join(campaign.algorithms)}")
    if log:
        make_empty_folder(log, "the log")
    done = TrialRunner(campaign, run_trial).run(Task(campaign.algorithms[0], trial), log)
    columns = columns_of(campaign.settings())
    print(csv_line(columns) + csv_line(columns, done.row), end="")
    if done.fault is None:
        return 0
    say(Console(stderr=True), fault_line(done))
    if log:
        (log / FAULT_FILE).write_text(done.fault.traceback, encoding="utf-8")
    return 1


def film_alone(campaign: Campaign, trial: int, log: Path | None, video: Path, speed: float) -> int:
    """Run one trial in MuJoCo as ``run_alone`` does, film it, and return the exit code.

    The film is drawn after the trial, which is the same as without it. A trial that ends before its first control tick
    leaves no film.

    Raises:
        BadInput: as of ``run_alone``; or the film cannot be written or drawn, which is found out before the trial.
    """
    from wayfarer.experiments.film.footage import Recorder
    from wayfarer.experiments.film.video import film

    aside, recorder = Console(stderr=True), Recorder()
    with film(video) as shown:
        code = run_alone(campaign, trial, log, recorder)
        if recorder.footage is None:
            raise BadInput(
                f"--video {video}: trial {trial} ended before its first control tick; there is nothing to film"
            )
        with drawing(aside) as done:
            shown.show(recorder.footage, speed, done)
    say(aside, f"the film is {video}")
    return code


def cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0))


def _connected(cluster: str | None) -> AbstractContextManager[Cluster | None]:
    if cluster is None:
        return nullcontext()
    from wayfarer.experiments.dask_cluster import connected

    return connected(cluster)


def _layout(campaign: Campaign) -> Layout:
    if campaign.scenario is None:
        return FORESTS
    from wayfarer.experiments.site_table import layout_of

    return layout_of(campaign.scenario, campaign.rover.name)


def _interruption(finished: CampaignResult, total: int, out: Path | None) -> str:
    count = f"interrupted: {finished.trials} of {total} trials are"
    return f"{count} kept in {out}; add --resume to go on" if out else f"{count} done; with --out DIR they are kept"


def _effort(finished: CampaignResult) -> str:
    effort = finished.effort
    simulated_h = finished.totals.simulated_s / 3600
    per_tick = f", {effort.cpu_us_per_tick:.1f} us of CPU a control tick" if effort.cpu_us_per_tick else ""
    return f"{simulated_h:.1f} h simulated; this run took {effort.wall_s:.1f} s{per_tick}"


def make_empty_folder(path: Path, what: str) -> None:
    """Make a folder, or take an empty one.

    Raises:
        BadInput: it is not empty, or cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        empty = not any(path.iterdir())
    except OSError as error:
        raise BadInput(f"{path} cannot be used for {what}: {error.strerror}") from error
    if not empty:
        raise BadInput(f"{path} is not empty; {what} needs a new or empty folder")
