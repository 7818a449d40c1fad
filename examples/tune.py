"""Searches for better settings of a rover with Optuna, and confirms the best ones in layouts that the search never saw.

Every point meets the same layouts with the same noise. A point that is worse than the best one so far, layout by
layout, is given up early. Finished points are in tuned/study.journal: after Ctrl-C run this again, and it goes on. For
more cores run it again in other terminals, one after the other, once the first point is there: they share the journal.

Run it: pip install '.[sim,figures]' 'optuna>=5' && python examples/tune.py [POINTS [LAYOUTS [HELD_OUT]]]
"""

import os
import sys
import warnings
from pathlib import Path
from statistics import fmean
from typing import Any

import optuna
from matplotlib import pyplot
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import TrialState
from optuna.visualization import matplotlib as plots
from pydantic import ValidationError

import wayfarer

# The numbers of the rover file to search, and between which multiples of their current values.
SPACE = {
    "escape.turn_angle_deg": (0.5, 3.0),
    "escape.back_off_m": (0.4, 3.0),
    "escape.probe_straight_m": (0.25, 2.0),
    "escape.probe_radius_m": (0.4, 2.0),
    "escape.reset_within_deg": (0.4, 4.0),
    "detector.immobilised_s": (0.5, 2.0),
    "detector.immobilised_below": (0.4, 2.0),
}
PRESENT = dict.fromkeys(SPACE, 1.0)
ROVER, ALGORITHM, BUDGET_M = "sim", "forest-pledge", 250.0
OPTIONS: dict[str, Any] = {"budget_m": BUDGET_M}  # and others of wayfarer.run_campaign, such as slip_mean_m, ground
SEARCHED, HELD_OUT = 0, 1  # seeds: another one draws other layouts
P_WORSE = 0.1  # of Wilcoxon's signed-rank test: below it a point is given up
LEAST_LAYOUTS = 10  # before that; with fewer no interval can be trusted either
OUT = Path("tuned")

Factors = dict[str, float]


def tables_of(factors: Factors) -> dict[str, dict[str, float]]:
    """Return the searched settings times these factors, in their tables of the rover file."""
    now = wayfarer.load_rover(ROVER).model_dump(mode="json")
    tables: dict[str, dict[str, float]] = {}
    for key, factor in factors.items():
        table, name = key.split(".")
        tables.setdefault(table, {})[name] = float(f"{factor * now[table][name]:.4g}")
    return tables


def rover_with(factors: Factors) -> Any:
    """Return the rover with the searched settings times these factors, checked as a rover file is."""
    rover = wayfarer.load_rover(ROVER)
    settings = rover.model_dump(mode="json")
    for table, values in tables_of(factors).items():
        settings[table] |= values
    return type(rover).model_validate(settings)


def evaluate(trial: optuna.Trial, layouts: int) -> float:
    """Return the mean path over the layouts, metres; one that the rover does not get out of counts with the budget."""
    try:
        rover = rover_with({key: trial.suggest_float(key, *bounds, log=True) for key, bounds in SPACE.items()})
    except ValidationError:  # two settings that do not go together
        raise optuna.TrialPruned from None
    paths_m = []
    for layout in range(layouts):
        row = wayfarer.run_trial(layout, ALGORITHM, rover=rover, seed=SEARCHED, **OPTIONS).row
        paths_m.append(BUDGET_M if row.escape_path_m is None else row.escape_path_m)
        trial.report(paths_m[-1], layout)
        if trial.should_prune():
            raise optuna.TrialPruned
    return fmean(paths_m)


def search(points: int, layouts: int) -> optuna.Study:
    """Return the study once it has this many points; the first one is the current settings."""
    question = (wayfarer.__version__, ROVER, ALGORITHM, OPTIONS, SPACE, layouts)
    study = optuna.create_study(
        storage=JournalStorage(JournalFileBackend(str(OUT / "study.journal"))),
        study_name=repr(question),  # points of another question do not count
        load_if_exists=True,
        pruner=optuna.pruners.WilcoxonPruner(p_threshold=P_WORSE, n_startup_steps=LEAST_LAYOUTS),
    )
    # Another seed each time that it goes on: the same one would propose the same points again.
    study.sampler = optuna.samplers.TPESampler(seed=len(study.trials), multivariate=True, constant_liar=True)
    if not any(trial.params == PRESENT for trial in study.get_trials(states=[TrialState.COMPLETE])):
        study.enqueue_trial(PRESENT)
    while len(study.get_trials(states=[TrialState.COMPLETE, TrialState.PRUNED])) < points:
        study.optimize(lambda trial: evaluate(trial, layouts), n_trials=1, callbacks=[tell])
    return study


def tell(study: optuna.Study, trial: optuna.trial.FrozenTrial) -> None:
    """Say how a point ended, and which is the best one."""
    ended = f"{trial.value:.2f} m" if trial.value is not None and trial.state is TrialState.COMPLETE else "given up"
    best = f"best: {study.best_value:.2f} m, point {study.best_trial.number}"
    print(f"point {trial.number}: {ended} after {len(trial.intermediate_values)} layouts; {best}", flush=True)


def draw(study: optuna.Study) -> None:
    """Draw the paths as the search went on, and over each setting as a multiple of its current value."""
    plots.plot_optimization_history(study, target_name="mean path, m")
    pyplot.savefig(OUT / "history.png", bbox_inches="tight")
    plots.plot_slice(study, target_name="mean path, m")
    for axes in pyplot.gcf().axes[: len(SPACE)]:  # the last one is the colour bar's
        axes.set_xscale("linear")
    pyplot.gcf().set_size_inches(4.0 * len(SPACE), 4.0)  # room for their names
    pyplot.savefig(OUT / "settings.png", bbox_inches="tight")
    pyplot.close("all")


def confirm(best: Factors, layouts: int) -> None:
    """Compare the best settings with the current ones in held-out layouts, trial by trial, and say what that proves."""
    rows = []
    for name, rover in {"present": wayfarer.load_rover(ROVER), "tuned": rover_with(best)}.items():
        results = wayfarer.run_campaign(
            ALGORITHM, layouts, rover=rover, seed=HELD_OUT, jobs=os.cpu_count() or 1, **OPTIONS
        )
        rows += [row._replace(algorithm=name) for row in results.rows]
    _, tuned = wayfarer.compare(wayfarer.Results(results.plan, rows), against="present")
    for name, unit in (("success_percent_change", "percentage points"), ("path_m_change", "m if both got out")):
        value, low, high = (tuned[name + end] or 0.0 for end in ("", "_low", "_high"))
        print(f"held out: {name} {value:+.2f} [{low:+.2f}, {high:+.2f}] {unit}")
    shorter = (tuned["path_m_change_high"] or 0.0) < 0.0 <= tuned["success_percent_change"]
    gain = layouts >= LEAST_LAYOUTS and shorter
    print("a gain; for the rover file:" if gain else "no gain is shown; what was tried:")
    for table, values in tables_of(best).items():
        print(f"[{table}]", *(f"{name} = {value:g}" for name, value in values.items()), sep="\n")


def main(points: int, layouts: int, held_out: int) -> None:
    """Search, draw, confirm."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)  # Ctrl-C is reported below
    warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)  # the pruner and the plots say that they are
    OUT.mkdir(exist_ok=True)
    study = search(points, layouts)
    draw(study)
    if study.best_params == PRESENT:
        print("no point is better than the current settings: there is nothing to confirm")
    else:
        confirm(study.best_params, held_out)


def numbers(given: list[str], usual: tuple[int, int, int] = (60, 100, 200)) -> tuple[int, int, int]:
    """Return points, layouts and held-out layouts: those that are given, then the usual ones."""
    if len(given) > len(usual) or not all(each.isdecimal() and int(each) for each in given):
        raise SystemExit("give up to three whole numbers above 0: POINTS LAYOUTS HELD_OUT")
    points, layouts, held_out = (*map(int, given), *usual[len(given) :])
    return points, layouts, held_out


if __name__ == "__main__":
    try:
        main(*numbers(sys.argv[1:]))
    except KeyboardInterrupt:
        raise SystemExit("interrupted; run this again, and it goes on") from None
