"""The worst trials of a campaign's report: chosen, run again to get their paths, and drawn."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from functools import partial
from itertools import chain, zip_longest
from math import radians
from typing import NamedTuple

import msgspec
import numpy as np
from bokeh.models import Range1d

from wayfarer import __version__
from wayfarer.errors import BadInput
from wayfarer.escape.api import Phase
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.pool import TaskFailed, run_tasks, task_failed
from wayfarer.experiments.results import Results
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.run import TrialRunner, not_run
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_log import TrackLog, Trajectory, TrajectoryPoint
from wayfarer.fieldlog.record import World
from wayfarer.logview import palette
from wayfarer.reports.data import EDGE, Floats, pieces
from wayfarer.reports.figures import SVG
from wayfarer.reports.map import ALONE_PX, draw_forest
from wayfarer.reports.page import html
from wayfarer.reports.page.html import Plot
from wayfarer.reports.page.plots import Figure, Plots, hover, layer, plot, source
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.forest_file import as_row
from wayfarer.vocabulary import in_words, outcome_in_words

MAP = (
    "Trunks and trees are to scale, north is up. Triangle: start, points to the goal; cross: end; green line: goal "
    "line."
)
GALLERY = (
    "Failures first, then the longest paths; each algorithm is drawn once before one is drawn again. These are "
    "therefore not typical trials but the worst. They are few, because trials.csv has no paths: each was run again for "
    f"its drawing, and gave the result in trials.csv, digit for digit. {MAP}"
)


class RerunTrial(NamedTuple):
    """A trial that was run again: its path, or why the path that it took this time is not the one in the table."""

    row: TrialRow
    trajectory: Trajectory | None
    why_not: str = ""


def choose(by_algorithm: Mapping[str, Sequence[TrialRow]], count: int) -> list[TrialRow]:
    """Return up to ``count`` trials worth looking at: failures first, then the longest paths.

    Every algorithm has its turn before one has a second. A trial of unknown path, as after a crash, is not chosen.
    """
    worst_first = [sorted((row for row in rows if row.path_m), key=_badness) for rows in by_algorithm.values()]
    turns = ([row for row in turn if row is not None] for turn in zip_longest(*worst_first))
    chosen = list(chain.from_iterable(sorted(turn, key=_badness) for turn in turns))[:count]
    return sorted(chosen, key=_badness)


def _badness(row: TrialRow) -> tuple[bool, float, int]:
    return row.outcome in SUCCESSES, -(row.path_m or 0.0), row.trial


def run_again(
    campaign: Campaign, rows: Sequence[TrialRow], jobs: int, progress: Callable[[object], object]
) -> list[RerunTrial]:
    """Run these trials of a campaign again, and return them with their trajectories, in the same order.

    ``progress`` is called with each trial when it is done.

    Raises:
        TrialNotRun: a worker process died.
    """
    found: dict[tuple[str, int, int], RerunTrial] = {}
    try:
        with closing(run_tasks(partial(_rerun, campaign), rows, jobs=jobs, stop=threading.Event())) as finished:
            for again in finished:
                found[again.row.key] = again
                progress(again)
    except TaskFailed as failed:
        raise not_run(failed, "use --jobs 1, or --gallery 0 for a report without it") from failed.error
    return [found[row.key] for row in rows]


def _rerun(campaign: Campaign, row: TrialRow) -> RerunTrial:
    """Run a trial; give its path only if it has the result of the table, in every column."""
    task, track = Task(*row.key), TrackLog()
    try:
        again = TrialRunner(campaign, run_trial=partial(run_trial, track=track))(task).row
    except (Exception, SystemExit) as error:  # an algorithm of a third party may raise anything
        return RerunTrial(row, None, f"cannot be run again: {task_failed(task, error).why}")
    return RerunTrial(row, track.trajectory()) if again == row else RerunTrial(row, None, _difference(row, again))


def _difference(row: TrialRow, again: TrialRow) -> str:
    """Say how two runs of a trial differ: by their ends, or by the first column that is not the same."""
    if ending(row) != ending(again):
        return f"{ending(row)} in the table, {ending(again)} now"
    name = next(name for name in TrialRow._fields if getattr(row, name) != getattr(again, name))
    return f"{name} is {getattr(row, name)} in the table and {getattr(again, name)} now"


def ending(row: TrialRow) -> str:
    """Say how a trial ended, and after which path."""
    outcome = outcome_in_words(row.outcome)
    return outcome if row.path_m is None else f"{outcome} after {row.path_m:.1f} m"


# -- the gallery ------------------------------------------------------------------------------------------------------

SLIPS = html.PlotLayer("slips", "Slips", palette.ANOMALY)
PLACE = (("east", "@x{0.0} m"), ("north", "@y{0.0} m"))
AFTER = ("after", "@t_s{0} s")
CLOSE_M = 20.0  # to the goal line

Progress = Callable[[int], AbstractContextManager[Callable[[object], object]]]


def no_progress(_trials: int) -> AbstractContextManager[Callable[[object], object]]:
    """Show no progress."""
    return nullcontext(lambda _done: None)


def worst_section(
    results: Results, plots: Plots, count: int, jobs: int, *, allow_code: bool, progress: Progress
) -> Iterator[str]:
    """Yield the sections on the worst trials, which are run again for that."""
    heading = "The worst trials, seen from above"
    rows = choose(results.by_algorithm, count)
    if not rows:
        yield html.section(heading, html.paragraph("No trial is drawn."))
        return
    try:
        campaign = results.rebuild(allow_code=allow_code)
    except BadInput as reason:
        yield html.section(heading, html.paragraph(f"No trial is drawn: {reason}."))
        return
    with progress(len(rows)) as advance:
        ran = run_again(campaign, rows, jobs, advance)
    yield html.section(
        heading, *_gallery(campaign, ran, plots, len(results.rows)), *_not_drawn(ran, results.plan.base.version)
    )


def _gallery(campaign: Campaign, ran: Sequence[RerunTrial], plots: Plots, trials: int) -> Iterator[str]:
    """Yield the maps of the trials beside each other, under one key for all."""
    maps = []
    for row, trajectory, _ in ran:
        if trajectory is not None:
            drawn = trial_map(f"{row.algorithm}-{row.trial}", campaign.make_forest(row.trial), trajectory)
            maps.append(html.figure(plots.place(drawn), trial_text(row, len(trajectory.slips_m))))
    if maps:
        yield html.paragraph(f"{len(ran)} of {trials:,} trials. {GALLERY}")
        yield _map_layers()
        yield html.panels(maps)


def _not_drawn(ran: Sequence[RerunTrial], version: str) -> Iterator[str]:
    """Yield which trials have no drawing: a picture of another run would be wrong."""
    missing = [again for again in ran if again.trajectory is None]
    if missing:
        yield html.paragraph(
            f"Not drawn, because their results were different when wayfarer {__version__} ran them again (the table is "
            f"of wayfarer {version}): the code or an algorithm has changed since, and a drawing would show another run."
        )
        yield html.bullets(f"{again.row.algorithm}, trial {again.row.trial}: {again.why_not}" for again in missing)


# -- the map of one trial: its forest, its true path by phases, slips, start and end -----------------------------------


def trial_map(name: str, forest: Forest, trajectory: Trajectory) -> Figure:
    """Return the map of a trial, metres, north up; ``name`` is the figure's."""
    made = plot(name, None, "map", output_backend=SVG, sizing_mode="scale_width", aspect_ratio=1.0, match_aspect=True)
    made.xaxis.axis_label, made.yaxis.axis_label = "east, m", "north, m"
    made.min_border_left = 52  # for the label beside its numbers, whichever they are
    if forest.goal_y_m - forest.start_m[1] < CLOSE_M:  # at a site: all of the map would show the clutter as a dot
        half_m = CLOSE_M / 2.0 + 1.0
        made.x_range, made.y_range = (Range1d(start=at - half_m, end=at + half_m) for at in forest.start_m)
    draw_forest(made, msgspec.convert(as_row(forest), World))
    for phase in Phase:
        if phase.value in palette.PHASE_COLOURS:
            x_m, y_m, t_s = path_in(trajectory.points, phase)
            line = made.line(
                "x", "y", source=source(x=x_m, y=y_m, t_s=t_s), line_color=palette.PHASE_COLOURS[phase.value],
                line_width=2, line_join="round",
            )  # fmt: skip
            layer(phase.value, line)
            made.add_tools(hover([line], ("phase", in_words(phase.value)), AFTER, *PLACE, line_policy="nearest"))
    x_m, y_m = np.reshape(trajectory.slips_m, (-1, 2)).T
    slips = made.scatter("x", "y", source=source(x=x_m, y=y_m), size=6, fill_color=palette.ANOMALY, **EDGE)
    layer("slips", slips)
    made.add_tools(hover([slips], ("slip", "the ground gave way"), *PLACE))
    _mark_ends(made, forest, trajectory.points[-1])
    return made


def _map_layers() -> str:
    driven = palette.PHASE_COLOURS.keys() - {Phase.MANUAL.value}  # nobody drives a trial by hand
    return html.layers("Show", [*html.phase_layers(driven), SLIPS])


def trial_plot(row: TrialRow, forest: Forest, trajectory: Trajectory) -> Plot:
    """Return the map of a trial on its own."""
    plots, drawn = Plots(), trial_map(f"{row.algorithm}-{row.trial}", forest, trajectory)
    drawn.max_width = ALONE_PX
    caption = f"{trial_text(row, len(trajectory.slips_m))} {MAP}"
    body = [_map_layers(), html.figure(plots.place(drawn), caption)]
    return Plot(f"{row.algorithm}, trial {row.trial}", body, plots)


def path_in(points: Sequence[TrajectoryPoint], phase: Phase) -> list[Floats]:
    """Return x, y and time of a path in a phase as one line with gaps; each part ends where the next phase begins."""
    columns = (np.array([getattr(point, name) for point in points]) for name in ("x_m", "y_m", "t_s"))
    return pieces(np.array([point.phase is phase for point in points]), *columns)


def _mark_ends(made: Figure, forest: Forest, last: TrajectoryPoint) -> None:
    """Mark the start with a triangle that points to the goal, and the end with a cross."""
    x_m, y_m = forest.start_m
    start = made.scatter(
        "x", "y", source=source(x=[x_m], y=[y_m]), marker="triangle", size=15, fill_color=palette.GOAL_LINE,
        angle=-radians(forest.heading_deg), **EDGE,
    )  # fmt: skip
    ended = source(x=[last.x_m], y=[last.y_m], t_s=[last.t_s])
    end = made.scatter("x", "y", source=ended, marker="x", size=13, line_width=4, line_color=palette.VERMILION)
    made.add_tools(hover([start], ("start", "points to the goal"), *PLACE), hover([end], ("end", ""), AFTER, *PLACE))


def trial_text(row: TrialRow, slips: int) -> str:
    """Say which trial a drawing shows, and how it ended."""
    share = ""
    if row.outcome in SUCCESSES and row.path_m and row.shortest_path_m:
        share = f", {row.path_m / row.shortest_path_m:.1f} times the shortest path"
    return (
        f"{row.algorithm}, trial {row.trial} (forest {row.forest}, noise {row.noise}): {ending(row)}{share}. "
        f"{row.anomalies} anomalies, {slips} slips."
    )
