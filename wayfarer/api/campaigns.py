"""``run_campaign`` and ``run_sweep``: what ``wayfarer sim`` and ``wayfarer sweep`` do, from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wayfarer.api.results import Results
from wayfarer.config.messages import shown
from wayfarer.errors import BadInput
from wayfarer.experiments.settings import CampaignSettings, Value, as_plain, describe
from wayfarer.extras import require

if TYPE_CHECKING:
    from wayfarer.experiments.campaign import Plan


@describe()
def run_campaign(  # noqa: D417 - the settings' own sentences are added
    algorithms: str | Sequence[str] = "forest-pledge",
    trials: int = CampaignSettings.trials,
    *,
    jobs: int | None = 1,
    executor: Executor | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
    **settings: Any,
) -> Results:
    """Run the rover's own code in simulated forests, each algorithm in the same ones with the same noise.

    The same arguments give the same rows, for any ``jobs``, and the same as ``wayfarer sim`` with these options.
    Numbers of NumPy are numbers too. ``set`` is a mapping: ``{"sim.slope_deg": (0, 15), "senses": "field"}``.

    Args:
        settings: those of a campaign, in the page of that name.
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
    from wayfarer.experiments.checks import make_campaign

    campaign = make_campaign({"algorithms": algorithms, "trials": trials, **settings})
    return _run(campaign, settings.get("forests"), jobs, executor, out, resume=resume, progress=progress)


@describe(trials=200)
def run_sweep(  # noqa: D417 - as above
    values: Mapping[str, Sequence[Value]],
    algorithms: str | Sequence[str] = "forest-pledge",
    trials: int = 200,
    *,
    jobs: int | None = 1,
    executor: Executor | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
    **settings: Any,
) -> Results:
    """Run the same trials at each point of a grid of settings, as ``wayfarer sweep`` does.

    The rows have a column for each key that was swept, and ``point``, the number of the point, from 0.

    Args:
        values: one key or two, each with its values: the keys that ``set`` takes, such as ``"escape.turn_angle_deg"``
            of the rover file, ``"footprint_m"``, ``"ground"``, or ``"sim.friction"`` in MuJoCo.
        trials: of each algorithm at each point.
        settings: those of a campaign, in the page of that name.
        jobs: as of ``run_campaign``.
        executor: as of ``run_campaign``.
        out: a new or empty folder for the results.
        resume: continue what was interrupted in ``out``.
        progress: show a progress bar on stderr.

    Raises:
        BadInput: no such key, or a value out of its range; and as of ``run_campaign``.

    >>> results = run_sweep({"escape.turn_angle_deg": [30, 60]}, trials=1)
    >>> [(row["point"], row["escape.turn_angle_deg"], row["trial"]) for row in results.trials]
    [(0, 30, 0), (1, 60, 0)]
    """
    require("simulating")
    from wayfarer.experiments.checks import check_points, make_campaign
    from wayfarer.experiments.sweep import axis_of, make_sweep

    if not isinstance(values, Mapping):
        raise BadInput(f"values = {shown(values)}: expected a mapping of keys to lists of their values")
    axes = [axis_of(str(key), each) for key, each in values.items()]
    campaign = make_campaign({"algorithms": algorithms, "trials": trials, **settings}, str, [axis.key for axis in axes])
    sweep = make_sweep(campaign, axes, str)
    check_points(sweep.points, campaign.rover.name)
    return _run(sweep, None, jobs, executor, out, resume=resume, progress=progress)


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
    from wayfarer.experiments.run import run
    from wayfarer.simhal.world.forest_file import content_of

    jobs = as_plain(jobs)
    if jobs is not None and not (type(jobs) is int and jobs >= 1):
        raise BadInput(f"jobs = {shown(jobs)}: expected a number of processes, one at least, or None for one per core")
    if not isinstance(executor, Executor | None):
        raise BadInput(
            f"executor is a {type(executor).__name__} and no concurrent.futures.Executor; of a Dask client give "
            "client.get_executor(pure=False)"
        )
    if out is not None and (not isinstance(out, str | Path) or "\0" in str(out)):
        raise BadInput(f"out = {shown(out)}: expected the path of a folder")
    if resume and out is None:
        raise BadInput("resume = True continues the results in a folder: name it with out")
    folder = None if out is None else Path(out)
    content = content_of(forests) if forests and folder else None
    with ExitStack() as bars, Results.kept(plan, folder, resume=resume, forests=content) as results:
        bar = None
        if progress:
            from rich.console import Console

            from wayfarer.logview.progress_bar import shown_progress

            bar = bars.enter_context(shown_progress(Console(stderr=True), len(results.rows), results.total))
        run(results, jobs=jobs or cores(), executor=executor, progress=bar)
    if not results.finished:
        raise KeyboardInterrupt
    return results
