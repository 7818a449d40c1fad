"""How well each witness notices that the rover is held, or slips, and how often it claims so while the rover drives.

A driving programme, blind to what is found, repeats legs on free ground: ahead, in arcs, back, turns on the spot. In
some of the legs ahead the body is snagged for ``HELD_S``, in some its wheels lose their grip. All witnesses judge the
same drive, on sensors as in a wood (``physics.FIELD``). A hold is noticed if a witness says stood before it ends,
a slip if it does so before the wheels pull back. A claim at any other time, or long after, is a false alarm.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from random import Random
from typing import Final, NamedTuple

from wayfarer.angles import clamp, wrap180
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.detector.detector import Detector, DetectorTick
from wayfarer.escape.api import Decision, Observation, Phase
from wayfarer.escape.catalogue import Algorithm
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.hal import WheelCommand
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.physics import FIELD, GroundName, Physics
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.testing.safety_rules import after_each_step

GROUNDS: Final = tuple(GroundName)
# Each column: who is asked. The witnesses of one row have judged the same drive.
ASKED: Final[Mapping[str, frozenset[str]]] = {
    "motion": frozenset({"motion"}),
    "wheels": frozenset({"wheels"}),
    "current": frozenset({"current"}),
    "yaw": frozenset({"yaw"}),
    "wheels+current": frozenset({"wheels", "current"}),
    "motion+wheels": frozenset({"motion", "wheels"}),
}
STALL_A: Final = 11.0
HEADER: Final = ("ground", "witness", "holds", "missed", "slips", "missed", "driven h", "false / 100 h")
DRIVE_S: Final = 600.0  # of one drive
HELD_S: Final = 3.0  # for which motors may be held (fault catalogue, faults 29 and 58)
BEGINS_S: Final = 2.5  # after the beginning of a leg: the body is at speed
AFTERWARDS_S: Final = 2.5  # the longer window empties (``nowhere_s``)
NEVER_S, NO_MUD_M = 86_400.0, 1e9
# Duty of turning for each degree off the heading, at once and in each tick more: for ground that takes up steering.
STEERS, STEERS_MORE, MOST_STEERED = 0.008, 0.0004, 0.35


class Leg(NamedTuple):
    """A part of the programme: duties ahead and of turning; ``holds`` a heading; ``event`` is what happens in it."""

    lasts_s: float
    ahead: float
    turn: float = 0.0
    holds: bool = False
    event: str = ""


class Programme:
    """Draws legs and drives them; an ``EscapeHandler`` that ignores anomalies."""

    def __init__(self, settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> None:
        self._cruise = settings.cruise_m_s / vehicle.max_speed_m_s
        self._full_turn_deg_s = vehicle.full_turn_deg_s
        self._rng = rng
        self.reset()

    def reset(self) -> None:
        """Begin with the first leg."""
        self.leg, self.begun_s = Leg(1.0, 0.0), 0.0
        self._legs: Iterator[Leg] = self._draw()
        self._heading_deg: float | None = None
        self._steered = 0.0

    def _draw(self) -> Iterator[Leg]:
        """Yield legs for ever."""
        rng = self._rng
        while True:
            duty = self._cruise * rng.uniform(0.6, 1.2)
            yield Leg(7.0, duty, holds=True, event=rng.choice(("", "", "hold", "slip")))
            yield Leg(rng.uniform(1.0, 3.0), -duty, turn=rng.uniform(-0.1, 0.1))
            yield Leg(0.5, 0.0)
            yield Leg(rng.uniform(0.5, 2.0), 0.0, turn=rng.choice((-1.0, 1.0)) * rng.uniform(0.2, 0.8))
            yield Leg(rng.uniform(2.0, 4.0), duty, turn=rng.uniform(-0.25, 0.25))

    def decide(self, observation: Observation) -> Decision:
        """Return the duties of this tick."""
        t_s = observation.t_s
        if t_s - self.begun_s >= self.leg.lasts_s:
            self.leg, self.begun_s = next(self._legs), t_s
            self._heading_deg, self._steered = None, 0.0
        leg, turn = self.leg, self.leg.turn
        if leg.holds:
            if self._heading_deg is None:
                self._heading_deg = observation.heading_deg
            off_deg = wrap180(self._heading_deg - observation.heading_deg)
            self._steered = clamp(self._steered + STEERS_MORE * off_deg, -MOST_STEERED, MOST_STEERED)
            turn = clamp(STEERS * off_deg + self._steered, -MOST_STEERED, MOST_STEERED)
        wheels = WheelCommand(clamp(leg.ahead + turn, -1.0, 1.0), clamp(leg.ahead - turn, -1.0, 1.0))
        return Decision(wheels, Phase.STRIDE, "programme")

    def memory(self) -> Mapping[str, float]:
        """Return what every algorithm remembers."""
        return {"counter_deg": 0.0, "episodes": 0.0}


PROGRAMME: Final = Algorithm("programme", "benchmark", "drives legs, blind to what is found", Programme)


Told = Counter[str]  # what became of a drive: holds, slips, those missed, false claims, and milliseconds driven


class Drive(RunLog):
    """Makes what happens in the legs happen, and asks each way of asking at each tick."""

    def __init__(self, config: RoverConfig, programme: Programme) -> None:
        self._programme = programme
        settings = replace(config.detector, blind_stride_m=1e9)  # the end of a stride is not a witness
        self._detectors = {
            name: Detector(
                settings, config.vehicle, watches_motion="motion" in names,
                has_wheels=not names.isdisjoint({"wheels", "current"}), witnesses=names - {"motion"},
            )
            for name, names in ASKED.items()
        }  # fmt: skip
        self.told = {name: Told() for name in ASKED}
        self._claims = dict.fromkeys(ASKED, False)
        self._noticed = dict.fromkeys(ASKED, False)
        self._now, self._ended_s = "", -NEVER_S
        self._world: SimulatedWorld | None = None

    def follow(self, world: SimulatedWorld) -> None:
        """Watch a world, and do to it what the programme wants."""
        self._world = world
        after_each_step(world, self._step)

    def _step(self) -> None:
        world, programme = self._world, self._programme
        assert world is not None
        event = programme.leg.event if world.t_s - programme.begun_s >= BEGINS_S else ""
        held = event == "hold" and world.t_s - programme.begun_s < BEGINS_S + HELD_S
        if held is not world.body_faults.snagged:
            world.set_faults(snagged=held)
        if event == "slip" and self._now != "slip":
            world.lose_grip()
        now = "hold" if held else "slip" if world.slipping else ""
        if now != self._now:
            self._end(self._now, world.t_s)
            self._now = now

    def _end(self, what: str, t_s: float) -> None:
        """Count what has ended."""
        if what:
            self._ended_s = t_s
            for name, told in self.told.items():
                told[what] += 1
                told[f"{what} missed"] += not self._noticed[name]
        self._noticed = dict.fromkeys(ASKED, False)

    def tick(self, record: TickRecord) -> None:
        """Ask all about a tick."""
        busy = bool(self._now) or record.t_s - self._ended_s < AFTERWARDS_S
        for name, detector in self._detectors.items():
            tick = DetectorTick(record.t_s, record.commanded, record.dt_s, record.driven_s, record.forward_m)
            tick.compass, tick.rims, tick.duties = record.compass, record.rims, record.duties
            if "motion" in ASKED[name]:
                tick.motion = record.motion
            detector.update(tick, armed=True)
            claims = stood(detector, ASKED[name])
            told = self.told[name]
            if not busy:
                told["driven ms"] += round(1000.0 * record.dt_s) if record.left or record.right else 0
                told["false"] += claims and not self._claims[name]
            elif claims and self._now:
                self._noticed[name] = True
            self._claims[name] = claims


def stood(detector: Detector, names: frozenset[str]) -> bool:
    """Return whether one of these witnesses says so, as the detector joins them; ``yaw`` only if it is named."""
    motion, wheels = detector._motion, detector._wheels
    by_yaw = motion.stride_over and "yaw" in names
    return motion.stall.found or by_yaw or (wheels is not None and wheels.stood and not motion.moves)


def measure(rover: RoverConfig, task: tuple[GroundName, int]) -> dict[str, Told]:
    """Return what became of one drive."""
    ground, seed = task
    config = rover.model_copy(
        update={
            "anomaly_source": "motion+wheels+current",
            "detector": replace(rover.detector, stall_current_a=STALL_A),
            "progress": replace(rover.progress, give_up_s=NEVER_S, anomalies_max=10_000),
        }
    )
    physics = Physics(**FIELD, slip_mean_m=NO_MUD_M)
    spec = TrialSpec(
        0, f"{__name__}:PROGRAMME", CLEARING, seed, config, budget_m=1e6, physics=physics, ground=ground, go_on=True
    )
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(_run(spec))


async def _run(spec: TrialSpec) -> dict[str, Told]:
    programme = Programme(spec.rover.escape, spec.rover.vehicle, RandomStreams(spec.seed).random("programme"))
    drive = Drive(spec.rover, programme)
    setup = TrialSetup(spec, lambda *_: drive)
    supervisor = setup.supervisor
    supervisor.controller._handler = programme  # one that the drive can look into
    setup.world.after_step = lambda _world: None  # a drive leaves the map, and does not end there
    drive.follow(setup.world)
    loop = asyncio.get_running_loop()
    loop.call_later(DRIVE_S, supervisor.finish, "done", "the drive is over")
    await supervisor.arm(Asked(loop.time()), spec.forest.heading_deg)
    await supervisor.run()
    return drive.told


def rows(
    rover: RoverConfig, drives: int, first_seed: int, grounds: Sequence[GroundName] = GROUNDS
) -> Iterator[tuple[str, ...]]:
    """Yield the table's lines, of so many drives of ``DRIVE_S`` on each ground."""
    tasks = [(ground, seed) for ground in grounds for seed in range(first_seed, first_seed + drives)]
    sums: dict[tuple[GroundName, str], Told] = {}
    with ProcessPoolExecutor() as pool:
        for (ground, _), told in zip(tasks, pool.map(partial(measure, rover), tasks), strict=True):
            for name, each in told.items():
                sums.setdefault((ground, name), Told()).update(each)
    for (ground, name), total in sums.items():
        hours = total["driven ms"] / 3.6e6
        counts = [str(total[what]) for what in ("hold", "hold missed", "slip", "slip missed")]
        yield ground.value, name, *counts, f"{hours:.1f}", f"{100.0 * total['false'] / hours:.0f}"
