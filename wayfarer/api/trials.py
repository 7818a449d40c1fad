"""``run_trial``: one trial of a campaign, with its trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wayfarer.errors import BadInput, WayfarerError
from wayfarer.experiments.rows import TrialRow, row_of
from wayfarer.experiments.settings import describe
from wayfarer.extras import require

if TYPE_CHECKING:
    from wayfarer.experiments.trial_log import TrackRow, Trajectory
    from wayfarer.reports.page.html import Plot
    from wayfarer.simhal.world.forest import Forest


@dataclass(frozen=True, repr=False)
class Trial:
    """One simulated trial: ``row`` is its row of ``trials.csv``.

    >>> trial = run_trial(7)
    >>> trial
    <Trial 7 of forest-pledge: escaped>
    >>> north_m = [tick["y_m"] for tick in trial.track]
    >>> f"{min(north_m):.0f} m to {max(north_m):.0f} m north"
    '12 m to 50 m north'
    """

    row: TrialRow
    _ticks: Sequence[TrackRow]
    _trajectory: Trajectory
    _forest: Forest

    def __repr__(self) -> str:
        return f"<Trial {self.row.trial} of {self.row.algorithm}: {self.outcome}>"

    @property
    def outcome(self) -> str:
        """How it ended: ``escaped``, ``left_bounds``, ``entrapped``, ``tipped`` or ``fault``."""
        return self.row.outcome

    @property
    def track(self) -> list[dict[str, Any]]:
        """A row for each control tick, 20 per second: the true pose, which no rover knows, and the decision.

        ``t_s`` is the simulated time, seconds. ``x_m`` and ``y_m`` are metres east and north in the forest,
        ``heading_deg`` is clockwise from north, ``pitch_deg`` positive with the nose up, ``roll_deg`` with the right
        side down. ``left`` and ``right`` are the wheels' duties, -1 to 1. ``anomalies`` are joined by ``+``.
        """
        return [tick._asdict() for tick in self._ticks]

    def plot(self) -> Plot:
        """Return the map of the trial, which a notebook shows and ``save`` writes: forest, true path and slips.

        Metres, north up; the path has the colours of what the rover did. Bokeh's figure is ``figures[0]``.

        Raises:
            MissingPackage: Bokeh, of the extra ``sim``, is not installed.
        """
        require("a plot")
        from wayfarer.reports.worst_trials import trial_plot

        return trial_plot(self.row, self._forest, self._trajectory)


@describe(without=("algorithms", "trials"))
def run_trial(
    number: int = 0,
    algorithm: str = "forest-pledge",
    *,
    log_dir: str | Path | None = None,
    **settings: Any,
) -> Trial:
    """Run one trial of the campaign that ``run_campaign`` runs with the same arguments, and keep its trajectory.

    Args:
        number: of the trial, from 0, and of its layout if the forests are generated or of a site.
        algorithm: a name that ``wayfarer list`` prints, or one of your own as ``"FILE.py:NAME"`` or
            ``"module:attribute"``.
        settings: those of a campaign, in the page of that name.
        log_dir: a new or empty folder for the full field log, which ``open_run`` reads.

    Raises:
        BadInput: something that cannot be used; the text names it and says what is allowed.
        MissingPart: the rover does not have what the algorithm needs.
        TrialNotRun: the algorithm or a driver raised an error, which is the cause.
        MissingPackage: as of ``run_campaign``.

    >>> trial = run_trial(7)
    >>> trial.outcome, trial.row.path_m
    ('escaped', 78.962)
    >>> {tick["phase"] for tick in trial.track} >= {"follow", "back_off", "turn_away", "probe"}
    True
    """
    require("simulating")
    from wayfarer.experiments.campaign import Task
    from wayfarer.experiments.checks import make_campaign, make_empty_folder
    from wayfarer.experiments.pool import task_failed
    from wayfarer.experiments.run import not_run
    from wayfarer.experiments.trial import run_trial as run
    from wayfarer.experiments.trial_log import TrackLog

    if number < 0:
        raise BadInput(f"trial {number}: trials are counted from 0")
    campaign = make_campaign({**settings, "algorithms": algorithm, "trials": number + 1})
    if len(campaign.algorithms) > 1:
        raise BadInput(f"run_trial runs one algorithm; choose one of {', '.join(campaign.algorithms)}")
    folder = None if log_dir is None else Path(log_dir)
    if folder:
        make_empty_folder(folder, "the log")
    task = Task(campaign.algorithms[0], number)
    spec = campaign.spec(task, campaign.make_forest(number))
    track = TrackLog()
    try:
        result = run(spec, folder, track)
    except (WayfarerError, KeyboardInterrupt):
        raise
    except BaseException as error:  # an algorithm of a third party may raise anything
        failed = task_failed(task, error)
        raise not_run(failed, "correct that and run it again") from failed.error
    return Trial(row_of(result), track.ticks, track.trajectory(), spec.forest)
