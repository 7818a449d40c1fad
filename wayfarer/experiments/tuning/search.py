"""The search: Optuna proposes points, trials on the same forests judge them, batch by batch.

Everything follows from the plan and the finished trials: each batch is proposed from the results of those before it,
and its size does not depend on how many processes there are. So a search that goes on after an interruption proposes
the same points again, finds their trials kept, and comes to the same study.

*Common random numbers*: all points meet the same forests, slips and noise, so a point is compared trial by trial.
*Early stopping*: a point gets its forests in parts (``stages``). After each it is given up if it is worse than the best
point so far and the 95 % interval of the difference says so, or if more of its trials have failed than of the present
settings in all of theirs: that can never be made good.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import optuna
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution
from optuna.trial import TrialState

from wayfarer.errors import BadConfig
from wayfarer.experiments.campaign import Task, Tasks
from wayfarer.experiments.executors import Stopped
from wayfarer.experiments.paired_statistics import Difference, gain
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.sweep import laid_over_campaign
from wayfarer.experiments.tuning.objective import LEAST_LAYOUTS, Quantity, failures, layouts
from wayfarer.experiments.tuning.plan import SearchPlan
from wayfarer.experiments.tuning.space import SearchRange

BATCH = 8  # points that are proposed together: enough for many workers, few enough to learn between them
STAGES = (4, 2)  # a point is looked at after a fourth and after half of its forests
RANDOM_POINTS = 16  # at the beginning; two batches
LEAST_POINTS = 30  # to tell what is important: three of them are the best tenth
STUDY = "tune"  # what Optuna calls it
SEEDS = 2**32  # that a sampler can have

Ended = Literal["running", "whole", "worse", "failures", "refused"]
RunTrials = Callable[[Tasks, Callable[[TrialRow], None]], None]  # gives each finished trial to the second


@dataclass
class Point:
    """Settings that are tried: their number, 0 being the present ones, their values, and their trials so far, in order.

    ``ended`` says how its evaluation ended: all trials run (``whole``); given up as ``worse``, or for its ``failures``;
    or ``refused``, because its values do not go together. ``gain`` is that of the objective over the present settings
    in the same trials, positive where it is better.
    """

    number: int
    values: dict[str, float | int]
    rows: list[TrialRow] = field(default_factory=list)
    ended: Ended = "running"
    gain: Difference | None = None

    @property
    def gained(self) -> float:
        """The mean gain; less than any other where it is not known."""
        return self.gain.estimate.value if self.gain else float("-inf")


def stages(trials: int) -> list[int]:
    """Return after how many of its trials a point is looked at."""
    return [*(part for share in STAGES if (part := trials // share)), trials]


def advantage(own: Sequence[TrialRow], other: Sequence[TrialRow], quantity: Quantity) -> Difference | None:
    """Return how much better ``own`` are in the trials that both have, with the 95 % interval; None where unknown."""
    sign = quantity.sign

    def value(row: TrialRow) -> float | None:
        found = quantity.of(row)
        return None if found is None else sign * found

    return gain(zip(own, other, strict=False), value)


class Search:
    """A search that is carried out: ``points`` are those proposed so far, the present settings first.

    ``kept`` are the trials that are finished already; ``run_trials`` runs others.
    """

    def __init__(self, plan: SearchPlan, kept: Sequence[TrialRow], run_trials: RunTrials) -> None:
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self.plan = plan
        self._rows: dict[int, dict[int, TrialRow]] = defaultdict(dict)
        for row in kept:
            self._take(row)
        self._run_trials = run_trials
        self._tasks = plan.tasks()
        sampler = optuna.samplers.TPESampler(
            seed=plan.base.seed % SEEDS, n_startup_trials=RANDOM_POINTS, multivariate=True, constant_liar=True
        )
        self.storage = optuna.storages.InMemoryStorage()
        self.study = optuna.create_study(storage=self.storage, study_name=STUDY, direction="maximize", sampler=sampler)
        self._distributions = {each.key: _distribution(each) for each in plan.space}
        self.points = [Point(0, {each.key: each.now for each in plan.space})]
        plan.points[:] = [plan.base]

    def _take(self, row: TrialRow) -> None:
        self._rows[row.point][row.trial] = row

    @property
    def present(self) -> Point:
        """The settings that the rover has now."""
        return self.points[0]

    @property
    def best(self) -> Point:
        """The point with the largest gain of those with all trials; the present settings where none has a gain."""
        whole = [point for point in self.points[1:] if point.ended == "whole" and point.gained > 0.0]
        return max(whole, key=lambda point: point.gained, default=self.present)

    def run(self, told: Callable[[Search], object]) -> None:
        """Search to the end; ``told`` hears of each batch.

        Raises:
            Stopped: trials are missing, because a signal ended their run.
        """
        self._evaluate([self.present], self.plan.base.trials)
        self.present.ended = "whole"
        self._tell_present()
        for first in range(1, 1 + self.plan.proposals, BATCH):
            asked = [self._proposed(number) for number in range(first, min(first + BATCH, 1 + self.plan.proposals))]
            batch = [point for point, _ in asked]
            self.points += batch
            self._judge(batch)
            for point, trial in asked:
                _tell(self.study, trial, point)
            told(self)

    def _judge(self, batch: Sequence[Point]) -> None:
        best = self.best
        for trials in stages(self.plan.base.trials):
            going_on = [point for point in batch if point.ended == "running"]
            self._evaluate(going_on, trials)
            for point in going_on:
                point.gain = advantage(point.rows, self.present.rows, self.plan.quantity)
                point.ended = self._verdict(point, best)

    def _verdict(self, point: Point, best: Point) -> Ended:
        """Say whether a point goes on."""
        if failures(point.rows) > failures(self.present.rows):
            return "failures"
        if len(point.rows) == self.plan.base.trials:
            return "whole"
        if layouts(point.rows) < LEAST_LAYOUTS:
            return "running"  # no interval can be trusted yet
        found = advantage(point.rows, best.rows, self.plan.quantity)
        return "worse" if found is None or found.estimate.high < 0.0 else "running"

    def _evaluate(self, points: Sequence[Point], trials: int) -> None:
        """Let each of these points have its first ``trials`` trials."""
        missing = [
            (trial, point.number)
            for trial in range(trials)
            for point in points
            if trial not in self._rows[point.number]
        ]
        if missing:
            name = self.plan.algorithm
            numbers = [self._tasks.number(Task(name, *each)) for each in missing]
            self._run_trials(self._tasks.only([number for number in numbers if number is not None]), self._take)
        for point in points:
            rows = self._rows[point.number]
            if any(trial not in rows for trial in range(trials)):
                raise Stopped
            point.rows = [rows[trial] for trial in range(trials)]

    # -- Optuna --------------------------------------------------------------------------------------------------------

    def _proposed(self, number: int) -> tuple[Point, optuna.Trial]:
        trial = self.study.ask(self._distributions)
        values = {each.key: each.rounded(trial.params[each.key]) for each in self.plan.space}
        point = Point(number, values)
        try:
            self.plan.points.append(laid_over_campaign(self.plan.base, values))
        except BadConfig:  # two values that do not go together: such points cannot be told beforehand
            self.plan.points.append(self.plan.base)
            point.ended = "refused"
        return point, trial

    def _tell_present(self) -> None:
        """Let Optuna know the present settings, where they are within the space."""
        if all(each.low <= each.now <= each.high for each in self.plan.space):
            values: dict[str, Any] = self.present.values
            trial = optuna.trial.create_trial(params=values, distributions=self._distributions, value=0.0)
            self.study.add_trial(trial)

    def importance(self) -> dict[str, float]:
        """Return the share of each key in what makes points good, 0..1, largest first; nothing of too few points.

        By PED-ANOVA (S. Watanabe, A. Bansal, F. Hutter, IJCAI 2023), which needs no further package.
        """
        if len(self.study.get_trials(states=[TrialState.COMPLETE])) < LEAST_POINTS:
            return {}
        return optuna.importance.get_param_importances(self.study)


def _distribution(each: SearchRange) -> BaseDistribution:
    if each.whole:
        return IntDistribution(int(each.low), int(each.high), log=each.log)
    return FloatDistribution(each.low, each.high, log=each.log)


def _tell(study: optuna.Study, trial: optuna.Trial, point: Point) -> None:
    """Tell a point's gain; one that broke the limit, or cannot be, counts as worse than all."""
    trial.set_user_attr("point", point.number)
    trial.set_user_attr("ended", point.ended)
    if point.ended in {"failures", "refused"} or point.gain is None:
        study.tell(trial, state=TrialState.PRUNED)
    else:
        study.tell(trial, point.gained)
