"""The ``wayfarer`` command.

Whatever the user gets wrong ends as one line on stderr and exit code 2. Every command imports what it needs
when it runs, so that the light ones stay quick on a rover's small computer.
"""

from __future__ import annotations

import math
import sys
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer import __version__
from wayfarer.errors import BadInput, MissingPart, WayfarerError

if TYPE_CHECKING:
    from rich.table import Table

BAD_INPUT = 2

EXAMPLES = """Examples:

wayfarer list

wayfarer sim --trials 1000

wayfarer sim --help
"""
SIM_EXAMPLES = """Examples:

wayfarer sim --trials 1000 --out results

wayfarer sim --trials 1000 --out results --resume

wayfarer sim --trials 200 --algorithm paper --slip-mean-m 2

wayfarer sim --algorithm levy-walk,my_rules:spiral --spl

wayfarer sim --trial 17 --log logs/17
"""
RUNNING = "Running"
ONE_TRIAL = "One trial again"

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False)


class AnomalySource(StrEnum):
    """How the rover notices that it is blocked."""

    motion = "motion"
    contact = "contact"


def main() -> None:
    """Run the command line and exit; the console entry point."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code."""
    try:
        return int(app(arguments, prog_name="wayfarer", standalone_mode=False) or 0)
    except (BadInput, MissingPart) as error:
        return _fail(str(error), BAD_INPUT)
    except WayfarerError as error:
        return _fail(str(error), 1)
    except typer.TyperException as error:
        return _fail(error.format_message(), BAD_INPUT)


def _fail(text: str, exit_code: int) -> int:
    if text:  # there is none where the help was the answer
        print("wayfarer:", " ".join(text.splitlines()), file=sys.stderr)
    return exit_code


def _print_version(asked: bool) -> None:
    if asked:
        print("wayfarer", __version__)
        raise typer.Exit


def _positive(value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value:g} is not a finite number above 0")
    return value


@app.callback(epilog=EXAMPLES)
def _root(
    *,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    """Get a rover out of a forest when it cannot see."""


@app.command("list")
def list_names() -> None:
    """Show the algorithms, rovers and drivers that there are, third-party ones with where they come from."""
    from rich.console import Console

    from wayfarer.config import rover_names
    from wayfarer.registry import driver_names

    console = Console()
    console.print(_algorithm_table())
    console.print("rovers: ", ", ".join(rover_names()) or "none", highlight=False)
    console.print("drivers:", ", ".join(driver_names()) or "none", highlight=False)


def _algorithm_table() -> Table:
    from rich import box
    from rich.table import Table

    from wayfarer.registry import algorithm_names

    table = Table("algorithm", "family", "needs", "what it does", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in algorithm_names():
        table.add_row(name, *_described(name))
    return table


def _described(name: str) -> tuple[str, str, str]:
    """Say what an algorithm is; a third party's that cannot be loaded must not hide the others."""
    from wayfarer.registry import find_algorithm

    try:
        found = find_algorithm(name)
    except BadInput as error:
        return "", "", f"cannot be loaded: {error}"
    origin = "" if found.origin == "wayfarer" else f" (from {found.origin})"
    return found.family, ", ".join(sorted(found.requires)), found.summary + origin


@app.command(epilog=SIM_EXAMPLES)
def sim(
    *,
    trials: Annotated[int, typer.Option(min=1, max=1_000_000, metavar="N", help="Trials of each algorithm.")] = 1000,
    algorithm: Annotated[
        str,
        typer.Option(
            metavar="NAME[,NAME...]|paper",
            help="What decides; 'paper' stands for the ten of the paper. A name given twice runs once.",
        ),
    ] = "forest-pledge",
    forests: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Forests to use, in file order; without it two noises on generated layouts."),
    ] = None,
    rover: Annotated[str, typer.Option(metavar="NAME|FILE", help="A shipped rover or a TOML file.")] = "sim",
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Another seed is another campaign.")] = 0,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Processes; without it one for each core.", rich_help_panel=RUNNING),
    ] = None,
    slip_mean_m: Annotated[
        float, typer.Option(callback=_positive, metavar="M", help="Mean distance between slip events.")
    ] = 10.0,
    budget_m: Annotated[
        float,
        typer.Option(callback=_positive, metavar="M", help="Path after which a rover counts as entrapped."),
    ] = 1000.0,
    anomaly_source: Annotated[
        AnomalySource | None,
        typer.Option(help="Notice an obstacle by not moving, or at once by touch. (default: as the rover file says)"),
    ] = None,
    spl: Annotated[
        bool, typer.Option("--spl", help="Compute the shortest paths that are not known, for SPL; slower.")
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
        typer.Option("--resume", help="Go on with the interrupted campaign in --out.", rich_help_panel=RUNNING),
    ] = False,
    trial: Annotated[
        int | None,
        typer.Option(min=0, metavar="N", help="Run this one trial and print its row.", rich_help_panel=ONE_TRIAL),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="New or empty folder for its full field log.", rich_help_panel=ONE_TRIAL),
    ] = None,
) -> None:
    """Run the rover's own code in simulated forests, and count how often it gets out and how far it goes."""
    _refuse_odd_pairs(out, resume, trial, log)
    _require_sim_extra()
    from wayfarer.config import load_rover
    from wayfarer.simhal import command
    from wayfarer.simhal.plan import Campaign, read_forest_file

    config = load_rover(rover)
    campaign = Campaign(
        command.algorithms(algorithm),
        trials,
        config.with_anomaly_source(anomaly_source.value) if anomaly_source else config,
        seed=seed,
        slip_mean_m=slip_mean_m,
        budget_m=budget_m,
        spl=spl,
        forests=read_forest_file(forests) if forests else None,
    )
    if trial is None:
        raise typer.Exit(command.run_all(campaign, out, resume=resume, jobs=jobs))
    raise typer.Exit(command.run_alone(campaign, trial, log))


def _refuse_odd_pairs(out: Path | None, resume: bool, trial: int | None, log: Path | None) -> None:
    if resume and not out:
        raise BadInput("--resume goes on with the campaign in a folder; say which with --out DIR")
    if log and trial is None:
        raise BadInput("--log keeps the log of one trial; say which with --trial N")
    if out and trial is not None:
        raise BadInput("--trial runs one trial and prints its row; it keeps no --out, leave it out")


def _require_sim_extra() -> None:
    missing = [name for name in ("numpy", "skfmm") if find_spec(name) is None]
    if missing:
        raise WayfarerError(f"simulating needs {missing[0]}, which is not installed: pip install 'wayfarer[sim]'")
