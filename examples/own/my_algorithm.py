"""An algorithm of your own; as it is, it follows what it met with its right side, as a hand on a wall.

    pytest test_my_algorithm.py
    wayfarer sim --algorithm forest-pledge,my_algorithm.py --trials 200 --out results
    wayfarer compare results
    wayfarer run --rover my-rover.toml --algorithm my_algorithm.py

It has no clock, no I/O and no other randomness than ``rng``, so the same observations give the same decisions: in a
forest, on a rover and in a replay of its log.
"""

from math import radians
from random import Random

from wayfarer.escape.api import COUNTER_CLOCKWISE, Decision, Observation, Phase
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.hal import WheelCommand

SLACK = 3.0  # a phase may take so many times as long as planned: mud and blocked wheels are part of a normal day


def wrap180(angle_deg: float) -> float:
    """Return the same angle in -180 to 180."""
    return (angle_deg + 180.0) % 360.0 - 180.0


class MyAlgorithm:
    """Backs off, turns aside, and drives an arc back towards what it met until it heads for the goal again."""

    requires = ()  # ("contact",) if it needs a bumper: then ``observation.contact`` is never None

    def __init__(self, settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> None:
        self._settings = settings  # distances, angles and speeds: the table [escape] of the rover file
        self._vehicle, self._rng = vehicle, rng
        self.reset()

    def reset(self) -> None:
        """Forget everything: a new mission begins."""
        self._phase, self._until_s, self._from_m = Phase.FOLLOW, 0.0, 0.0
        self._last_deg: float | None = None  # the heading one tick ago
        self._counter_deg = 0.0  # how far it has turned since the episode began, clockwise positive
        self._turn_to_deg = 0.0  # the counter at which the turn is done
        self._side = COUNTER_CLOCKWISE
        self._episodes = 0

    def memory(self) -> dict[str, float | str]:
        """Return what the log shows of each tick; ``counter_deg`` and ``episodes`` have to be there."""
        return {"counter_deg": self._counter_deg, "episodes": self._episodes}

    def decide(self, observation: Observation) -> Decision:
        """Return wheels and phase for this tick; it is called 20 times per second and never raises."""
        if self._last_deg is not None:
            self._counter_deg += wrap180(observation.heading_deg - self._last_deg)
        self._last_deg = observation.heading_deg
        why = self._change_phase(observation)
        return Decision(self._wheels(observation), self._phase, why)

    def _change_phase(self, observation: Observation) -> str:
        """Begin another phase if this one is over, and return why: a fixed name, without values."""
        settings, driven_m = self._settings, observation.travelled_m - self._from_m
        late = observation.t_s >= self._until_s  # every phase but FOLLOW has to end, also if something holds the wheels
        match self._phase:
            case Phase.FOLLOW | Phase.PROBE if observation.anomalies:  # ``Anomaly`` has the kinds
                if self._phase is Phase.FOLLOW:
                    self._counter_deg, self._episodes = 0.0, self._episodes + 1
                self._begin(Phase.BACK_OFF, observation, settings.back_off_m / settings.reverse_m_s)
                return "anomaly"
            case Phase.BACK_OFF if late or driven_m >= settings.back_off_m:
                self._turn_to_deg = self._counter_deg + self._side * settings.turn_angle_deg
                self._begin(Phase.TURN_AWAY, observation, settings.turn_angle_deg / settings.turn_deg_s)
                return "back_off.done"
            case Phase.TURN_AWAY if late or self._left_deg <= settings.turn_within_deg:
                arc_m = settings.probe_straight_m + settings.probe_radius_m * radians(360.0)
                self._begin(Phase.PROBE, observation, arc_m / settings.cruise_m_s)
                return "turn_away.done"
            case Phase.PROBE if late or abs(self._goal_error_deg(observation)) <= settings.reset_within_deg:
                self._begin(Phase.FOLLOW, observation, 0.0)
                return "probe.done"
        return self._phase.value

    def _begin(self, phase: Phase, observation: Observation, planned_s: float) -> None:
        self._phase, self._from_m = phase, observation.travelled_m
        self._until_s = observation.t_s + planned_s * SLACK + 1.0  # a second to get going

    def _wheels(self, observation: Observation) -> WheelCommand:
        """Return the duties of left and right wheels, -1 to 1, for this phase."""
        settings = self._settings
        match self._phase:
            case Phase.BACK_OFF:
                return self._mix(-settings.reverse_m_s, 0.0)
            case Phase.TURN_AWAY:
                return self._mix(
                    0.0, self._side * min(max(self._left_deg * settings.turn_p, 30.0), settings.turn_deg_s)
                )
            case Phase.PROBE:
                straight = observation.travelled_m - self._from_m < settings.probe_straight_m
                arc_rad_s = 0.0 if straight else -self._side * settings.cruise_m_s / settings.probe_radius_m
                return self._vehicle.mix(settings.cruise_m_s, arc_rad_s)
        error_deg = self._goal_error_deg(observation)
        turn_deg_s = max(min(settings.heading_p * error_deg, settings.turn_deg_s), -settings.turn_deg_s)
        return self._mix(settings.cruise_m_s if abs(error_deg) < 45.0 else 0.0, turn_deg_s)

    def _mix(self, speed_m_s: float, turn_deg_s: float) -> WheelCommand:
        return self._vehicle.mix(speed_m_s, radians(turn_deg_s))  # clockwise is positive

    @property
    def _left_deg(self) -> float:
        return (self._turn_to_deg - self._counter_deg) * self._side

    def _goal_error_deg(self, observation: Observation) -> float:
        return wrap180(observation.goal_heading_deg - observation.heading_deg)
