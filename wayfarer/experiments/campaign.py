"""The plan of a campaign: which forest, noise and seed each trial gets.

Everything here follows from the settings alone, so a trial is the same in any process and in any order,
and every algorithm meets the same forests with the same noise: comparisons are paired.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from hashlib import blake2b
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from wayfarer.experiments.keys import Conditions, drawn, laid_over
from wayfarer.experiments.settings import NAMES, CampaignSettings, Value
from wayfarer.simhal.world.forest import ROVER_WIDTH_M, Forest

if TYPE_CHECKING:  # a trial needs the whole simulator: only the workers pay for importing it
    from wayfarer.experiments.trial_setup import TrialSpec
    from wayfarer.simhal.faults.kinds import Fault
    from wayfarer.simhal.world.sites import FieldSite


class Task(NamedTuple):
    """One trial of one algorithm, at one point of a sweep; trials and points count from 0."""

    algorithm: str
    trial: int
    point: int = 0


@dataclass(frozen=True, slots=True)
class Axis:
    """A key and the values that it takes, at least one, each once, in the order in which they were asked for.

    ``now`` is what the campaign has for the key if it is not swept.
    """

    key: str
    values: tuple[Value, ...]
    now: Value | None = None

    @property
    def numeric(self) -> bool:
        """Return whether all values are numbers."""
        return not any(isinstance(value, str | bool) for value in self.values)


@dataclass(frozen=True)
class Campaign(CampaignSettings):
    """The settings of a campaign, and what follows from them for each trial."""

    @cached_property
    def fixed(self) -> Conditions:
        """What the keys decide that are not drawn."""
        return laid_over(self, self.fixed_values)

    def drawn(self, trial: int) -> dict[str, float]:
        """Return the values that a trial drew."""
        return drawn(self.ranges, self.trial_seed(trial))

    def conditions(self, drawn: Mapping[str, float]) -> Conditions:
        """Return what the keys decide of a trial that drew these values."""
        return laid_over(self, {**self.fixed_values, **drawn}) if drawn else self.fixed

    @property
    def field_site(self) -> FieldSite | None:
        """The site that layouts are drawn of in place of the abstract forests, one for each trial."""
        if self.site is None:
            return None
        from wayfarer.simhal.world.sites import SITES

        return SITES[self.site]

    @property
    def base(self) -> Campaign:
        """Itself, as a sweep has a campaign that it varies."""
        return self

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Nothing: a campaign is a sweep of one point."""
        return ()

    @property
    def points(self) -> tuple[Campaign, ...]:
        """Itself."""
        return (self,)

    def forest_and_noise(self, trial: int) -> tuple[int, int]:
        """Return the numbers of a trial's layout and noise."""
        if self.forests is None:
            return trial, 0  # a second noise in a layout would say little more: how trials go in it is correlated
        passes, index = divmod(trial, len(self.forests.forests))
        forest = self.forests.forests[index]
        return forest.forest, forest.noise + passes * self.forests.noise_span

    def trial_seed(self, trial: int) -> int:
        """Return the seed of a trial: 63 bits from the campaign's seed, the layout and the noise."""
        numbers = (self.seed, *self.forest_and_noise(trial))
        return int.from_bytes(blake2b(repr(numbers).encode(), digest_size=8).digest()) >> 1

    def make_forest(self, trial: int) -> Forest:
        """Return a trial's forest: generated, or from the file with this pass's noise number."""
        number, noise = self.forest_and_noise(trial)
        conditions = self.conditions(self.drawn(trial))
        if site := self.field_site:
            forest = site.layout(number, self.seed, conditions.rover.vehicle)
        elif self.forests is None:
            from wayfarer.simhal.world.generate import generate_forest

            forest = generate_forest(number, noise, self.seed, conditions.trees_per_ha)
        else:
            forest = replace(self.forests.forests[trial % len(self.forests.forests)], noise=noise)
        width_m = conditions.rover.vehicle.width_m
        if forest.shortest_path_m is not None and width_m != ROVER_WIDTH_M:
            forest = replace(forest, shortest_path_m=None)  # a file's is that of another body
        if self.spl and forest.shortest_path_m is None:
            from wayfarer.simhal.world.shortest_path import shortest_path_m

            forest = replace(forest, shortest_path_m=shortest_path_m(forest, width_m))
        return forest

    def spec(self, task: Task, forest: Forest) -> TrialSpec:
        """Return everything that decides one trial."""
        from wayfarer.experiments.trial_setup import TrialSpec

        faults: tuple[Fault, ...] = ()
        if self.faults:
            from wayfarer.simhal.faults.kinds import parse_fault  # a campaign without faults need not know them

            faults = tuple(map(parse_fault, self.faults))
        drawn = self.drawn(task.trial)
        met = self.conditions(drawn)
        return TrialSpec(
            task.trial, task.algorithm, forest, self.trial_seed(task.trial), met.rover, met.budget_m, self.depth,
            faults, physics=met.physics, site=self.field_site, terrain=met.terrain,
            ground=met.ground, drawn=drawn, go_on=self.go_on,
            files=self.files,
        )  # fmt: skip

    def settings(self) -> dict[str, Any]:
        """Return the settings as ``campaign.json`` has them: what makes two campaigns the same one."""
        return {name: _as_json(getattr(self, name)) for name in ("version", *NAMES)} | {
            "rover": self.rover.model_dump(mode="json", warnings=False),  # that of a folder is not checked
            "forests": self.forests and {"file": self.forests.name, "blake2b": self.forests.blake2b},
            **({"files": {name: file._asdict() for name, file in self.files.items()}} if self.files else {}),
        }


def _as_json(value: Any) -> Any:
    """Return a setting as JSON has it."""
    if isinstance(value, Mapping):
        return {key: _as_json(each) for key, each in value.items()}
    if isinstance(value, tuple):
        return list(value)
    return value.value if isinstance(value, Enum) else value


class Plan(Protocol):
    """What can be run: a campaign, or a sweep, which is the same campaign at several points."""

    @property
    def base(self) -> Campaign:
        """The campaign, without what a sweep varies."""

    @property
    def axes(self) -> tuple[Axis, ...]:
        """What a sweep varies; nothing in a campaign."""

    @property
    def points(self) -> tuple[Campaign, ...]:
        """The campaign at each point; all have the same algorithms and the same number of trials."""

    def settings(self) -> dict[str, Any]:
        """Return what makes two plans the same one, as JSON can hold it."""
