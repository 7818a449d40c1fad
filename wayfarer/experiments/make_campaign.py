"""The campaign that a command's options ask for, or a call of the Python API, with all of it checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from typing import Annotated, Literal, TypedDict

from annotated_types import Interval

from wayfarer.config.messages import validated
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.experiments import commands
from wayfarer.experiments.campaign import Campaign, read_forest_file
from wayfarer.experiments.sweep import MOST_TRIALS
from wayfarer.extras import require
from wayfarer.simhal.world.physics import GroundName

AnomalySource = Literal["motion", "contact"]
Drawn = float | str | None  # a number, or ``MIN:MAX`` to draw one for each trial


class CampaignOptions(TypedDict, total=False):
    """Options of ``make_campaign`` beside its algorithms and trials: see ``api.campaigns.run_campaign``."""

    rover: str | Path | RoverConfig
    anomaly_source: AnomalySource | None
    forests: str | Path | None
    senses: str
    site: str | None
    seed: int
    slip_mean_m: float
    budget_m: float
    spl: bool
    depth: str
    ground: str
    physics: str
    friction: Drawn
    roughness_m: Drawn
    torque_scale: Drawn
    slope_deg: Drawn
    slope_direction_deg: Drawn
    faults: Sequence[str]


@dataclass(frozen=True, slots=True)
class CampaignNumbers:
    """What has a range, or a few values."""

    trials: Annotated[int, Interval(ge=1, le=MOST_TRIALS)]
    seed: Annotated[int, Interval(ge=0, lt=2**63)]
    slip_mean_m: Annotated[float, Interval(gt=0, lt=inf)]
    budget_m: Annotated[float, Interval(gt=0, lt=inf)]
    depth: Literal["device", "bus"]
    ground: GroundName
    physics: Literal["light", "mujoco"]
    spl: bool
    anomaly_source: AnomalySource | None


def make_campaign(
    algorithms: str | Sequence[str],
    *,
    rover: str | Path | RoverConfig = "sim",
    anomaly_source: AnomalySource | None = None,
    forests: str | Path | None = None,
    senses: str = "ideal",
    site: str | None = None,
    trials: int,
    seed: int = 0,
    slip_mean_m: float = 10.0,
    budget_m: float = 1000.0,
    spl: bool = False,
    depth: str = "device",
    ground: str = GroundName.ideal,
    physics: str = "light",
    friction: Drawn = None,
    roughness_m: Drawn = None,
    torque_scale: Drawn = None,
    slope_deg: Drawn = None,
    slope_direction_deg: Drawn = None,
    faults: Sequence[str] = (),
) -> Campaign:
    """Return the campaign with these options of ``wayfarer sim``.

    ``algorithms`` is a list, or a text with commas; ``paper`` stands for all ten of the paper.

    Raises:
        BadInput: no such algorithm, rover, forest file, senses, site or fault, or one that cannot be used with the
            others; or a number is out of its range.
        MissingPackage: shortest paths, a site or MuJoCo need a library that is not installed.
    """
    numbers = validated(
        CampaignNumbers,
        {
            "trials": trials, "seed": seed, "slip_mean_m": slip_mean_m, "budget_m": budget_m, "depth": depth,
            "ground": ground, "physics": physics, "spl": spl, "anomaly_source": anomaly_source,
        },
    )  # fmt: skip
    settings = asdict(numbers)
    del settings["anomaly_source"], settings["physics"]  # the one is the rover's, the other its terrains
    terrain = {"friction": friction, "roughness_m": roughness_m, "torque_scale": torque_scale}
    where = rover.name if isinstance(rover, RoverConfig) else str(rover)
    config = rover if isinstance(rover, RoverConfig) else load_rover(where)
    campaign = Campaign(
        commands.algorithms(algorithms if isinstance(algorithms, str) else ",".join(algorithms)),
        rover=config.with_anomaly_source(anomaly_source) if anomaly_source else config,
        forests=read_forest_file(forests) if forests else None,
        physics=commands.senses(senses),
        terrains=commands.terrains(terrain, physics, ground),
        slopes=commands.slopes({"slope_deg": slope_deg, "slope_direction_deg": slope_direction_deg}),
        faults=commands.faults(faults, config, numbers.depth),
        **settings,
    )
    if numbers.spl:
        require("--spl")
    if site is not None:
        require("--site")
        campaign = commands.at_site(campaign, site)
    commands.check_points([campaign], where)
    return campaign
