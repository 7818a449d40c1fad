"""Implementation of ``wayfarer faults``: runs scenarios, stores the results, prints the table."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from rich.console import Console

from wayfarer.errors import WayfarerError
from wayfarer.experiments.commands import INTERRUPTED, cores, make_empty_folder
from wayfarer.experiments.executors import Stopped, stream
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.run_campaign import stop_on_signals
from wayfarer.fault_scenarios.batch_progress import shown, worker_death_explained
from wayfarer.fault_scenarios.judge import judge
from wayfarer.fault_scenarios.result import Result
from wayfarer.fault_scenarios.runner import run_scenario, run_without_faults
from wayfarer.fault_scenarios.scenario import Scenario
from wayfarer.fault_scenarios.selection import unplayed
from wayfarer.fault_scenarios.table import print_results
from wayfarer.fieldlog.atomic_file import whole_file

CSV_FILE, JSON_FILE = "results.csv", "results.json"
COLUMNS = (*Result._fields, "passed")


class ScenarioRunner:
    """Runs scenarios in virtual time; what it needs can be sent to another process. ``logs`` takes a folder of each."""

    def __init__(self, logs: Path | None = None) -> None:
        self._logs = logs

    def run_chunk(self, scenarios: Sequence[Scenario]) -> list[Result]:
        """Run several."""
        return [self.run(scenario) for scenario in scenarios]

    def run(self, scenario: Scenario) -> Result:
        """Run one and judge it; whatever it raises is its own problem and goes no further."""
        try:
            run_result = run_scenario(scenario, self._logs / scenario.name if self._logs else None)
            return judge(scenario, run_result, run_without_faults(scenario))
        except Exception as error:
            return _not_run(scenario, error)


def run_scenarios(
    scenarios: Sequence[Scenario],
    *,
    jobs: int | None = None,
    out: Path | None = None,
    skipped: Sequence[Result] = (),
    untried: Sequence[int] = (),
) -> int:
    """Run scenarios, print what came of them, and return the exit code: 1 if one is not as expected.

    With ``out`` results and each scenario's field log are kept there. ``skipped`` stand among the results.

    Raises:
        BadInput: ``out`` is not new or empty.
        WayfarerError: a worker died.
    """
    if out is not None:
        make_empty_folder(out, "what comes of the scenarios")
    try:
        results = sorted([*_results(scenarios, jobs or cores(), out), *skipped], key=lambda each: each.row or 0)
    except Stopped:
        say(Console(stderr=True), "interrupted: no results")
        return INTERRUPTED
    print_results(Console(), results, untried)
    if out is not None:
        _keep(out, results)
        say(Console(stderr=True), f"the results are in {out}")
    return 1 if any(each.problems for each in results) else 0


def _results(scenarios: Sequence[Scenario], jobs: int, out: Path | None) -> list[Result]:
    """Return what came of each scenario, in their order.

    Raises:
        Stopped: a signal asked for it.
        WayfarerError: a worker died.
    """
    found: dict[str, Result] = {}
    with (
        worker_death_explained(found, "scenarios"),
        stop_on_signals() as stop,
        closing(stream(ScenarioRunner(out), scenarios, max(1, min(jobs, len(scenarios))), stop)) as running,
    ):
        for result in shown(running, len(scenarios), "scenarios", Console(stderr=True)):
            found[result.name] = result
    return [found[scenario.name] for scenario in scenarios]


def _not_run(scenario: Scenario, error: Exception) -> Result:
    said = str(error) if isinstance(error, WayfarerError) else f"an error inside wayfarer: {error!r}"
    return unplayed(scenario)._replace(
        within_s=scenario.expect.within_s, changed="nothing", problems=(" ".join(said.split()),)
    )


def _keep(out: Path, results: Sequence[Result]) -> None:
    rows = [_as_row(result) for result in results]
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(["; ".join(cell) if isinstance(cell, tuple) else cell for cell in row.values()] for row in rows)
    for name, text in ((CSV_FILE, table.getvalue()), (JSON_FILE, json.dumps(rows, indent=1) + "\n")):
        with whole_file(out / name) as draft:
            draft.write_text(text, encoding="utf-8")


def _as_row(result: Result) -> dict[str, Any]:
    said = {name: round(value, 4) if isinstance(value, float) else value for name, value in result._asdict().items()}
    return {**said, "passed": result.passed}
