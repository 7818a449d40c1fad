"""The paper's three groups of algorithms, and a fourth for all others."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from wayfarer.escape.catalogue import CATALOGUE

TITLES = {"pledge": "Pledge-inspired", "stochastic": "Stochastic", "reactive": "Reactive"}  # as in the paper's figure
OTHERS = "Others"
LONGEST_NAME = 18  # letters; a longer name would take the place of the data


class Group(NamedTuple):
    """Algorithms of one kind."""

    title: str
    algorithms: list[str]


def grouped(algorithms: Iterable[str]) -> list[Group]:
    """Return the groups that occur, in the paper's order."""
    members: dict[str, list[str]] = {title: [] for title in (*TITLES.values(), OTHERS)}
    for name in algorithms:
        members[TITLES[CATALOGUE[name].family] if name in CATALOGUE else OTHERS].append(name)
    return [Group(title, names) for title, names in members.items() if names]


def short(name: str) -> str:
    """Return a name that fits beside an axis: of ``package.module:attribute`` the end says the most."""
    return name if len(name) <= LONGEST_NAME else "…" + name[1 - LONGEST_NAME :]
