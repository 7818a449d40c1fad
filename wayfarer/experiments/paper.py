"""What the paper reports of its trials (arXiv 2503.07492, section IV), and beside which campaigns that can stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.campaign import Campaign
from wayfarer.simhal.world.forest_file import read_forest_file

Figures = Mapping[str, float]  # by the name of a measure
Reported = Mapping[str, Figures]  # by algorithm

# Simulations, 1,000 trials each: path lengths as mean and SD of the successes, and the success of Forest-Pledge alone.
FORESTS: Reported = {
    "pledge": {"path_m": 82.5, "path_sd_m": 30.8},
    "forest-pledge": {"path_m": 81.3, "path_sd_m": 29.3, "success_percent": 99.7},
    "levy-pledge": {"path_m": 88.3, "path_sd_m": 46.3},
    "levy-walk": {"path_m": 247.5, "path_sd_m": 223.7},
}
# Field trials, ten each: successes, and mean and SD of the time to escape of the successes.
FIELD_TRIALS: Mapping[tuple[str, str], Mapping[str, tuple[int, float, float]]] = {
    ("extended-maze", "forestrover"): {"forest-pledge": (10, 152.0, 21.0), "levy-walk": (1, 141.0, 0.0)},
    ("extended-maze", "minirover"): {"forest-pledge": (10, 51.0, 15.0), "levy-walk": (6, 47.0, 25.0)},
    ("dense-obstruction", "forestrover"): {"forest-pledge": (10, 133.0, 32.0), "levy-walk": (6, 164.0, 70.0)},
    ("dense-obstruction", "minirover"): {"forest-pledge": (10, 38.0, 16.0), "levy-walk": (5, 46.0, 43.0)},
}
# "Human interventions averaging 11 across all 10 trials for the ForestRover (6 for MiniRover)": a mean over both sites
# and both algorithms. Here per trial.
INTERVENTIONS: Mapping[str, float] = {"forestrover": 1.1, "minirover": 0.6}
ITS_ROVER = "sim"  # in the forests
FREE = frozenset({"version", "algorithms", "trials", "seed", "spl", "depth", "forests"})  # not what it ran in


def reported(settings: Mapping[str, Any]) -> Reported:
    """Return the paper's figures by algorithm and measure, nothing if it did not run such a campaign.

    ``settings`` are as ``Campaign.settings`` has them. The paper ran its rover in forests of its generator, or one of
    its two rovers at a site, on ideal ground with its slips: a campaign with another rover, ground, sense or budget has
    no figure of the paper beside it.
    """
    site, rover = settings["site"], settings["rover"].get("name")
    if rover not in ({ITS_ROVER} if site is None else INTERVENTIONS):
        return {}
    usual = Campaign((), 1, load_rover(rover), site=site).settings()
    if any(settings[key] != value for key, value in usual.items() if key not in FREE):
        return {}
    if site is None:
        forests = settings["forests"]
        ours = forests is None or forests["blake2b"] == read_forest_file("reference").blake2b
        return FORESTS if ours else {}
    return {
        algorithm: {
            "success_percent": 10.0 * successes, "entrapped_percent": 100.0 - 10.0 * successes,
            "escape_s": mean_s, "escape_sd_s": sd_s, "interventions": INTERVENTIONS[rover],
        }
        for algorithm, (successes, mean_s, sd_s) in FIELD_TRIALS.get((site, rover), {}).items()
    }  # fmt: skip
