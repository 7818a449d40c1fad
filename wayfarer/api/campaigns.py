"""``run_campaign`` and ``run_sweep``: what ``wayfarer sim`` and ``wayfarer sweep`` do, from Python."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Unpack

from wayfarer.api.results import Results
from wayfarer.errors import BadInput
from wayfarer.extras import require

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from wayfarer.config.rover_file import RoverConfig
    from wayfarer.experiments.campaign import Plan
    from wayfarer.experiments.make_campaign import CampaignOptions

Value = bool | int | float | str


def run_campaign(
    algorithms: str | Sequence[str] = "forest-pledge",
    trials: int = 100,
    *,
    rover: str | Path | RoverConfig = "sim",
    seed: int = 0,
    forests: str | Path | None = None,
    site: str | None = None,
    ground: str = "ideal",
    physics: Literal["light", "mujoco"] = "light",
    friction: float | str | None = None,
    roughness_m: float | str | None = None,
    torque_scale: float | str | None = None,
    slope_deg: float | str | None = None,
    slope_direction_deg: float | str | None = None,
    senses: str = "ideal",
    slip_mean_m: float = 10.0,
    budget_m: float = 1000.0,
    anomaly_source: Literal["motion", "contact"] | None = None,
    depth: Literal["device", "bus"] = "device",
    spl: bool = False,
    faults: Sequence[str] = (),
    jobs: int | None = 1,
    executor: Executor | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
) -> Results:
    """Run the rover's own code in simulated forests, each algorithm in the same ones with the same noise.

    The same arguments give the same rows, whatever ``jobs`` is, and the same as ``wayfarer sim`` with these options.

    Args:
        algorithms: names that ``wayfarer list`` prints, or your own as ``"module:attribute"``; ``"paper"`` stands for
            the ten of the paper.
        trials: of each algorithm.
        rover: the name of a built-in rover, a rover file, or what ``load_rover`` returned.
        seed: of the layouts and of all chance in the trials, 0 or above.
        forests: a forest file, or ``"reference"`` for the 500 that come with wayfarer, in place of generated ones.
        site: a site of the paper's field trials in place of forests, such as ``"dense-obstruction"``.
        ground: ``"ideal"``, or ``"leaf-litter"``, ``"dry-soil"`` or ``"mud"``, on which the wheels slip in turns.
        physics: ``"light"``, or ``"mujoco"`` for rigid bodies, which needs the extra ``physics``.
        friction: of tyres on ground and bark, in MuJoCo; a number, or as all below ``"0.3:0.8"`` to draw one for each
            trial.
        roughness_m: standard deviation of the ground's height in MuJoCo, metres.
        torque_scale: stall torque in MuJoCo over that of the rover file.
        slope_deg: slope of all the ground, degrees.
        slope_direction_deg: where the ground rises to, degrees clockwise from the way to the goal.
        senses: ``"ideal"``, ``"field"``, or errors by name, such as ``"blind_share=0.3"``.
        slip_mean_m: mean distance between slips, metres.
        budget_m: path after which a rover counts as entrapped, metres.
        anomaly_source: notice an obstacle by lack of motion, or by contact as well; as in the rover file by default.
        depth: ``"bus"`` runs the real drivers over simulated chips, which takes longer.
        spl: compute shortest paths, for the SPL (success weighted by path length); slower.
        faults: on purpose, each as ``KIND[:PART][@SECONDS[+SECONDS]]``: ``"silent:compass@20+5"`` takes the compass
            away from each rover for 5 s, 20 s after the start.
        jobs: number of processes; None is one per core, as of the command.
        executor: any ``concurrent.futures.Executor`` that is to run the trials instead, such as a Dask client's
            ``get_executor(pure=False)``; ``jobs`` is then how many it runs at a time. It is not shut down.
        out: a new or empty folder for ``trials.csv``.
        resume: continue what was interrupted in ``out``.
        progress: show a progress bar on stderr.

    Raises:
        BadInput: something that cannot be used; the text names it and says what is allowed.
        MissingPackage: the extra ``sim`` is not installed, or ``spl`` for shortest paths, or ``physics`` for MuJoCo.
        TrialNotRun: a trial raised an error, which is the cause, or its worker process died; finished trials are kept
            in ``out``.
        WayfarerError: ``out`` cannot be written any more; finished trials are kept there.
        KeyboardInterrupt: Ctrl-C; finished trials are kept in ``out``.

    >>> results = run_campaign("forest-pledge", trials=2, slip_mean_m=5.0)
    >>> [(row["trial"], row["outcome"]) for row in results.trials]
    [(0, 'left_bounds'), (1, 'escaped')]
    """
    require("simulating")
    from wayfarer.experiments.make_campaign import make_campaign

    campaign = make_campaign(
        algorithms, rover=rover, anomaly_source=anomaly_source, forests=forests, senses=senses, site=site,
        trials=trials, seed=seed, slip_mean_m=slip_mean_m, budget_m=budget_m, spl=spl, depth=depth, ground=ground,
        physics=physics, friction=friction, roughness_m=roughness_m, torque_scale=torque_scale, slope_deg=slope_deg,
        slope_direction_deg=slope_direction_deg, faults=faults,
    )  # fmt: skip
    return _run(campaign, forests, jobs, executor, out, resume=resume, progress=progress)


def run_sweep(
    values: Mapping[str, Sequence[Value]],
    algorithms: str | Sequence[str] = "forest-pledge",
    trials: int = 100,
    *,
    jobs: int | None = 1,
    executor: Executor | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
    **options: Unpack[CampaignOptions],
) -> Results:
    """Run the same trials at each point of a grid of settings, as ``wayfarer sweep`` does.

    The rows have a column for each key that was swept, and ``point``, the number of the point, from 0.

    Args:
        values: one key or two, each with its values: any key of a rover file by its dotted name
            (``"escape.turn_angle_deg"``), ``footprint_m``, ``slip_mean_m``, ``budget_m``, ``ground``,
            ``sim.trees_per_ha``, or ``sim.`` and any number of the simulated world, as ``"sim.friction"`` in MuJoCo.
        algorithms: as of ``run_campaign``.
        trials: of each algorithm at each point.
        jobs: as of ``run_campaign``.
        executor: as of ``run_campaign``.
        out: a new or empty folder for the results.
        resume: continue what was interrupted in ``out``.
        progress: show a progress bar on stderr.
        options: the others of ``run_campaign``, from ``rover`` to ``faults``.

    Raises:
        BadInput: no such key, or a value out of its range; and as of ``run_campaign``.

    >>> results = run_sweep({"escape.turn_angle_deg": [30, 60]}, trials=1)
    >>> [(row["point"], row["escape.turn_angle_deg"], row["trial"]) for row in results.trials]
    [(0, 30, 0), (1, 60, 0)]
    """
    require("simulating")
    from wayfarer.experiments.commands import check_points
    from wayfarer.experiments.make_campaign import make_campaign
    from wayfarer.experiments.sweep import Axis, make_sweep

    campaign = make_campaign(algorithms, trials=trials, **options)
    sweep = make_sweep(campaign, [Axis(key, tuple(dict.fromkeys(map(_plain, each)))) for key, each in values.items()])
    check_points(sweep.points, campaign.rover.name)
    return _run(sweep, None, jobs, executor, out, resume=resume, progress=progress)


def _plain(value: Value) -> Value:
    """Return a number of numpy as Python's own: settings are kept as JSON."""
    return value.item() if hasattr(value, "item") else value


def _run(
    plan: Plan,
    forests: str | Path | None,
    jobs: int | None,
    executor: Executor | None,
    out: str | Path | None,
    *,
    resume: bool,
    progress: bool,
) -> Results:
    from wayfarer.experiments.pool import cores
    from wayfarer.experiments.results_folder import ResultsFolder
    from wayfarer.experiments.run import run
    from wayfarer.experiments.sim_command import run_shown
    from wayfarer.simhal.world.forest_file import content_of

    if jobs is not None and jobs < 1:
        raise BadInput(f"jobs = {jobs}: a campaign needs one process at least")
    if resume and out is None:
        raise BadInput("resume = True continues the results in a folder: name it with out")
    settings, at_a_time = plan.settings(), jobs or cores()
    with nullcontext() if out is None else ResultsFolder(Path(out), settings, resume=resume) as folder:
        if folder and forests:
            folder.keep_forests(content_of(forests))
        if progress:
            finished = run_shown(plan, folder, jobs=at_a_time, executor=executor)
        else:
            finished = run(plan, folder, jobs=at_a_time, executor=executor)
    if finished.interrupted:
        raise KeyboardInterrupt
    return Results(json.loads(json.dumps(settings)), finished.rows)
