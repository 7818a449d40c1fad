"""Implementation of ``wayfarer faults``: runs scenarios, stores the results, prints the table."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from wayfarer.errors import WayfarerError, one_line
from wayfarer.experiments.commands import INTERRUPTED, make_empty_folder
from wayfarer.experiments.executors import Stopped
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.rows import rounded_values
from wayfarer.fault_scenarios.judge import judge
from wayfarer.fault_scenarios.results import Result, not_run, print_results
from wayfarer.fault_scenarios.runner import RunResult, run_batch, run_scenario, run_without_faults, without_faults
from wayfarer.fault_scenarios.scenario import Scenario
from wayfarer.files import write_atomically
from wayfarer.views.export.tables import without_formulas
from wayfarer.views.text.scripting import print_json, say_next

CSV_FILE, JSON_FILE = "results.csv", "results.json"
MOST_WELL_RUNS = 8  # in memory at a time: each holds all of its ticks
COLUMNS = (*Result._fields, "passed")


class ScenarioRunner:
    """Runs and judges scenarios in virtual time; it can be sent to another process.

    Scenarios that differ in their faults only share one run without faults.

    Args:
        logs: each scenario's field log goes into a folder of its name there.
    """

    def __init__(self, logs: Path | None = None) -> None:
        self._logs = logs
        self._well: dict[str, RunResult] = {}

    def __call__(self, scenario: Scenario) -> Result:
        """Run and judge one; an error becomes its result's problem."""
        try:
            return judge(scenario, *self.runs(scenario))
        except Exception as error:
            said = str(error) if isinstance(error, WayfarerError) else f"an error inside wayfarer: {error!r}"
            return not_run(scenario)._replace(
                within_s=scenario.expect.within_s, changed="nothing", problems=(one_line(said),)
            )

    def runs(self, scenario: Scenario) -> tuple[RunResult, RunResult]:
        """Return a run of a scenario with its faults, and one without."""
        run_result = run_scenario(scenario, self._logs / scenario.name if self._logs else None)
        key = repr(without_faults(scenario))
        if key not in self._well:
            if len(self._well) >= MOST_WELL_RUNS:
                self._well.clear()
            self._well[key] = run_without_faults(scenario)
        return run_result, self._well[key]


def run_scenarios(
    scenarios: Sequence[Scenario],
    *,
    jobs: int | None = None,
    out: Path | None = None,
    skipped: Sequence[Result] = (),
    untried: Sequence[int] = (),
    verbose: bool = False,
    as_json: bool = False,
) -> int:
    """Run scenarios, print what came of them, and return the exit code: 1 if one is not as expected.

    With ``out`` results and each scenario's field log are stored there. ``skipped`` stand among the results.

    Raises:
        BadInput: ``out`` is not new or empty.
        WayfarerError: a worker died.
    """
    aside = Console(stderr=True)
    if out is not None:
        make_empty_folder(out, "what comes of the scenarios")
    try:
        found = {each.name: each for each in run_batch(ScenarioRunner(out), scenarios, jobs, "scenarios")}
    except Stopped:
        say(aside, "interrupted: no results")
        return INTERRUPTED
    results = [*(found[scenario.name] for scenario in scenarios), *skipped]
    results.sort(key=lambda each: each.row or 0)
    if as_json:
        print_json({"results": [_as_row(result) for result in results], "untried": untried})
    else:
        print_results(Console(), results, untried, verbose=verbose)
    if out is not None:
        store_rows(out, COLUMNS, [_as_row(result) for result in results])
        say(aside, f"the results are in {out}")
        if scenarios and not as_json:
            say_next("wayfarer", "logs", "show", out / scenarios[0].name)
    return 1 if any(each.problems for each in results) else 0


def store_rows(out: Path, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Store a table as CSV, its columns in this order, and as JSON."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_spreadsheet_cell(row[name]) for name in columns] for row in rows)
    for name, text in ((CSV_FILE, table.getvalue()), (JSON_FILE, json.dumps(rows, indent=1) + "\n")):
        write_atomically(out / name, text)


def _spreadsheet_cell(value: object) -> object:
    if isinstance(value, Mapping):
        value = tuple(f"{name} {number}" for name, number in value.items())
    text = "; ".join(map(str, value)) if isinstance(value, tuple) else value
    return without_formulas(text) if isinstance(text, str) else text


def _as_row(result: Result) -> dict[str, Any]:
    return {**rounded_values(result._asdict()), "passed": result.passed}
