"""One trial: the daemon's own supervisor on a simulated rover in one forest, until an outcome is decided."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from wayfarer.control.run_log import RunLog, Tee
from wayfarer.control.supervisor import Supervisor, first_cause
from wayfarer.errors import DriverError
from wayfarer.experiments.outcome import LOST, SUCCESSES, Outcome, OutcomeMonitor, TrialCounters
from wayfarer.experiments.settings import NOTHING
from wayfarer.experiments.trial_setup import MakeLog, TrialSetup, TrialSpec
from wayfarer.safety.conditions import Condition
from wayfarer.safety.mission import RunEnd
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import VirtualLoop, run_virtually

if TYPE_CHECKING:
    from wayfarer.experiments.trial_log import TrackLog
    from wayfarer.hal import Rover
    from wayfarer.simhal.faults.injector import NoteFault
    from wayfarer.simhal.world.simulated_world import SimulatedWorld


class TrialResult(NamedTuple):
    """The outcome monitor's result of one trial.

    ``interventions``, and of which kind they were, at a field site, where a person helps the rover. ``drawn`` are the
    values of the keys that were drawn for it.
    """

    trial: int
    algorithm: str
    forest: int
    noise: int
    seed: int
    outcome: Outcome
    path_m: float
    reverse_m: float
    time_s: float
    anomalies: int
    episodes: int
    shortest_path_m: float | None
    spl: float | None
    ticks: int
    interventions: int | None = None
    overturned: int | None = None
    off_wheels: int | None = None
    drawn: Mapping[str, float] = NOTHING


GAVE_UP = f"fault: {Condition.ENTRAPPED.value}"  # the controller's reason for disarming


def run_trial(spec: TrialSpec, log_dir: Path | None = None, track: TrackLog | None = None) -> TrialResult:
    """Run one trial; with ``log_dir`` the rover's full field log is written there, and ``track`` gets its true path.

    Raises:
        MissingPart: the rover cannot give what the algorithm needs.
        BadInput: the log cannot be written.
    """
    if log_dir is None and track is None:
        return run_watched(spec, None)
    notes: list[NoteFault] = []

    def make_log(world: SimulatedWorld, rover: Rover) -> Tee:
        logs: list[RunLog] = []
        if track is not None:
            track.world = world
            logs.append(track)
        if log_dir is not None:
            from wayfarer.experiments.trial_log import field_log  # trials without a log need not import its writer

            log, truth = field_log(spec, log_dir, world, rover)
            notes.append(truth.note)
            logs += [log, truth]
        return Tee(*logs)

    return run_watched(spec, make_log, notes)


def run_watched(
    spec: TrialSpec,
    make_log: MakeLog | None,
    notes: Sequence[NoteFault] = (),
    *,
    begin: Callable[[Supervisor], None] = lambda _supervisor: None,
    loop_factory: Callable[[], VirtualLoop] = VirtualLoop,
) -> TrialResult:
    """Run one trial beside a log that is made for its world and rover, and may look at what no rover can see.

    ``notes`` are called when a fault begins or ends; ``make_log`` may add to them. ``begin`` is called on the running
    loop just before the supervisor runs.

    Raises:
        MissingPart: the rover cannot give what the algorithm needs.
    """
    return run_virtually(lambda: _run(spec, make_log, notes, begin), loop_factory)


async def _run(
    spec: TrialSpec, make_log: MakeLog | None, notes: Sequence[NoteFault], begin: Callable[[Supervisor], None]
) -> TrialResult:
    counters = TrialCounters(ends_lost=not spec.go_on and spec.site is None)
    setup = TrialSetup(spec, lambda *seen: counters if make_log is None else Tee(counters, make_log(*seen)))
    counters.finish = setup.supervisor.finish
    await setup.supervisor.arm(Asked(asyncio.get_running_loop().time()), spec.forest.heading_deg)
    if setup.injector is not None:
        setup.injector.start(setup.world, setup.supervisor.inbox.put_power, notes)
    begin(setup.supervisor)
    try:
        end = await setup.supervisor.run()
        outcome = outcome_of(setup.outcome_monitor, counters, end)
    except Exception as error:
        if not _injected(setup, first_cause(error)):
            raise
        outcome = "fault"
    finally:
        if setup.injector is not None:
            setup.injector.end()
    result = _result(spec, outcome, setup, counters)
    if helped := setup.intervention_counter:
        result = result._replace(
            interventions=helped.interventions, overturned=helped.flips, off_wheels=helped.high_centred
        )
    return result


def _injected(setup: TrialSetup, error: BaseException) -> bool:
    """Return whether a fault on purpose has ended the run: a part did not open, or its driver had a bug."""
    if setup.injector is None:
        return False
    from wayfarer.simhal.faults.readings import Bug

    return isinstance(error, DriverError | Bug)


def outcome_of(outcome_monitor: OutcomeMonitor, counters: TrialCounters, end: RunEnd) -> Outcome:
    """Return how a trial ended; one that was lost, gave up, or used up its mission's limits, did not get out either."""
    if counters.why_disarmed is not None:
        return "entrapped" if counters.why_disarmed == GAVE_UP else "fault"
    return outcome_monitor.outcome or (LOST if end.reason == LOST or end.reason.startswith("mission_") else "fault")


def _result(spec: TrialSpec, outcome: Outcome, setup: TrialSetup, counters: TrialCounters) -> TrialResult:
    forest, world = spec.forest, setup.world
    path_m = setup.outcome_monitor.path_m(world)
    shortest_m = forest.shortest_path_m
    succeeded = outcome in SUCCESSES
    spl = None if shortest_m is None else shortest_m / max(shortest_m, path_m) if succeeded else 0.0
    return TrialResult(
        spec.trial,
        spec.algorithm,
        forest.forest,
        forest.noise,
        spec.seed,
        outcome,
        path_m,
        world.reverse_m,
        world.t_s,
        counters.anomalies,
        counters.episodes,
        shortest_m,
        spl,
        counters.ticks,
        drawn=spec.drawn,
    )
