"""Missions that a fault strikes: trials of generated forests, each also run without the fault.

A mission is the trial that ``wayfarer sim`` runs with that seed, with the mission limits of ``LIMITS``. The fault
strikes at a random moment of the way that the rover drives without it: until then both trials are the same.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any, NamedTuple

from wayfarer.config.rover_file import RoverConfig, laid_over
from wayfarer.control.run_log import PartialLog
from wayfarer.control.supervisor import first_cause
from wayfarer.control.tick_record import TickRecord
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.trial import run_watched
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.fault_scenarios.results import Result, Row, not_run, with_names
from wayfarer.fault_scenarios.scenario import Scenario, rover_of
from wayfarer.fault_scenarios.selection import on_another_rover, without_covered_by_tests, without_missing_packages
from wayfarer.safety.conditions import Level
from wayfarer.safety.responses import levels_for
from wayfarer.simhal.build_rover import Depth
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.random_streams import RandomStreams

DURATIONS_S = (inf, 10.0)
# Long enough for a rover that rests and tries again: its rests, of 30 s to 10 minutes, are eight by then. The hour is
# the default of ``SafetySettings``, the path that of ``wayfarer sim``.
BUDGET_M = 1000.0
LIMITS: Mapping[str, Any] = {"safety": {"mission_time_s": 3600.0, "mission_distance_m": BUDGET_M}}
SMALL_PICTURES: Mapping[str, Any] = {"parts": {"motion": {"width": 64, "height": 48}}}  # large ones: 2.5 times as long
MOST_WELL = 16  # missions without a fault in memory at a time: more than there are rovers at either depth
NEEDS_A_PERSON = "its subject is a rover that is not under way: it begins before arming, or after a person's hold"
BY_A_TEST = "covered by a test, as it needs a real process or a person beside the rover"
ENDS = {
    "entrapped": "path", "mission_distance": "path", "mission_time": "time", "mission_radius": "radius",
    "disarmed": "fault",
}  # fmt: skip


class Striking(NamedTuple):
    """A fault that strikes: its scenario, whose times count from the strike on.

    ``names`` and ``rows`` are those of all scenarios of which this is the fault: they differ in how long it lasts.
    """

    scenario: Scenario
    names: tuple[str, ...]
    rows: tuple[int, ...]


class Mission(NamedTuple):
    """What came of a mission: ``ended`` says why it did not get out, and is empty where it did.

    ``mode_s`` is how long each condition of level S1 or worse was there while the fault lasted.
    """

    armed_s: float
    ended_s: float
    path_m: float
    ended: str
    mode_s: Mapping[str, float]


class Strike(NamedTuple):
    """A mission without the fault, and with it for each of ``DURATIONS_S``."""

    fault: int
    trial: int
    well: Mission
    struck: tuple[Mission, ...]


def needs_a_person(scenario: Scenario) -> bool:
    """Return whether the fault is not one of a mission: a person has not armed the rover yet, or asked for more."""
    first_s = min(fault.at_s for fault in scenario.faults)
    return [command.do for command in scenario.commands if command.at_s <= first_s] != ["arm"]


def as_mission(scenario: Scenario) -> Scenario:
    """Return a scenario as a fault of missions.

    Its times count from the strike on. The rover is as it is shipped, but for the limits of a mission and the parts
    that the fault needs. Faults on wires need bus depth; all others do the same at device depth, which is faster.
    """
    first_s = min(fault.at_s for fault in scenario.faults)
    faults = tuple(replace(fault, at_s=fault.at_s - first_s, for_s=inf) for fault in scenario.faults)
    on_wires = any(isinstance(fault.params, BusFault) for fault in faults)
    parts = (scenario.settings or {}).get("parts", {})
    depth = Depth.BUS if on_wires else Depth.DEVICE
    return replace(scenario, faults=faults, depth=depth, settings={"parts": parts, **LIMITS})


def faults_of(rows: Sequence[Row], rover: str | None = None) -> tuple[list[Striking], list[str]]:
    """Return the faults of these rows that can strike a mission, each once, and of the others one line for each reason.

    With ``rover`` they strike that one, each else the rover of its scenario.

    Raises:
        UnknownName: no shipped rover of that name.
        BadInput: its file is not right.
    """
    scenarios, by_tests = without_covered_by_tests(rows)
    with_people = [not_run(each, NEEDS_A_PERSON) for each in scenarios if needs_a_person(each)]
    scenarios = [as_mission(each) for each in scenarios if not needs_a_person(each)]
    misfits: list[Result] = []
    if rover is not None:
        scenarios, misfits = on_another_rover(scenarios, rover)
    scenarios, unequipped = without_missing_packages(scenarios)
    by_tests = [each._replace(skipped=BY_A_TEST) for each in by_tests]
    left_out = with_names((each.skipped, each.name) for each in (*by_tests, *with_people, *misfits, *unequipped))
    return _each_once(scenarios), list(left_out)


def _each_once(scenarios: Sequence[Scenario]) -> list[Striking]:
    alike: dict[str, list[Scenario]] = {}
    for scenario in scenarios:
        alike.setdefault(repr((_setup(scenario), scenario.faults)), []).append(scenario)
    return [
        Striking(same[0], tuple(each.name for each in same), tuple(sorted({each.row for each in same if each.row})))
        for same in alike.values()
    ]


def _setup(scenario: Scenario) -> tuple[str, str, str]:
    """Return what decides a mission beside its trial and its faults."""
    return scenario.rover, scenario.depth, repr(scenario.settings)


class MissionRunner:
    """Runs a mission without a fault, and with it for good and for a while; it can be sent to another process.

    Faults of the same rover share the missions without one.
    """

    def __init__(self, faults: Sequence[Striking], seed: int) -> None:
        self._faults = faults
        self._seed = seed
        self._well: dict[tuple[object, ...], tuple[TrialSpec, Mission]] = {}

    def __call__(self, task: tuple[int, int]) -> Strike:
        """Run the missions of a trial, the first number, and a fault, the second."""
        trial, number = task
        scenario = self._faults[number].scenario
        spec, well = self._without_fault(scenario, trial)
        share = RandomStreams(spec.seed).random("strike").random()  # the same of all faults, so that they compare
        at_s = well.armed_s + share * (well.ended_s - well.armed_s)
        struck = (run_mission(replace(spec, faults=_lasting(scenario.faults, at_s, for_s))) for for_s in DURATIONS_S)
        return Strike(number, trial, well, tuple(struck))

    def _without_fault(self, scenario: Scenario, trial: int) -> tuple[TrialSpec, Mission]:
        key = (*_setup(scenario), trial)
        if key not in self._well:
            if len(self._well) >= MOST_WELL:
                self._well.clear()
            campaign = Campaign(
                (scenario.algorithm,), trial + 1, _rover(scenario), self._seed, budget_m=BUDGET_M, depth=scenario.depth
            )
            spec = campaign.spec(Task(scenario.algorithm, trial), campaign.make_forest(trial))
            self._well[key] = spec, run_mission(spec)
        return self._well[key]


def _rover(scenario: Scenario) -> RoverConfig:
    config = rover_of(scenario)
    by_camera = config.parts.get("motion", {}).get("driver") == "camera_motion"
    return laid_over(config, SMALL_PICTURES) if by_camera else config


def _lasting(faults: Sequence[Fault], at_s: float, for_s: float) -> tuple[Fault, ...]:
    return tuple(replace(fault, at_s=at_s + fault.at_s, for_s=for_s) for fault in faults)


def run_mission(spec: TrialSpec) -> Mission:
    """Run a mission; an error that ends the run under way is why it ended."""
    log = _MissionLog(spec)
    try:
        result = run_watched(spec, lambda _world, _rover: log)
    except ExceptionGroup as error:  # of the supervisor's tasks; what is wrong before the start is not caught
        return Mission(log.armed_s, log.last_s, 0.0, f"error: {type(first_cause(error)).__name__}", log.mode_s())
    ended = "" if result.outcome in SUCCESSES else log.why()
    return Mission(log.armed_s, result.time_s, result.path_m, ended, log.mode_s())


class _MissionLog(PartialLog):
    """Notes when the rover was armed, what the gate said while the faults lasted, and how the run ended."""

    def __init__(self, spec: TrialSpec) -> None:
        self.armed_s = self.last_s = 0.0
        self._levels = levels_for(spec.rover.safety.on_lost_sense)
        self._control_hz = spec.rover.control_hz
        self._from_s = min((fault.at_s for fault in spec.faults), default=inf)
        self._to_s = max((fault.at_s + fault.for_s for fault in spec.faults), default=inf)
        self._ticks: Counter[str] = Counter()
        self._cause = self._reason = ""

    def tick(self, record: TickRecord) -> None:
        """Count the conditions of a tick, if the fault lasted at any time since the tick before."""
        self.last_s = record.t_s
        self._cause = record.cause.value if record.cause is not None else ""
        if record.t_s >= self._from_s and record.t_s - record.dt_s < self._to_s:
            self._ticks.update(each.value for each in record.conditions if self._levels[each] >= Level.DEGRADE)

    def event(self, name: str, t_s: float, **details: object) -> None:  # noqa: ARG002 - the interface's
        """Note when the wheels were allowed to turn."""
        if name == "armed":
            self.armed_s = t_s

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002 - the interface's
        """Note why the run ended."""
        self._reason = reason

    def why(self) -> str:
        """Return what ended the mission, with the worst condition of its last tick, as ``fault: overturned``."""
        return ": ".join(filter(None, (ENDS.get(self._reason, self._reason), self._cause)))

    def mode_s(self) -> dict[str, float]:
        """Return how long each condition was there, in seconds."""
        return {name: ticks / self._control_hz for name, ticks in self._ticks.items()}
