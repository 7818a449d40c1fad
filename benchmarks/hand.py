"""Is the other hand ever worth it? What it costs at contacts of different kinds, and a small tree learnt from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import r2_score, roc_auc_score
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.tree import DecisionTreeRegressor, export_text

from benchmarks.other_hand import Contact
from wayfarer.experiments.statistics import Estimate

HEADER = ("contact", "contacts", "the other hand costs, m [95 %]", "it is better in", "told in advance, it saves, m")
KNOWN = (
    "offset_m", "ahead_m", "bearing_deg", "wall_m", "wall_deg", "driven_m", "counter_deg", "last_counter_deg",
    "episodes", "slips",
)  # fmt: skip
LEAVES, FOLDS, RESAMPLES = 8, 10, 1000

KINDS: dict[str, Callable[[Contact], bool]] = {
    "first wall": lambda contact: contact.first_wall,
    "first of a later episode": lambda contact: contact.new_episode and not contact.first_wall,
    "during an episode": lambda contact: not contact.new_episode,
}


def _between(name: str, low: float, high: float) -> Callable[[Contact], bool]:
    return lambda contact: not contact.first_wall and low <= getattr(contact, name) < high


GROUPS: dict[str, Callable[[Contact], bool]] = {
    **KINDS,
    "up to 5 m off the line": _between("offset_m", -100, 5),
    "5 to 10 m off": _between("offset_m", 5, 10),
    "10 to 15 m off": _between("offset_m", 10, 15),
    "further off": _between("offset_m", 15, 100),
    "wall leads ahead (below 80 degrees)": _between("wall_deg", 0, 80),
    "across (80 to 120)": _between("wall_deg", 80, 120),
    "back (above 120)": _between("wall_deg", 120, 181),
    "C above 120 degrees": _between("counter_deg", 120, 2000),
}


def rows(contacts: Sequence[Contact]) -> Iterator[tuple[str, ...]]:
    """Yield the table's lines; a group without contacts has none."""
    for name, belongs in GROUPS.items():
        if group := [contact for contact in contacts if belongs(contact)]:
            costs_m = np.array([contact.cost_m for contact in group])
            mean_m = by_layout(group, costs_m)
            told_m = np.maximum(0.0, -costs_m).mean()
            better = f"{100 * np.mean(costs_m < 0):.0f} %"
            yield name, f"{len(group)}", mean_m.text(1, "+"), better, f"{told_m:.1f}"


def by_layout(contacts: Sequence[Contact], values: NDArray[np.float64]) -> Estimate:
    """Return the mean of a value a contact, with its 95 % interval by bootstrap of whole layouts."""
    _, layout = np.unique([contact.layout for contact in contacts], return_inverse=True)
    sums, counts = np.bincount(layout, values), np.bincount(layout)
    drawn = np.random.default_rng(0).integers(0, len(sums), (RESAMPLES, len(sums)))
    low, high = np.quantile(sums[drawn].sum(1) / counts[drawn].sum(1), (0.025, 0.975))
    return Estimate(float(values.mean()), float(low), float(high))


def tree_lines(contacts: Sequence[Contact]) -> Iterator[str]:
    """Yield, for each kind of contact, how a tree does on layouts that it was not learnt from, and the tree itself.

    A kind with contacts in fewer than ``FOLDS`` layouts has none.
    """
    for name, belongs in KINDS.items():
        group = [contact for contact in contacts if belongs(contact)]
        layouts = [contact.layout for contact in group]
        if len(set(layouts)) < FOLDS:
            continue
        known = np.array([[getattr(contact, key) for key in KNOWN] for contact in group])
        costs_m = np.array([contact.cost_m for contact in group])
        tree = DecisionTreeRegressor(max_leaf_nodes=LEAVES, min_samples_leaf=max(2, len(group) // 25), random_state=0)
        said_m = cross_val_predict(tree, known, costs_m, groups=layouts, cv=GroupKFold(FOLDS))
        gain_m = by_layout(group, np.where(said_m < 0.0, -costs_m, 0.0))
        yield (
            f"\n{name}: R2 {r2_score(costs_m, said_m):.2f}, AUC {roc_auc_score(costs_m < 0, -said_m):.2f}, changes the "
            f"hand in {100 * np.mean(said_m < 0):.0f} %, gain {gain_m.text(2, '+')} m"
        )
        yield export_text(tree.fit(known, costs_m), feature_names=list(KNOWN), decimals=1)
