"""``wayfarer compare``: paired comparison of the algorithms of one campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli.options import AsJson, complete_algorithm, examples
from wayfarer.extras import require

EXAMPLES = examples(
    "wayfarer compare results --against pledge",
    "wayfarer sim --algorithm forest-pledge,pledge --trials 500 --spl --out results && wayfarer compare results",
)


def compare(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="A folder that `wayfarer sim --out` wrote.")],
    *,
    against: Annotated[
        str | None,
        typer.Option(
            metavar="ALGORITHM",
            autocompletion=complete_algorithm,
            help="The algorithm that the others are compared with. (default: forest-pledge, else the first one)",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare the algorithms of a campaign in pairs (same forest, same noise), with 95 % intervals."""
    require("comparing")
    from rich.console import Console

    from wayfarer.experiments.paired_statistics import compare as compared
    from wayfarer.experiments.paired_table import print_comparison
    from wayfarer.experiments.report.load_results import read_results
    from wayfarer.logview.terminal import print_json

    algorithms = compared(read_results(results).rows, against)
    if as_json:
        print_json({"against": algorithms[0].algorithm, "algorithms": algorithms})
    else:
        print_comparison(Console(), algorithms)
