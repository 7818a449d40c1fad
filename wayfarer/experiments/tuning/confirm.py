"""The confirmation: the best point beside the present settings on forests that the search never saw, in both physics.

Each of the two is an ordinary campaign in a folder, such as ``held-out/light/tuned``, which ``wayfarer report`` shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from wayfarer.config.chassis import WHEEL_KEYS
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import BadInput, MissingPackage
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.commands import check_points
from wayfarer.experiments.executors import MakeExecutor, RunTrial, Stopped
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.results_folder import ResultsFolder
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.sim_command import run_shown
from wayfarer.experiments.tuning.forests import content_of, held_out
from wayfarer.experiments.tuning.summary import HELD_OUT, PairedResult, paired
from wayfarer.extras import require
from wayfarer.simhal.world.physics import FRICTIONS, GroundName

if TYPE_CHECKING:
    from wayfarer.experiments.tuning.plan import SearchPlan

FOLDER = "held-out"
LIGHT, MUJOCO = "light", "mujoco"


def in_mujoco(campaign: Campaign, trials: int) -> Campaign | str:
    """Return the first trials of a campaign in MuJoCo, or why that cannot be.

    The friction is that of the campaign's ground; ``ideal`` has none, and gets the usual one.
    """
    if missing := campaign.rover.chassis.missing(WHEEL_KEYS):
        return f"not confirmed in MuJoCo: rover '{campaign.rover.name}' has no chassis.{missing[0]}"
    try:
        require("--physics mujoco")
        from wayfarer.simhal.drawn_ranges import Range
        from wayfarer.simhal.mujoco.terrain import Terrains

        friction = FRICTIONS.get(campaign.ground)
        terrains = Terrains(friction=Range(friction, friction)) if friction else Terrains()
        rigid = replace(campaign, trials=trials, ground=GroundName.ideal, terrains=terrains)
        check_points([rigid], rigid.rover.name)
    except (MissingPackage, BadInput) as error:
        return f"not confirmed in MuJoCo: {error}"
    return rigid


def confirmed(
    plan: SearchPlan,
    tuned: RoverConfig,
    out: Path,
    trials: int,
    mujoco_trials: int,
    *,
    jobs: int,
    executor: MakeExecutor | None,
    run_trial: RunTrial,
) -> Iterator[PairedResult | str]:
    """Yield the comparison in each physics, or why there is none in it.

    Raises:
        Stopped: a signal ended it; finished trials are kept.
        WayfarerError: as of ``run_campaign.run``.
    """
    campaign = held_out(plan.asked, max(trials, mujoco_trials))
    rigid: Campaign | str = "not confirmed in MuJoCo: not asked for (--confirm-mujoco 0)"
    if mujoco_trials:
        rigid = in_mujoco(campaign, mujoco_trials)
    for physics, each in ((LIGHT, replace(campaign, trials=trials)), (MUJOCO, rigid)):
        if isinstance(each, str):
            yield each
            continue
        both = {"present": each, "tuned": replace(each, rover=tuned)}
        rows = {
            name: _rows(one, out / FOLDER / physics / name, jobs=jobs, executor=executor, run_trial=run_trial)
            for name, one in both.items()
        }
        yield paired(physics, HELD_OUT, rows["present"], rows["tuned"], plan.quantity.name)


def _rows(
    campaign: Campaign, folder: Path, *, jobs: int, executor: MakeExecutor | None, run_trial: RunTrial
) -> list[TrialRow]:
    say(Console(stderr=True), f"held-out forests, physics {folder.parent.name}: {folder.name} settings")
    with ResultsFolder(folder, campaign.settings(), resume=True) as results:
        if content := content_of(campaign):
            results.keep_forests(content)
        if run_shown(campaign, results, jobs=jobs, executor=executor, run_trial=run_trial).interrupted:
            raise Stopped
        return list(results.kept)
