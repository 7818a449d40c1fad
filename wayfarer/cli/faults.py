"""``wayfarer faults``: fault injection in virtual time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli.options import AsJson, check_together, complete_fault_scenarios, examples, rover_option
from wayfarer.cli.trial_options import Jobs
from wayfarer.errors import BadInput, MissingPackage
from wayfarer.extras import require

EXAMPLES = examples(
    "wayfarer faults",
    "wayfarer faults --only 37",
    "wayfarer faults --only compass-nack,board-fault --out results",
    "wayfarer faults --scenario my-fault.toml -v",
    "wayfarer faults --missions 100 --out survival",
)
MISSIONS = "Missions"

Only = Annotated[
    str | None,
    typer.Option(
        metavar="NAME[,NAME...]|ROW",
        autocompletion=complete_fault_scenarios,
        help="Run these scenarios, or rows of the catalogue.",
    ),
]
OnRover = Annotated[
    str | None,
    rover_option("Run them on this rover; those that need parts it does not have are skipped."),
]
ScenarioFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Run the scenarios of this TOML file instead of the catalogue.")
]
Out = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="New or empty folder for results.csv, results.json and each run's field log."),
]
Show = Annotated[bool, typer.Option("--list", help="List the scenarios, and run nothing.")]
Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Print each scenario, not only what is not as expected; remarks and tests."),
]
Missions = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=1_000_000,
        metavar="N",
        help="Have each fault strike N trials at a random time, and count how many get out.",
        rich_help_panel=MISSIONS,
    ),
]
Seed = Annotated[
    int | None, typer.Option(min=0, metavar="N", help="Random seed of --missions.", rich_help_panel=MISSIONS)
]


def faults(
    ctx: typer.Context,
    *,
    only: Only = None,
    rover: OnRover = None,
    scenario: ScenarioFile = None,
    out: Out = None,
    show: Show = False,
    verbose: Verbose = False,
    jobs: Jobs = None,
    missions: Missions = None,
    seed: Seed = None,
    as_json: AsJson = False,
) -> None:
    """Inject each fault of the catalogue into a simulated rover, and check its response against a time bound."""
    check_together(ctx, needs=[("seed", "missions")], excludes=[("verbose", "missions")])
    if missions is not None and show:
        raise BadInput("--missions has its own trials; leave out --list")
    require("simulating")
    if missions is not None:
        raise typer.Exit(_missions(missions, only, rover, scenario, out, jobs, seed or 0, as_json=as_json))
    raise typer.Exit(_run(only, rover, scenario, out, jobs, show=show, verbose=verbose, as_json=as_json))


def _run(
    only: str | None, rover: str | None, scenario: Path | None, out: Path | None, jobs: int | None, *, show: bool,
    verbose: bool, as_json: bool,
) -> int:  # fmt: skip
    """Run what was asked for and return the exit code.

    Raises:
        BadInput: there is no such row, scenario, file or rover, or tests hold all that was asked for.
        MissingPackage: nothing of it can be run without a package that is not installed.
    """
    from rich.console import Console

    from wayfarer.experiments.progress_bar import say
    from wayfarer.fault_scenarios.catalogue import ROWS, catalogue
    from wayfarer.fault_scenarios.command import run_scenarios
    from wayfarer.fault_scenarios.results import Result, print_list, skipped_lines
    from wayfarer.fault_scenarios.scenario_file import read_scenarios
    from wayfarer.fault_scenarios.selection import (
        chosen,
        on_another_rover,
        without_covered_by_tests,
        without_missing_packages,
    )
    from wayfarer.views.text.scripting import print_json

    rows = list(read_scenarios(scenario) if scenario else catalogue())
    untried = [] if scenario or only else sorted({*range(1, ROWS + 1)} - {row.row for row in rows})
    rows = chosen(rows, only) if only is not None else rows
    scenarios, elsewhere = without_covered_by_tests(rows)
    misfits: list[Result] = []
    if rover is not None:
        scenarios, misfits = on_another_rover(scenarios, rover)
    if show:
        listed = rows if rover is None else scenarios
        if as_json:
            print_json({"scenarios": [{"row": each.row, "name": each.name, "about": each.about} for each in listed]})
        else:
            print_list(Console(), listed)
        return 0
    if elsewhere and not (scenarios or misfits):
        raise BadInput("; ".join(f"{each.name}: {each.skipped}" for each in elsewhere))
    scenarios, unequipped = without_missing_packages(scenarios)
    if unequipped and not scenarios:
        raise MissingPackage(f"nothing can be run: {unequipped[0].skipped}")
    for line in skipped_lines(unequipped):  # at once, not after the minutes that the others take
        say(Console(stderr=True), line)
    skipped = [*elsewhere, *misfits, *unequipped]
    return run_scenarios(
        scenarios, jobs=jobs, out=out, skipped=skipped, untried=untried, verbose=verbose, as_json=as_json
    )


def _missions(
    missions: int, only: str | None, rover: str | None, scenario: Path | None, out: Path | None, jobs: int | None,
    seed: int, *, as_json: bool,
) -> int:  # fmt: skip
    """Have the faults that were asked for strike missions, and return the exit code.

    Raises:
        BadInput: there is no such row, scenario, file or rover, or none of them can strike a mission.
    """
    from wayfarer.fault_scenarios.catalogue import catalogue
    from wayfarer.fault_scenarios.missions import faults_of
    from wayfarer.fault_scenarios.scenario_file import read_scenarios
    from wayfarer.fault_scenarios.selection import chosen
    from wayfarer.fault_scenarios.survival import run_missions

    rows = list(read_scenarios(scenario) if scenario else catalogue())
    faults, left_out = faults_of(chosen(rows, only) if only is not None else rows, rover)
    if not faults:
        raise BadInput("; ".join(left_out))
    return run_missions(faults, missions, seed, jobs, out, left_out, as_json=as_json)
