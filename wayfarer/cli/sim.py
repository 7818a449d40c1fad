"""``wayfarer sim``: trials of the rover's own code in simulated forests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from wayfarer.cli import trial_options as options
from wayfarer.cli.options import AsJson, check_together, command_line, examples
from wayfarer.cli.trial_options import RUNNING
from wayfarer.extras import require

EXAMPLES = examples(
    "wayfarer sim --trials 1000 --out results",
    "wayfarer sim --trials 1000 --out results --resume",
    "wayfarer sim --trials 200 --algorithm paper --slip-mean-m 2",
    "wayfarer sim --trials 500 --algorithm paper --forests reference",
    "wayfarer sim --algorithm levy-walk,spiral.py --spl",
    "wayfarer sim --trial 17 --log-dir logs/17",
    "wayfarer sim --trials 50 --log-dir logs",
    "wayfarer sim --trials 100 --rover minirover --depth bus",
    "wayfarer sim --site extended-maze --rover forestrover --algorithm forest-pledge,levy-walk --trials 200",
    "wayfarer sim --ground mud --trials 200",
    "wayfarer sim --set senses=field --trials 200",
    "wayfarer sim --fault silent:compass --trials 200",
    "wayfarer sim --set sim.slope_deg=0:15 --set sim.slope_direction_deg=0:360 --trials 200",
    "wayfarer sim --physics mujoco --set sim.friction=0.3:0.8 --rover forestrover --trials 20",
    "wayfarer sim --trials 1000000 --out results --cluster tcp://10.0.0.7:8786",
)
ONE_TRIAL = "One trial again"

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
        metavar="N",
        help="Run this one trial and print its row.",
        rich_help_panel=ONE_TRIAL,
    ),
]
LogDir = Annotated[
    Path | None, typer.Option(metavar="DIR", help="New or empty folder for the trials' full field logs; slower.")
]

# Of each pair, the first option has no effect without the second.
NEEDS = (("resume", "out"),)
EXCLUDES = (
    ("log_dir", "resume"),  # each trial that is logged has to run again
    ("trial", "trials"),  # one trial is the same in a campaign of any size
    ("trial", "out"),  # one trial prints its row, and writes no folder
    ("jobs", "cluster"),
    ("trial", "cluster"),
    ("log_dir", "cluster"),  # logs would be written on the machines of the cluster
)


def sim(
    ctx: typer.Context,
    *,
    asked: dict[str, Any],
    jobs: options.Jobs = None,
    cluster: options.ClusterAddress = None,
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
    from wayfarer.cli.run_trials import run_all, run_alone
    from wayfarer.experiments.checks import make_campaign
    from wayfarer.experiments.settings import option_of

    campaign = make_campaign(asked if trial is None else asked | {"trials": trial + 1}, option_of)
    if trial is None:
        code = run_all(
            campaign, out, resume=resume, jobs=jobs, cluster=cluster, forests=asked.get("forests"), log=log_dir,
            as_json=as_json, command=command_line(ctx),
        )  # fmt: skip
        raise typer.Exit(code)
    run_alone(campaign, trial, log_dir, as_json=as_json)
