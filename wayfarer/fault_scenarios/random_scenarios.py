"""Random scenarios: which faults, when, how long and how severe, and operator commands meanwhile.

Everything is drawn from one stream of the scenario's own seed, so the same seed is the same scenario on any machine.
What is drawn is only what the rover can have at that depth: a fault on the wires needs a part on wires.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from functools import cache
from math import exp, inf, log
from random import Random
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from annotated_types import Interval

from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.errors import BadInput, MissingPackage
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.fault_scenarios.scenario import Command, Expectation, ResponseLevel, Scenario
from wayfarer.fault_scenarios.scenario_rover import misfit
from wayfarer.simhal.build_rover import Depth, missing_package
from wayfarer.simhal.faults.kinds import KINDS, Fault
from wayfarer.simhal.random_streams import RandomStreams

ROVERS = ("sim", "forestrover", "minirover")
FAULTS_MOST, COMMANDS_MOST = 5, 6
LASTS_S = (20.0, 60.0)  # a scenario
SHORTEST_S, LONGEST_S = 0.05, 10.0  # a fault, or a delay, that ends
START_DELAY_S = 0.5  # nobody stands beside a simulated rover
SMALL_PICTURE = {"width": 64, "height": 48}  # drawing a large one takes most of a trial's time
TO_THE_END, AT_A_LIMIT = 0.2, 0.2  # shares of faults that last, and of parameters that are as bad as may be
ASKED: tuple[Literal["arm", "hold", "resume", "disarm"], ...] = ("arm", "hold", "resume", "disarm")
OFTEN = (5, 1, 3, 1)  # how often each is asked for, beside the others
FOREST = 0.8  # share of scenarios among trees; the others are in a clearing, where the rover is soon out

# The numbers of each part's readings, and how far off they may be.
NUMBERS: Mapping[str, Mapping[str, float]] = {
    "compass": {"heading_deg": 180.0, "pitch_deg": 90.0, "roll_deg": 90.0},
    "motion": {"forward_m": 0.5, "right_m": 0.5, "quality": 1.0},
}
_NAMES_A_NUMBER = "of"


class FaultTarget(NamedTuple):
    """A kind of fault, and what it happens to."""

    kind: str
    target: str


def possible_faults(config: RoverConfig, depth: Depth) -> tuple[FaultTarget, ...]:
    """Return every kind of fault that a simulated rover can have at a depth, at every target."""
    return tuple(
        FaultTarget(name, target)
        for name, kind in KINDS.items()
        for target in kind.targets
        if _can_happen(name, target, config, depth)
    )


def _can_happen(name: str, target: str, config: RoverConfig, depth: Depth) -> bool:
    if misfit(config, depth, Fault(0.0, inf, target, name)):
        return False
    return target in NUMBERS or _NAMES_A_NUMBER not in {each.name for each in fields(KINDS[name].params)}


def ready_for(places: Iterable[FaultTarget]) -> tuple[Fault, ...]:
    """Return faults that never begin: a rover built for them is ready for any others, begun while it runs."""
    return tuple(
        Fault(inf, inf, target, "silent")
        for target in sorted({target for kind, target in places})
        if target in KINDS["silent"].targets
    )


def draw_params(place: FaultTarget, rng: Random) -> Any:
    """Return a kind's parameters, anywhere in their ranges."""
    params = KINDS[place.kind].params
    hints = get_type_hints(params, include_extras=True)
    drawn: dict[str, Any] = {}
    span = inf
    if _NAMES_A_NUMBER in hints:
        number = drawn[_NAMES_A_NUMBER] = rng.choice(sorted(NUMBERS[place.target]))
        span = NUMBERS[place.target][number]
    for name, hint in hints.items():
        if name != _NAMES_A_NUMBER:
            drawn[name] = _draw(name, hint, span, rng)
    return params(**drawn)


def _draw(name: str, hint: Any, span: float, rng: Random) -> Any:
    """Return a value for a parameter; one without a declared range is within ``span`` on both sides of zero."""
    if get_origin(hint) is Literal:
        return rng.choice(get_args(hint))
    low, high = _range(hint, span)
    if name.endswith("_s"):
        high = min(high, LONGEST_S)
    drawn = rng.choice((low, high)) if rng.random() < AT_A_LIMIT else rng.uniform(low, high)
    return round(drawn) if int in get_args(hint) else round(drawn, 3)


def _range(hint: Any, span: float) -> tuple[float, float]:
    interval = next((each for each in get_args(hint) if isinstance(each, Interval)), Interval())
    low, high = -span, span
    if interval.ge is not None:
        low = float(interval.ge)  # type: ignore[arg-type]
    elif interval.gt is not None:
        low = float(interval.gt) + SHORTEST_S  # type: ignore[arg-type]
    if interval.le is not None:
        high = float(interval.le)  # type: ignore[arg-type]
    return low, high


def refuse_missing_package(rover: str | None, depth: Depth | None) -> None:
    """Refuse scenarios of which some could not be run: those that draw a rover whose drivers need a package.

    Raises:
        BadInput: there is no such rover, or its file is not right.
        MissingPackage: the text says what to install, and what to draw instead.
    """
    for name in (rover,) if rover else ROVERS:
        if why := missing_package(_rover(name), depth or Depth.BUS):
            instead = "--depth device" if rover else "--depth device, or --rover forestrover"
            raise MissingPackage(f"{why}; or leave such trials out: {instead}")


def draw_scenario(seed: int, rover: str | None = None, depth: Depth | None = None) -> Scenario:
    """Return the scenario of a seed; rover and depth are drawn as well where they are not given.

    Raises:
        BadInput: there is no such rover, its file is not right, or it has not the parts for that depth.
    """
    rng = RandomStreams(seed).random("random faults")
    # Both are drawn even where they are given, so that naming those of a trial gives that trial again.
    drawn = rng.choice(ROVERS)
    config = _rover(rover or drawn)
    depths = [each for each in Depth if possible_faults(config, each)]
    drawn_depth = rng.choice(depths)
    depth = depth or drawn_depth
    if depth not in depths:
        raise BadInput(f"rover '{config.name}' lacks the parts that {depth} depth needs; use --depth {depths[0]}")
    for_s = round(rng.uniform(*LASTS_S))
    return Scenario(
        f"random-{seed}",
        "faults by chance",
        Expectation(ResponseLevel.NONE, inf),
        tuple(_draw_faults(possible_faults(config, depth), for_s, rng)),
        rover=rover or drawn,
        depth=depth,
        algorithm=rng.choice(_algorithms(config)),
        for_s=for_s,
        seed=seed,
        slip_mean_m=rng.choice((2.0, 10.0)),
        clearing=rng.random() >= FOREST,
        commands=(Command(0.0, "arm"), *_draw_commands(for_s, rng)),
        settings=quick_settings(config),
    )


def quick_settings(config: RoverConfig) -> dict[str, Any]:
    """Return what is laid over a rover file so that a trial is short: no start delay, small pictures."""
    settings: dict[str, Any] = {"safety": {"start_delay_s": START_DELAY_S}}
    if config.parts.get("motion", {}).get("driver") == "camera_motion":
        settings["parts"] = {"motion": SMALL_PICTURE}
    return settings


@cache
def _rover(name: str) -> RoverConfig:
    return load_rover(name)


def _algorithms(config: RoverConfig) -> list[str]:
    return [name for name, algorithm in CATALOGUE.items() if algorithm.requires <= set(config.parts)]


def _draw_faults(places: tuple[FaultTarget, ...], for_s: float, rng: Random) -> Iterator[Fault]:
    """Yield one to five faults, none of them twice at the same time."""
    for place in sorted(rng.sample(places, rng.randint(1, FAULTS_MOST))):
        yield draw_fault(place, round(rng.uniform(0.0, for_s), 3), rng)


def draw_fault(place: FaultTarget, at_s: float, rng: Random, lasts_most_s: float = inf) -> Fault:
    """Return a fault that begins at a time; how long it lasts is anything between a tick and to the end."""
    lasts_s = inf if rng.random() < TO_THE_END else round(_log_uniform(SHORTEST_S, LONGEST_S, rng), 3)
    return Fault(at_s, min(lasts_s, lasts_most_s), place.target, place.kind, draw_params(place, rng))


def _log_uniform(low: float, high: float, rng: Random) -> float:
    return exp(rng.uniform(log(low), log(high)))


def _draw_commands(for_s: float, rng: Random) -> list[Command]:
    asked = rng.choices(ASKED, OFTEN, k=rng.randint(0, COMMANDS_MOST))
    times_s = sorted(round(rng.uniform(1.0, for_s), 3) for _ in asked)
    return [Command(at_s, do) for at_s, do in zip(times_s, asked, strict=True)]
