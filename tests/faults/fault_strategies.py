"""Hypothesis strategies: any fault that a rover can have, with any parameters, and scenarios of such faults.

What is drawn is only what the rover can have at that depth: a fault on the wires needs a part on wires. If a
scenario breaks a rule, Hypothesis makes it as small as it can and prints it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from math import inf
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from annotated_types import Interval
from hypothesis import strategies as st

from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.simhal.faults.kinds import KINDS, Fault, misfit
from wayfarer.simhal.world.physics import Depth
from wayfarer.testing.scenario import Command, Expectation, ResponseLevel, Scenario
from wayfarer.testing.scenario_run import RunResult

ROVERS = ("sim", "forestrover", "minirover")
FAULTS_MOST, COMMANDS_MOST = 5, 6
LASTS_S = (20, 60)  # a scenario
SHORTEST_S, LONGEST_S = 0.05, 10.0  # a fault, or a delay, that ends
QUICK: dict[str, Any] = {"safety": {"start_delay_s": 0.5}}  # nobody stands beside a simulated rover
SMALL_PICTURES = {"parts": {"motion": {"width": 64, "height": 48}}}  # large ones take 2.5 times as long
# How a run may end by an error: a part that does not answer when it is opened, and a bug that was injected.
REFUSALS = frozenset({"NotResponding", "WrongPart", "BadReading", "Bug"})
# The numbers of each part's readings, and how far off they may be.
NUMBERS = {
    "compass": {"heading_deg": 180.0, "pitch_deg": 90.0, "roll_deg": 90.0},
    "motion": {"forward_m": 0.5, "right_m": 0.5, "quality": 1.0},
}


class FaultTarget(NamedTuple):
    """A kind of fault, and what it happens to."""

    kind: str
    target: str


def possible_faults(config: RoverConfig, depth: Depth) -> tuple[FaultTarget, ...]:
    """Return every kind of fault that a simulated rover can have at a depth, at every target."""
    places = [FaultTarget(name, target) for name, kind in KINDS.items() for target in kind.targets]
    return tuple(
        place
        for place in places
        if not misfit(Fault(0.0, inf, place.target, place.kind), config, depth)
        and (place.target in NUMBERS or "of" not in _hints(place))
    )


def ready_for(places: Iterable[FaultTarget]) -> tuple[Fault, ...]:
    """Return faults that never begin: a rover built for them is ready for any others, begun while it runs."""
    parts = sorted({target for _, target in places} & set(KINDS["silent"].targets))
    return tuple(Fault(inf, inf, part, "silent") for part in parts)


def _hints(place: FaultTarget) -> dict[str, Any]:
    kind = KINDS[place.kind]
    hints = get_type_hints(kind, include_extras=True)
    return {each.name: hints[each.name] for each in fields(kind)}


RIGS = [(rover, depth) for rover in ROVERS for depth in Depth]
PLACES = sorted({place for rover, depth in RIGS for place in possible_faults(load_rover(rover), depth)})


def params(place: FaultTarget) -> st.SearchStrategy[Any]:
    """A kind's parameters, anywhere in their ranges; one without a range is within what its number can be off."""
    kind, hints = KINDS[place.kind], _hints(place)
    if hints.pop("of", None) is None:
        return st.builds(kind, **{name: _values(name, hint, inf) for name, hint in hints.items()})
    of_each_number = [
        st.builds(kind, of=st.just(number), **{name: _values(name, hint, span) for name, hint in hints.items()})
        for number, span in NUMBERS[place.target].items()
    ]
    return st.one_of(of_each_number)


def _values(name: str, hint: Any, span: float) -> st.SearchStrategy[Any]:
    if get_origin(hint) is Literal:
        return st.sampled_from(get_args(hint))
    limits: Any = next((each for each in get_args(hint) if isinstance(each, Interval)), Interval(ge=-span, le=span))
    low = limits.gt if limits.ge is None else limits.ge
    high = span if limits.le is None else limits.le
    if int in get_args(hint):
        return st.integers(low, round(high))
    return st.floats(low, min(high, LONGEST_S) if name.endswith("_s") else high, exclude_min=limits.ge is None)


def faults(place: FaultTarget, at_s: st.SearchStrategy[float]) -> st.SearchStrategy[Fault]:
    """A fault there; it lasts between a control tick and to the end."""
    lasts_s = st.floats(SHORTEST_S, LONGEST_S) | st.just(inf)
    return st.builds(Fault, at_s, lasts_s, st.just(place.target), st.just(place.kind), params(place))


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """One to five faults, none of them twice, and operator commands, of any rover at any depth."""
    rover, depth = draw(st.sampled_from(RIGS))
    config, for_s = load_rover(rover), draw(st.integers(*LASTS_S))
    moments = st.floats(0.0, for_s)
    places = st.lists(st.sampled_from(possible_faults(config, depth)), min_size=1, max_size=FAULTS_MOST, unique=True)
    asked = st.builds(Command, moments, st.sampled_from(("arm", "hold", "resume", "disarm")))
    return Scenario(
        name="random",
        expect=Expectation(ResponseLevel.NONE, inf),
        faults=tuple(draw(faults(place, moments)) for place in draw(places)),
        rover=rover,
        depth=depth,
        algorithm=draw(st.sampled_from(algorithms_of(config))),
        for_s=for_s,
        seed=draw(st.integers(0, 10_000)),
        slip_mean_m=draw(st.sampled_from((10.0, 2.0))),
        clearing=draw(st.booleans()),
        commands=(Command(0.0, "arm"), *draw(st.lists(asked, max_size=COMMANDS_MOST))),
        settings=quick_settings(config),
    )


def algorithms_of(config: RoverConfig) -> list[str]:
    """Return the built-in algorithms whose sensors a rover has."""
    return [name for name, algorithm in CATALOGUE.items() if algorithm.requires <= set(config.parts)]


def quick_settings(config: RoverConfig) -> dict[str, Any]:
    """Return what is laid over a rover file so that a scenario is short."""
    has_camera = config.parts.get("motion", {}).get("driver") == "camera_motion"
    return {**QUICK, **SMALL_PICTURES} if has_camera else QUICK


def broken_rules(run_result: RunResult) -> tuple[str, ...]:
    """Return what a run broke: safety rules, or that an error ended it which no fault explains."""
    if run_result.error is None or run_result.error.partition(":")[0] in REFUSALS:
        return run_result.broken
    return (*run_result.broken, f"the run was ended by {run_result.error}")
