"""The plan of a campaign: which forest, noise and seed each trial gets.

Everything here follows from the settings alone, so a trial is the same in any process and in any order,
and every algorithm meets the same forests with the same noise: comparisons are paired.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from wayfarer import __version__
from wayfarer.simhal.world.forest import ROVER_WIDTH_M, TREES_PER_HA, Forest
from wayfarer.simhal.world.physics import PHYSICS, GroundName, Physics

if TYPE_CHECKING:  # a trial needs the whole simulator: only the workers pay for importing it
    from wayfarer.config.rover_file import RoverConfig
    from wayfarer.experiments.trial_setup import TrialSpec
    from wayfarer.simhal.mujoco.terrain import Terrains
    from wayfarer.simhal.world.sites import FieldSite
    from wayfarer.simhal.world.slope import Slopes


class Task(NamedTuple):
    """One trial of one algorithm, at one point of a sweep; trials and points count from 0."""

    algorithm: str
    trial: int
    point: int = 0


@dataclass(frozen=True, slots=True)
class ForestFile:
    """The forests of a file, in its order, and what identifies its content."""

    name: str
    blake2b: str
    forests: tuple[Forest, ...]

    @property
    def noise_span(self) -> int:
        """How far apart the noise numbers of two passes through the file are."""
        noises = [forest.noise for forest in self.forests]
        return max(noises) - min(noises) + 1


@dataclass(frozen=True, slots=True)
class Campaign:
    """All that decides the results of a campaign.

    ``slip_mean_m`` is the mean distance between slip events and ``budget_m`` the path after which a rover
    counts as entrapped. Without ``forests`` the layouts are generated; with ``spl`` missing shortest paths
    are computed. ``depth`` is how far down the simulation goes: ``device`` or ``bus`` (``build_rover``). ``physics``,
    but for its ``slip_mean_m``, and the ``trees_per_ha`` of generated layouts are what a sweep may change beside the
    rover; ``--senses`` too changes ``physics``.
    ``scenario`` names the site (``world.sites``) that layouts are drawn of in place of the abstract forests, one a
    trial. With ``terrains`` the body moves in MuJoCo and not in physics-light; ``ground`` is what physics-light has
    under the wheels. With ``slopes`` a slope is drawn for each trial. ``faults`` strike each trial, as the option
    ``--fault`` writes them (``simhal.faults.kinds.parse_fault``).
    """

    algorithms: tuple[str, ...]
    trials: int
    rover: RoverConfig
    seed: int = 0
    slip_mean_m: float = 10.0
    budget_m: float = 1000.0
    spl: bool = False
    depth: str = "device"
    forests: ForestFile | None = None
    physics: Physics = PHYSICS
    trees_per_ha: float = TREES_PER_HA
    scenario: str | None = None
    terrains: Terrains | None = None
    ground: GroundName = GroundName.ideal
    slopes: Slopes | None = None
    faults: tuple[str, ...] = ()

    @property
    def site(self) -> FieldSite | None:
        """The site of the scenario."""
        if self.scenario is None:
            return None
        from wayfarer.simhal.world.sites import SITES

        return SITES[self.scenario]

    @property
    def points(self) -> Sequence[Campaign]:
        """Itself: a campaign is a sweep of one point."""
        return (self,)

    def forest_and_noise(self, trial: int) -> tuple[int, int]:
        """Return the numbers of a trial's layout and noise."""
        if self.forests is None:
            return (
                trial,
                0,
            )  # a second noise in the same layout would say little more: how trials go in it is correlated
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
        if site := self.site:
            forest = site.layout(number, self.seed, self.rover.vehicle)
        elif self.forests is None:
            from wayfarer.simhal.world.generate import generate_forest

            forest = generate_forest(number, noise, self.seed, self.trees_per_ha)
        else:
            forest = replace(self.forests.forests[trial % len(self.forests.forests)], noise=noise)
        width_m = self.rover.vehicle.width_m
        if forest.shortest_path_m is not None and width_m != ROVER_WIDTH_M:
            forest = replace(forest, shortest_path_m=None)  # a file's is that of another body
        if self.spl and forest.shortest_path_m is None:
            from wayfarer.simhal.world.shortest_path import shortest_path_m

            forest = replace(forest, shortest_path_m=shortest_path_m(forest, width_m))
        return forest

    def spec(self, task: Task, forest: Forest) -> TrialSpec:
        """Return everything that decides one trial."""
        from wayfarer.experiments.trial_setup import TrialSpec
        from wayfarer.simhal.build_rover import Depth
        from wayfarer.simhal.faults.kinds import parse_fault

        seed, depth = self.trial_seed(task.trial), Depth(self.depth)
        return TrialSpec(
            task.trial, task.algorithm, forest, seed, self.rover, self.slip_mean_m, self.budget_m, depth,
            tuple(map(parse_fault, self.faults)), physics=self.physics, site=self.site, terrains=self.terrains,
            ground=self.ground, slopes=self.slopes,
        )  # fmt: skip

    def settings(self) -> dict[str, Any]:
        """Return the settings as JSON can hold them: what makes two campaigns the same one."""
        return {
            "version": __version__,
            "algorithms": list(self.algorithms),
            "trials": self.trials,
            "seed": self.seed,
            "slip_mean_m": self.slip_mean_m,
            "budget_m": self.budget_m,
            "spl": self.spl,
            "depth": self.depth,
            "scenario": self.scenario,
            "forests": self.forests and {"file": self.forests.name, "blake2b": self.forests.blake2b},
            "rover": self.rover.model_dump(mode="json"),
            "mujoco": self.terrains and self.terrains.as_json(),
            "ground": self.ground.value,
            "slope": self.slopes and self.slopes.as_json(),
            "sim": asdict(self.physics),
            "faults": list(self.faults),
        }


class Plan(Protocol):
    """What can be run: a campaign, or a sweep, which is the same campaign at several points."""

    @property
    def points(self) -> Sequence[Campaign]:
        """The campaign at each point; all have the same algorithms and the same number of trials."""

    def settings(self) -> dict[str, Any]:
        """Return what makes two plans the same one, as JSON can hold it."""


def read_forest_file(source: str | Path) -> ForestFile:
    """Read a file of forests; the text ``reference`` is the one that comes with wayfarer.

    Raises:
        BadForest: no such file, nothing in it, or a forest that cannot be used; the text names file, line and
            reason.
    """
    from wayfarer.simhal.world.forest_file import content_of, forests_in

    content = content_of(source)
    checksum = blake2b(content, digest_size=16).hexdigest()
    return ForestFile(Path(source).name, checksum, tuple(forests_in(source, content)))
