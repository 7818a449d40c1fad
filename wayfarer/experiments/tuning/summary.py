"""What a search has found, as ``summary.json`` in its folder holds it: its page and its rover file are made of this."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from wayfarer.experiments.paired_statistics import gain
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import Estimate
from wayfarer.experiments.tuning.objective import LEAST_LAYOUTS, QUANTITIES, Quantity, failures, layouts

if TYPE_CHECKING:  # a report is also read where there is no optuna
    from wayfarer.experiments.tuning.search import Point, Search

DEVELOPMENT, HELD_OUT = "development", "held out"
Verdict = Literal["gain", "none", "loss", "too few"]
Known = Annotated[float, Field(allow_inf_nan=False)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid")


class TriedPoint(_Model):
    """A point: its values by key, how many trials it had, why it ended, its means, and the gain of the objective."""

    point: int
    values: dict[str, int | Known]  # a key that counts something stays whole
    trials: int
    ended: str
    failures: int
    gain: Known | None
    means: dict[str, Known | None]


class Change(_Model):
    """A quantity with either settings, and tuned less present with its 95 % interval, in the quantity's unit.

    All of it is over the pairs of trials that have the quantity on both sides: paths only where both got out.
    """

    present: Known | None
    tuned: Known | None
    difference: Known | None
    low: Known | None
    high: Known | None

    def text(self, decimals: int) -> str:
        """Return the difference with its interval."""
        if self.difference is None or self.low is None or self.high is None:
            return ""
        return Estimate(self.difference, self.low, self.high).text(decimals, "+")


class PairedResult(_Model):
    """The best point beside the present settings, trial by trial on the same forests, in one physics.

    The interval is by a bootstrap that draws whole layouts. Failures are trials that did not get out; ``verdict`` is of
    the objective: a gain or a loss whose interval contains 0 is none, and of fewer than ten layouts nothing is said.
    """

    physics: str
    forests: str
    trials: int
    layouts: int
    changes: dict[str, Change]
    present_failures: int
    tuned_failures: int
    verdict: Verdict


class TuneSummary(_Model):
    """A search that is done. ``best`` is a point's number, None where none was better than the present settings."""

    algorithm: str
    rover: str
    objective: Literal["spl", "time", "anomalies"]
    trials: int
    space: dict[str, tuple[Known, Known]]
    points: list[TriedPoint]
    importance: dict[str, Known]
    best: int | None
    development: PairedResult | None
    held_out: list[PairedResult]
    notes: list[str]

    @property
    def changed(self) -> dict[str, tuple[float, float]]:
        """What the best point changes: each key with its present and its tuned value."""
        if self.best is None:
            return {}
        present, tuned = self.points[0].values, self.points[self.best].values
        return {key: (present[key], value) for key, value in tuned.items() if value != present[key]}


def tried(point: Point) -> TriedPoint:
    """Return a point as the summary has it."""
    return TriedPoint(
        point=point.number,
        values=point.values,
        trials=len(point.rows),
        ended=point.ended,
        failures=failures(point.rows),
        gain=point.gain.estimate.value if point.gain else None,
        means={each.name: each.mean(point.rows) for each in QUANTITIES.values()},
    )


def paired(
    physics: str, forests: str, present: Sequence[TrialRow], tuned: Sequence[TrialRow], objective: str
) -> PairedResult:
    """Compare two settings in the same trials; the rows are in the same order."""
    pairs = list(zip(tuned, present, strict=True))
    changes = {each.name: _change(each, pairs) for each in QUANTITIES.values()}
    return PairedResult(
        physics=physics,
        forests=forests,
        trials=len(tuned),
        layouts=layouts(tuned),
        changes=changes,
        present_failures=failures(present),
        tuned_failures=failures(tuned),
        verdict=_verdict(changes[objective], QUANTITIES[objective].sign, layouts(tuned)),
    )


def _change(quantity: Quantity, pairs: Sequence[tuple[TrialRow, TrialRow]]) -> Change:
    """Compare over the pairs that have the quantity on both sides: paths only where both got out."""
    if (found := gain(pairs, quantity.of)) is None:
        return Change(present=None, tuned=None, difference=None, low=None, high=None)
    both = [pair for pair in pairs if None not in map(quantity.of, pair)]
    tuned, present = (quantity.mean(rows) for rows in zip(*both, strict=True))
    value, low, high = found.estimate
    return Change(present=present, tuned=tuned, difference=value, low=low, high=high)


def _verdict(change: Change, sign: int, count: int) -> Verdict:
    """Return what a difference proves; one whose interval contains 0 proves nothing."""
    if count < LEAST_LAYOUTS:
        return "too few"
    if change.difference is None or change.low is None or change.high is None or change.low <= 0.0 <= change.high:
        return "none"
    return "gain" if sign * change.difference > 0.0 else "loss"


def summarised(search: Search, held_out: Sequence[PairedResult], notes: Sequence[str]) -> TuneSummary:
    """Return what a search that has run to its end has found, and what was confirmed."""
    plan, best, present = search.plan, search.best, search.present
    name = plan.quantity.name
    found = None
    if best is not present:
        found = paired("light", DEVELOPMENT, present.rows, best.rows, name)
    return TuneSummary(
        algorithm=plan.algorithm,
        rover=plan.base.rover.name,
        objective=name,  # type: ignore[arg-type]
        trials=plan.base.trials,
        space={each.key: (each.low, each.high) for each in plan.space},
        points=[tried(point) for point in search.points],
        importance=search.importance(),
        best=None if best is present else best.number,
        development=found,
        held_out=list(held_out),
        notes=list(notes),
    )
