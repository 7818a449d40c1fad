"""A driving programme on free ground, where every anomaly that the detector reports is false.

It takes the place of an escape algorithm and ignores anomalies: every anomaly reported on free ground is wrong,
and must not change what is driven next. Legs are drawn one after another: headings held, arcs, turns on the spot,
reversing, standing, and duties of any kind without feedback. The others close the loop on the turn rate that the
compass shows, up to full duty of one side against the other, as a controller does on ground that holds the body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import copysign
from random import Random
from typing import TYPE_CHECKING, NamedTuple

from tests.virtual import asked, run_virtually
from wayfarer.angles import wrap180
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Decision, Observation, Phase
from wayfarer.escape.catalogue import Algorithm
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.hal import WheelCommand
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.physics import GroundName, Physics
from wayfarer.simhal.world.simulated_world import SimulatedWorld

if TYPE_CHECKING:
    from wayfarer.simhal.world.physics import Terrain

NEVER_S = 86_400.0
NO_MUD_M = 1e9

# The loop from turn rate to duty: full duty of one side against the other after a second of 100 degrees per second that
# are asked for and not there. Chosen by us; quicker than a loop that is tuned not to overshoot.
DUTY_PER_DEG = 0.01
RATE_FILTER_S = 0.1
# MiniRover's motors need 0.09 of duty to roll at all (5 % of its weight over the stall force at the rims).
DRIVES_FROM_DUTY = 0.15
HOLD_PER_S = 3.0  # of a heading that is held: the rate asked for, per degree of error


class Leg(NamedTuple):
    """A part of the programme: duties without feedback, or a speed and the turn rate or the heading that is held."""

    lasts_s: float
    speed_m_s: float = 0.0
    turn_deg_s: float = 0.0
    heading_deg: float | None = None
    duties: WheelCommand | None = None


class FreeDriving:
    """Draws legs and drives them; an ``EscapeHandler``."""

    def __init__(self, settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> None:
        self._settings, self._vehicle, self._rng = settings, vehicle, rng
        self.reset()

    def reset(self) -> None:
        """Begin the programme, at the place in the draw where it is."""
        self._leg = Leg(0.0)
        self._until_s = 0.0
        self._lead = 0.0  # duty of the left side over the mean of both
        self._rate_deg_s = 0.0
        self._last: Observation | None = None

    def memory(self) -> Mapping[str, float | str]:
        """Return what a log demands of every algorithm."""
        return {"counter_deg": 0.0, "episodes": 0}

    def decide(self, observation: Observation) -> Decision:
        last, self._last = self._last or observation, observation
        dt_s = observation.t_s - last.t_s
        if dt_s > 0.0:
            turned_deg = wrap180(observation.heading_deg - last.heading_deg)
            self._rate_deg_s += (turned_deg / dt_s - self._rate_deg_s) * dt_s / (dt_s + RATE_FILTER_S)
        if observation.t_s >= self._until_s:
            self._leg = self._draw(observation)
            self._until_s = observation.t_s + self._leg.lasts_s
            self._lead = 0.0
        return Decision(self._leg.duties or self._steer(observation, dt_s), Phase.FOLLOW, "follow")

    def _steer(self, observation: Observation, dt_s: float) -> WheelCommand:
        leg, settings = self._leg, self._settings
        wanted_deg_s = leg.turn_deg_s
        if leg.heading_deg is not None:
            error_deg = wrap180(leg.heading_deg - observation.heading_deg)
            wanted_deg_s = max(-settings.turn_deg_s, min(error_deg * HOLD_PER_S, settings.turn_deg_s))
        self._lead += DUTY_PER_DEG * (wanted_deg_s - self._rate_deg_s) * dt_s
        self._lead = max(-1.0, min(self._lead, 1.0))
        mean = leg.speed_m_s / self._vehicle.max_speed_m_s
        mean = copysign(min(abs(mean), 1.0 - abs(self._lead)), mean)  # turning comes first
        return WheelCommand(mean + self._lead, mean - self._lead)

    def _draw(self, observation: Observation) -> Leg:
        settings, rng = self._settings, self._rng
        cruise_m_s, turn_deg_s = settings.cruise_m_s, settings.turn_deg_s
        way = rng.choice((-1.0, 1.0))
        legs = (
            Leg(rng.uniform(1.0, 6.0), cruise_m_s, heading_deg=observation.heading_deg + rng.uniform(-60.0, 60.0)),
            Leg(rng.uniform(1.0, 6.0), cruise_m_s, heading_deg=observation.heading_deg + rng.uniform(-10.0, 10.0)),
            Leg(rng.uniform(0.5, 4.0), cruise_m_s, way * rng.uniform(20.0, 60.0)),
            Leg(rng.uniform(0.3, 2.0), 0.0, way * turn_deg_s),
            Leg(rng.uniform(0.3, 1.5), -settings.reverse_m_s, heading_deg=observation.heading_deg),
            Leg(rng.uniform(0.2, 1.5), duties=WheelCommand(0.0, 0.0)),
            Leg(rng.uniform(0.2, 2.0), duties=self._any_duties()),
        )
        return rng.choice(legs)

    def _any_duties(self) -> WheelCommand:
        """Return duties of any kind that drive: on small ones rolling resistance holds the body, and it does stand."""
        while True:
            left, right = self._rng.uniform(-1.0, 1.0), self._rng.uniform(-1.0, 1.0)
            if abs(left + right) / 2 >= DRIVES_FROM_DUTY:
                return WheelCommand(left, right)


FREE_DRIVING = Algorithm("free-driving", "test", "drives a programme of legs on free ground", FreeDriving)


class _Claims(RunLog):
    """Keeps what the detector says, each time that it begins to say so."""

    def __init__(self) -> None:
        self.said: list[tuple[float, str]] = []
        self._last: set[str] = set()

    def tick(self, record: TickRecord) -> None:
        """Take anomalies, and the condition that counts for the gate."""
        now = {anomaly.value for anomaly in (record.observation.anomalies if record.observation else ())}
        if record.cause is not None:
            now.add(record.cause.value)
        self.said += [(record.t_s, name) for name in sorted(now - self._last)]
        self._last = now


def drive_freely(
    rover: RoverConfig,
    terrain: Terrain | None,
    for_s: float,
    seed: int,
    faults: Sequence[Fault] = (),
    ground: GroundName = GroundName.ideal,
) -> list[tuple[float, str]]:
    """Drive the programme on free ground and return what the detector said, and when: nothing, if it is right.

    Args:
        rover: the rover; whether it gets anywhere is not asked.
        terrain: the ground in MuJoCo, None for physics-light.
        for_s: how long.
        seed: of the programme and of all noise.
        faults: what goes wrong meanwhile.
        ground: what physics-light has under the wheels.
    """
    nowhere = replace(rover.progress, give_up_s=NEVER_S, anomalies_max=int(NEVER_S))
    spec = TrialSpec(
        0, f"{__name__}:FREE_DRIVING", CLEARING, seed, rover.model_copy(update={"progress": nowhere}),
        physics=Physics(slip_mean_m=NO_MUD_M), terrain=terrain, faults=faults, ground=ground,
    )  # fmt: skip
    return run_virtually(_drive(spec, for_s))


async def _drive(spec: TrialSpec, for_s: float) -> list[tuple[float, str]]:
    claims = _Claims()
    setup = TrialSetup(spec, lambda *_: claims)

    def end(world: SimulatedWorld) -> None:
        if world.t_s >= for_s:
            setup.supervisor.finish("driven", "the programme is over")

    setup.world.after_step = end
    if setup.injector is not None:
        setup.injector.start(setup.world, setup.supervisor.inbox.put_power)
    await setup.supervisor.arm(asked(), CLEARING.heading_deg)
    await setup.supervisor.run()
    if setup.injector is not None:
        setup.injector.end()
    return claims.said
