"""The escape handler as the fail-safe under another stack's planner, on a rover that has nothing else of wayfarer.

Their planner steers for the goal; stuck, it backs up and tries again; where the camera is dark it waits. Their rover
has a compass and odometry. What wayfarer adds is the stuck detector and, in ``drive``, the fail-safe: ask it once per
tick, and obey it if it answers. Rover and forest are wayfarer's simulated ones, in the place of theirs.

Run it: python examples/failsafe_under_a_planner.py [FOREST]
"""

import sys
from collections.abc import Callable
from math import degrees, radians
from typing import NamedTuple

from wayfarer import FailSafe, StuckDetector, load_rover, make_handler
from wayfarer.hal import STOP, WheelCommand
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FLOW_M_PER_COUNT, FlowSensorModel, HeadingSensorModel
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

PERIOD_S = 0.05
TIME_S = 600.0
GOAL_HEADING_DEG = 0.0
VEHICLE = load_rover("sim").vehicle


class Sensed(NamedTuple):
    """What their rover says of itself in one tick."""

    heading_deg: float
    stuck: bool
    blind: bool


class TheirRover:
    """Wheels, a compass, odometry that does not come from the wheels, and a camera that is dark under dense crowns."""

    def __init__(self, forest: int) -> None:
        streams = RandomStreams(forest)
        self.world = World(generate_forest(forest, noise=0, seed=0), VEHICLE, Physics(), streams)
        self._compass, self._odometry = HeadingSensorModel(self.world, streams), FlowSensorModel(self.world, streams)
        self._wheels = STOP
        self._detector = StuckDetector(VEHICLE)

    def sense(self, t_s: float) -> Sensed:
        """Look around; since the last time the wheels have turned as commanded."""
        heading_deg = self._compass.sample(t_s)[0] / 10.0
        moved_m = self._odometry.sample(t_s)[0] * FLOW_M_PER_COUNT
        left_m_s, right_m_s = (duty * VEHICLE.max_speed_m_s for duty in self._wheels)
        speed_m_s, turn_deg_s = (left_m_s + right_m_s) / 2, degrees((left_m_s - right_m_s) / VEHICLE.track_m)
        stuck = self._detector.update(t_s, heading_deg, speed_m_s=speed_m_s, turn_deg_s=turn_deg_s, forward_m=moved_m)
        return Sensed(heading_deg, stuck, blind=t_s % 30.0 > 25.0)

    def drive(self, wheels: WheelCommand) -> None:
        """Turn the wheels."""
        self.world.command(*wheels)
        self._wheels = wheels


class TheirPlanner:
    """Steers for the goal; stuck, it backs up for a second and tries again."""

    def __init__(self) -> None:
        self._back_until_s = 0.0

    def plan(self, t_s: float, sensed: Sensed) -> WheelCommand:
        """Return the wheels for this tick."""
        if sensed.blind:
            return STOP
        if sensed.stuck and t_s >= self._back_until_s:
            self._back_until_s = t_s + 1.0
        if t_s < self._back_until_s:
            return VEHICLE.mix(-0.6, 0.0)
        error_deg = (GOAL_HEADING_DEG - sensed.heading_deg + 180.0) % 360.0 - 180.0
        return VEHICLE.mix(1.0 if abs(error_deg) < 60.0 else 0.0, 3.0 * radians(error_deg))


class Trip(NamedTuple):
    """What became of one rover."""

    out: bool
    north_m: float
    time_s: float
    takeovers: int


def drive(forest: int, failsafe: FailSafe | None, say: Callable[[str], None] = lambda _: None) -> Trip:
    """Drive until out of the forest, or out of time."""
    rover, planner, t_s, takeovers = TheirRover(forest), TheirPlanner(), 0.0, 0
    while t_s < TIME_S and not is_out(rover.world):
        sensed = rover.sense(t_s)
        wheels = planner.plan(t_s, sensed)
        if failsafe is not None:
            drove = failsafe.drives
            heading_deg, stuck, blind = sensed
            decision = failsafe.update(t_s, heading_deg, GOAL_HEADING_DEG, stuck=stuck, blind=blind)
            if decision is not None:
                wheels = decision.wheels
            if failsafe.drives and not drove:
                takeovers += 1
                say(f"{t_s:6.2f} s  {'stuck' if stuck else 'blind'}: the handler drives")
            elif drove and not failsafe.drives:
                say(f"{t_s:6.2f} s  free: the planner drives")
        rover.drive(wheels)
        t_s += PERIOD_S
    return Trip(is_out(rover.world), rover.world.y_m, t_s, takeovers)


def is_out(world: World) -> bool:
    """Whether a rover has left the forest of 50 x 50 m."""
    return not (0.0 <= world.x_m <= 50.0 and 0.0 <= world.y_m <= 50.0)


def make_failsafe(forest: int) -> FailSafe:
    """Return the fail-safe of one trip."""
    return FailSafe(make_handler("forest-pledge", vehicle=VEHICLE, seed=forest), VEHICLE)


def tell(who: str, trip: Trip) -> None:
    """Say what became of a rover."""
    fate = "out of the forest" if trip.out else f"still {50.0 - trip.north_m:.1f} m short of the edge"
    print(f"{who}: {fate} after {trip.time_s:.0f} s, {trip.takeovers} takeovers")


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    tell("the planner alone", drive(number, None))
    tell("with the fail-safe", drive(number, make_failsafe(number), print))
