"""The checks of algorithms: each promise of ``escape.api``, tried on an artificial drive with and without contact."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from math import degrees, isfinite
from random import Random
from typing import Any

from wayfarer.config.registry import OPTIONAL_PARTS, algorithm_of
from wayfarer.escape.api import Anomaly, Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.catalogue import Algorithm
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.hal import STOP, ContactReading, Side
from wayfarer.testing.promises import Promise, Report, checks_in, promised, run_all

TICK_S = 0.0625  # a binary fraction, as are all angles: turning them together loses no digit
ANGLE_STEPS = 64  # per degree
TICKS = 800
PHASE_MAX_S = 120.0  # three times the longest phase of the paper's algorithms, a stride of 10 m
ALGORITHM = "algorithm"
TABLE: list[Promise] = []

_VEHICLE = Vehicle(length_m=0.4, width_m=0.4, track_m=0.5, max_speed_m_s=1.4)
_PLAIN_NAME = re.compile(r"[a-z][a-z_]*(\.[a-z_]+)*")

Drive = list[tuple[Observation, Decision]]
_of = partial(promised, TABLE)


def check_algorithm(given: Algorithm | type[EscapeHandler], gaps: Mapping[str, str] | None = None) -> Report:
    """Run all checks of an algorithm, or of a class of handlers, and return which did run.

    ``gaps`` is why a check is known to fail, by its name.

    Raises:
        AssertionError: a promise is not kept; the text says which.
    """
    running = run_all(ALGORITHM, checks_in(TABLE, ALGORITHM, algorithm_of(given), None, gaps))
    try:
        running.send(None)  # nothing in these checks waits, so that no event loop is needed
    except StopIteration as done:
        report: Report = done.value
        return report
    raise RuntimeError("a check of an algorithm waited for something")


# -- artificial drives -------------------------------------------------------------------------------------------------


def _drives(algorithm: Algorithm) -> Iterator[Drive]:
    """Give what is seen and decided on a drive through made-up trouble, with contact, and without if that will do."""
    for contact in (True, False):
        if contact or "contact" not in algorithm.requires:
            yield _driven(algorithm, contact=contact)


def _driven(algorithm: Algorithm, *, contact: bool) -> Drive:
    handler, rng = _make(algorithm), Random(1)
    wheels, drive = STOP, Drive()
    heading_steps, travelled_m = 0, 0.0
    for tick in range(1, TICKS):
        turn_deg = degrees((wheels.left - wheels.right) * _VEHICLE.max_speed_m_s / _VEHICLE.track_m) * TICK_S
        heading_steps += round(turn_deg * ANGLE_STEPS * rng.choice((0.0, 1.0, 1.0)))
        travelled_m += abs(wheels.left + wheels.right) / 2 * _VEHICLE.max_speed_m_s * TICK_S
        met = rng.random() < 0.05
        observation = Observation(
            t_s=tick * TICK_S,
            heading_deg=heading_steps % (360 * ANGLE_STEPS) / ANGLE_STEPS,
            pitch_deg=0.0,
            roll_deg=0.0,
            anomalies=(rng.choice(tuple(Anomaly)),) if met else (),
            contact=_touch(rng, tick * TICK_S, met) if contact else None,
            goal_heading_deg=0.0,
            travelled_m=travelled_m,
        )
        decision = _decide(handler, observation)
        drive.append((observation, decision))
        if not all(map(isfinite, decision.wheels)):
            break  # such wheels lead nowhere; another check says so
        wheels = decision.wheels
    return drive


def _touch(rng: Random, t_s: float, met: bool) -> ContactReading:
    sides = (rng.choice(tuple(Side)),) if met else ()
    axis_deg = rng.randrange(180) if met and rng.random() < 0.5 else None
    return ContactReading(t_s, sides, axis_deg)


def _make(algorithm: Algorithm) -> EscapeHandler:
    return algorithm.make(EscapeSettings(), _VEHICLE, Random(7))


def _decide(handler: EscapeHandler, observation: Observation) -> Decision:
    try:
        decision = handler.decide(observation)
    except Exception as error:
        raise AssertionError(f"decide() raised {error!r} on {observation}") from error
    if not (isinstance(decision, Decision) and isinstance(decision.phase, Phase)):
        raise AssertionError(f"decide() returned {decision!r}, not a Decision with a Phase")
    return decision


def _again(algorithm: Algorithm, seen: Sequence[Observation]) -> Iterator[tuple[Decision, dict[str, Any]]]:
    """Give what a new handler decides on the same observations, and its memory after each."""
    handler = _make(algorithm)
    for observation in seen:
        yield _decide(handler, observation), dict(handler.memory())


# -- promises ----------------------------------------------------------------------------------------------------------


@_of(
    "wayfarer.escape.catalogue.Algorithm",
    "``requires`` names the optional members of ``hal.Rover`` without which the algorithm cannot work",
    ALGORITHM,
)
async def _requires_what_a_rover_can_have(algorithm: Algorithm) -> None:
    if unknown := algorithm.requires - OPTIONAL_PARTS:
        raise AssertionError(f"requires is {sorted(unknown)}, and a rover can have {sorted(OPTIONAL_PARTS)}")


@_of(
    "wayfarer.escape.api.EscapeHandler.decide",
    "Return the decision for this tick. Called once per tick with strictly increasing ``t_s``; never raises.",
    ALGORITHM,
)
async def _decides_at_each_tick(algorithm: Algorithm) -> None:
    for _ in _drives(algorithm):
        pass


@_of(
    "wayfarer.hal.WheelCommand",
    "Duty of the left and right wheels, each in -1 (full reverse) to 1 (full ahead); 0 stops.",
    ALGORITHM,
)
async def _wheels_are_in_range(algorithm: Algorithm) -> None:
    for drive in _drives(algorithm):
        for observation, decision in drive:
            if not all(-1.0 <= duty <= 1.0 for duty in decision.wheels):
                raise AssertionError(f"the wheels are {decision.wheels} at t_s = {observation.t_s:g} s")


@_of(
    "wayfarer.escape.api.Decision",
    "``why`` is a fixed event name such as ``probe.unwound``, else the phase.",
    ALGORITHM,
)
async def _why_is_a_fixed_name(algorithm: Algorithm) -> None:
    for drive in _drives(algorithm):
        for _, decision in drive:
            if not (isinstance(decision.why, str) and _PLAIN_NAME.fullmatch(decision.why)):
                raise AssertionError(f"why is {decision.why!r}: no values, no spaces")


@_of(
    "wayfarer.escape.api",
    "The same observations give the same decisions, on a rover, in a simulated forest and in a replay of a log.",
    ALGORITHM,
)
async def _decides_the_same_again(algorithm: Algorithm) -> None:
    for drive in _drives(algorithm):
        seen = [observation for observation, _ in drive]
        for first, second in zip(_again(algorithm, seen), _again(algorithm, seen), strict=True):
            if first != second:
                raise AssertionError(
                    f"the same seed and observations gave {first} and then {second}: take chance only from the Random "
                    "that make() is given, and time from t_s"
                )


@_of(
    "wayfarer.escape.api.Observation",
    "Headings are degrees clockwise, 0 to 360, all from the same north.",
    ALGORITHM,
)
async def _north_does_not_matter(algorithm: Algorithm) -> None:
    for drive in _drives(algorithm):
        seen = [observation for observation, _ in drive]
        for turned_deg in (90.0, 213.625):
            turned = [_turned(observation, turned_deg) for observation in seen]
            for (first, _), (second, _) in zip(_again(algorithm, seen), _again(algorithm, turned), strict=True):
                apart = max(abs(a - b) for a, b in zip(first.wheels, second.wheels, strict=True))
                if not (apart < 1e-9 and first[1:] == second[1:]):
                    raise AssertionError(
                        f"turning all headings by {turned_deg} degrees changed {first} to {second}: use headings only "
                        "as differences (wayfarer.angles.wrap180)"
                    )


def _turned(observation: Observation, by_deg: float) -> Observation:
    contact = observation.contact
    if contact is not None and contact.obstacle_bearing_deg is not None:
        contact = contact._replace(obstacle_bearing_deg=(contact.obstacle_bearing_deg + by_deg) % 180.0)
    return observation._replace(
        heading_deg=(observation.heading_deg + by_deg) % 360.0,
        goal_heading_deg=(observation.goal_heading_deg + by_deg) % 360.0,
        contact=contact,
    )


@_of("wayfarer.escape.api.EscapeHandler.reset", "Forget everything: a new mission begins.", ALGORITHM)
async def _reset_forgets(algorithm: Algorithm) -> None:
    for drive in _drives(algorithm):
        used = _make(algorithm)
        for observation, _ in drive:
            _decide(used, observation)
        used.reset()
        first = drive[0][0]._replace(t_s=drive[-1][0].t_s + 60.0)
        fresh, after = _decide(_make(algorithm), first), _decide(used, first)
        if after != fresh:
            raise AssertionError(f"after reset() the first decision is {after}, and that of a new handler {fresh}")


@_of(
    "wayfarer.escape.api.EscapeHandler",
    "Every phase except ``FOLLOW`` ends, also if nothing moves.",
    ALGORITHM,
)
async def _phases_end(algorithm: Algorithm) -> None:
    for anomalies in ((), (Anomaly.IMMOBILISED,)):
        handler, wheels, travelled_m = _make(algorithm), STOP, 0.0
        phase, since_s = Phase.FOLLOW, 0.0
        for tick in range(1, int(2.5 * PHASE_MAX_S / TICK_S)):
            t_s = tick * TICK_S
            travelled_m += abs(wheels.left + wheels.right) / 2 * _VEHICLE.max_speed_m_s * TICK_S
            contact = ContactReading(t_s, (), None)
            held = anomalies if tick > 1 else (Anomaly.IMMOBILISED,)
            decision = _decide(handler, Observation(t_s, 0.0, 0.0, 0.0, held, contact, 0.0, travelled_m))
            wheels = decision.wheels
            if decision.phase is not phase or (phase is Phase.FOLLOW and not held):
                phase, since_s = decision.phase, t_s
            if t_s - since_s > PHASE_MAX_S:
                raise AssertionError(
                    f"{phase.value} did not end within {PHASE_MAX_S:g} s while the rover was stuck: bound every phase "
                    "in time and in commanded distance"
                )


@_of(
    "wayfarer.escape.api.EscapeHandler.memory",
    "Return the inner state for the log and for replay: at least ``counter_deg`` and ``episodes``.",
    ALGORITHM,
)
async def _memory_has_counter_and_episodes(algorithm: Algorithm) -> None:
    for drive in _drives(algorithm):
        for _, memory in _again(algorithm, [observation for observation, _ in drive]):
            for key in ("counter_deg", "episodes"):
                value = memory.get(key)
                if not (isinstance(value, float | int) and isfinite(value)):
                    raise AssertionError(f"memory() has {key} = {value!r}, which is not a finite number: {memory}")
            for key, value in memory.items():
                if not isinstance(value, float | int | str):
                    raise AssertionError(f"memory() has {key} = {value!r}, which is not a number or a text")
