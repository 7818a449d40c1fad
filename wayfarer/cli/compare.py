"""``wayfarer compare``: paired comparison of the algorithms of one campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli.options import AsJson, complete_algorithm, examples

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
    from rich.console import Console

    from wayfarer.experiments.measures import compare as compared
    from wayfarer.experiments.results import Results
    from wayfarer.experiments.rows import rounded_values
    from wayfarer.experiments.tables import comparison_table, sentences
    from wayfarer.logview.terminal import print_json
    from wayfarer.logview.terminal_table import print_whole

    algorithms = compared(Results.open(results).rows, against)
    if as_json:
        values = [rounded_values(each.as_json()) for each in algorithms]
        print_json({"against": algorithms[0].algorithm, "algorithms": values})
        return
    console = Console()
    print_whole(console, comparison_table(algorithms))
    for sentence in sentences(algorithms):
        console.print(sentence, highlight=False, markup=False)
