"""Fail-safe under another stack's planner: whether the rover is stuck, and whether the escape handler drives.

Pure, as all decision logic here. Once per control tick the other stack calls ``StuckDetector.update`` with what it
commanded and what it measured, and then ``FailSafe.update``. That returns None while its planner may drive, else the
decision for the wheels.
"""

from __future__ import annotations

from math import cos, hypot, inf, isfinite, radians, sin
from typing import Final

from wayfarer.detector.detector import Detector, DetectorTick
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Anomaly, Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import STOP, CompassReading, MotionReading
from wayfarer.safety.conditions import HOLDING_LEVELS, Condition, Level, worst
from wayfarer.safety.settings import SafetySettings
from wayfarer.safety.tick_interval import IntervalTimer
from wayfarer.setting_ranges import Angle, Metres, Seconds, ShortSeconds, check_number
from wayfarer.vocabulary import in_words

# A longer time between two calls counts as this, because what the wheels did in it is unknown.
GAP_MAX_S: Final = SafetySettings().tick_late_s
NO_HEADING: Final = Decision(STOP, Phase.HALT, "no_heading")

_STUCK: Final = (Anomaly.IMMOBILISED,)


class StuckDetector:
    """Finds out whether a rover is stuck: commanded to drive without moving, or tilted from the ground.

    It is the detector of wayfarer's own rovers. Stuck is less than 30 % of the possible motion over ``stuck_s``, no
    progress over 2 s, or a tilt. It claims nothing while less than 0.1 m/s is commanded, in a turn on the spot, or just
    after a change of direction, and it allows for slow starts on slippery ground. Motion that was not measured is
    unknown, never a standstill. After 3 m commanded ahead without a measurement it says that the rover is stuck,
    because something may have held it since then.

    **What was measured must not come from the wheels alone**: they also turn in deep mud. Take visual or lidar
    odometry, optical flow, a receiver with RTK, or a filter that includes one of them.

    ``anomalies`` are those of the latest tick, and ``conditions`` what is wrong with a sensor, by name.
    ``heading_deg`` is the newest plausible heading, None before the first.

    Args:
        vehicle: the body, whose ``max_speed_m_s`` is at least what is ever commanded.
        stuck_s: for how long a body that met something must not move, seconds; wayfarer's own rovers take 0.3.
        tilt_deg: pitch or roll from which it is tilted, degrees from the ground that it was put on or has driven over.
        heading_stale_s: without a new heading for so long, the compass counts as silent.
        motion_stale_s: without a new measurement for so long, the motion sensor counts as silent.

    Raises:
        OutOfRange: one is not a number, or outside of its range, which the text says.

    >>> vehicle = Vehicle(length_m=0.6, width_m=0.5, track_m=0.6, max_speed_m_s=1.2)
    >>> detector = StuckDetector(vehicle)
    >>> for tick in range(40):  # for a second it drives at 0.5 m/s; then a tree holds it
    ...     moved_m = 0.5 * 0.05 + 0.001 * (tick % 3) if tick < 20 else 0.0
    ...     stuck = detector.update(tick * 0.05, 10.0, speed_m_s=0.5, forward_m=moved_m)
    ...     if stuck:
    ...         break
    >>> tick * 0.05, detector.anomalies, detector.trouble
    (1.35, (<Anomaly.IMMOBILISED: 'immobilised'>,), '')
    """

    def __init__(
        self, vehicle: Vehicle, *, stuck_s: ShortSeconds = 0.5, tilt_deg: Angle = 20.0,
        heading_stale_s: ShortSeconds = 0.25, motion_stale_s: ShortSeconds = 0.4,
    ) -> None:  # fmt: skip
        settings = DetectorSettings(
            immobilised_s=check_number("StuckDetector", "stuck_s", stuck_s, ShortSeconds),
            tilt_deg=check_number("StuckDetector", "tilt_deg", tilt_deg, Angle),
            compass_stale_s=check_number("StuckDetector", "heading_stale_s", heading_stale_s, ShortSeconds),
            motion_stale_s=check_number("StuckDetector", "motion_stale_s", motion_stale_s, ShortSeconds),
        )
        self._vehicle = vehicle
        self._detector = Detector(settings, vehicle, may_reckon=False)
        self._timer = IntervalTimer(GAP_MAX_S, vehicle.max_speed_m_s)
        self._last_t_s = -inf
        self._position_m: tuple[float, float] | None = None
        self._on_ground = False
        self.anomalies: tuple[Anomaly, ...] = ()
        self.conditions: tuple[str, ...] = ()

    @property
    def heading_deg(self) -> float | None:
        """The newest plausible heading, degrees clockwise, 0 to 360; None before the first."""
        compass = self._detector.compass
        return None if compass is None else compass.heading_deg

    @property
    def trouble(self) -> str:
        """Why nobody should drive: a sensor is silent or wrong, or the body lies on its side; empty if not.

        Motion without a command is not trouble, because there is nothing to stop.
        """
        found = [each for each in map(Condition, self.conditions) if each is not Condition.RUNAWAY]
        cause = worst(found, HOLDING_LEVELS)
        return "" if cause is None or HOLDING_LEVELS[cause] < Level.HOLD else in_words(cause.value)

    def reset(self) -> None:
        """Forget the ground and the position: somebody has put the rover elsewhere."""
        self._position_m, self._on_ground = None, False

    def update(
        self, t_s: float, heading_deg: float | None, *, speed_m_s: float, turn_deg_s: float = 0.0,
        forward_m: float | None = None, right_m: float = 0.0, position_m: tuple[float, float] | None = None,
        pitch_deg: float = 0.0, roll_deg: float = 0.0, measured_t_s: float | None = None,
    ) -> bool:  # fmt: skip
        """Return whether the rover is stuck now; a command or heading that is not finite is ignored.

        Call it once per control tick, 10 to 50 times per second.

        Args:
            t_s: time of this tick, seconds on a clock that never goes back; at the same time the answer is the same.
            heading_deg: the newest heading, degrees clockwise, any number of turns; None if there is no new one.
            speed_m_s: the speed that was commanded since the last tick, negative in reverse.
            turn_deg_s: the turn rate that was commanded since then, clockwise positive.
            forward_m: how far the body was measured to move ahead since the last measurement, negative in reverse; None
                if there is no new one, NaN if the sensor answers and does not know.
            right_m: how far it moved to its right in the same time.
            position_m: in place of ``forward_m`` where it was measured to be, east and north by the same north as the
                heading; its errors must be small against the way of ``stuck_s``.
            pitch_deg: positive with the nose up.
            roll_deg: positive with the right side down.
            measured_t_s: when it was measured, on the clock of ``t_s``, if that is not about now.
        """
        t_s = float(t_s)
        if not t_s > self._last_t_s:
            return bool(self.anomalies)
        self._last_t_s = t_s
        if not isfinite(speed_m_s + turn_deg_s):
            speed_m_s = turn_deg_s = 0.0
        tick = DetectorTick(t_s, self._vehicle.mix(float(speed_m_s), radians(turn_deg_s)))
        self._timer.measure(tick)
        if heading_deg is not None and isfinite(heading_deg + pitch_deg + roll_deg):
            tick.compass = CompassReading(t_s, float(heading_deg) % 360.0, float(pitch_deg), float(roll_deg), None)
        measured_t_s = t_s if measured_t_s is None else float(measured_t_s)
        if position_m is not None:
            tick.motion = self._moved_to(measured_t_s, position_m, heading_deg)
        elif forward_m is not None:
            known = isfinite(forward_m + right_m)
            way_m = (float(forward_m), float(right_m), 1.0) if known else (0.0, 0.0, 0.0)
            tick.motion = MotionReading(measured_t_s, *way_m)
        self._detector.update(tick, armed=True)
        if not self._on_ground and self._detector.compass is not None:
            self._on_ground = True
            self._detector.begin_mission(tick)  # it may stand on a slope: that is not a trunk
        self.anomalies = tick.anomalies
        self.conditions = tuple(condition.value for condition in tick.conditions)
        return bool(tick.anomalies)

    def _moved_to(self, t_s: float, position_m: tuple[float, float], heading_deg: float | None) -> MotionReading | None:
        """Return the way from the last position, in the body's own frame; None for the first position."""
        east_m, north_m = position_m
        if not isfinite(east_m + north_m):
            return None
        before_m, self._position_m = self._position_m, (float(east_m), float(north_m))
        if before_m is None:
            return None
        east_m, north_m = self._position_m[0] - before_m[0], self._position_m[1] - before_m[1]
        known_deg = self.heading_deg if heading_deg is None else heading_deg
        if known_deg is None or not isfinite(known_deg):
            return MotionReading(t_s, hypot(east_m, north_m), 0.0, 1.0, signed=False)
        east, north = sin(radians(known_deg)), cos(radians(known_deg))  # of a unit vector ahead
        return MotionReading(t_s, east_m * east + north_m * north, east_m * north - north_m * east, 1.0)


class FailSafe:
    """Takes the wheels from a planner that is stuck or blind, and gives them back once the rover is free.

    The rover is free when the handler's last episode is over and it has then followed the goal for a *free run*, a
    distance without an anomaly. If the handler took over only because the planner was blind, and met nothing, it gives
    the wheels back as soon as the planner sees again. A planner that is stuck again within ``relapse_s`` has steered
    back to the same place: the next free run is twice as long.

    Args:
        handler: an escape handler, as ``make_handler`` returns it. It restarts at each
            takeover, because it does not know what the planner did with the wheels.
        vehicle: the body; ``max_speed_m_s`` converts duties into commanded distance.
        free_run_m: the first free run, metres commanded.
        free_run_max_m: the longest one.
        relapse_s: seconds after the wheels were given back; a planner that gets stuck later has met something new.

    Raises:
        OutOfRange: a distance or time is not a number, or outside of its range, which the text says.

    >>> vehicle = Vehicle(length_m=0.6, width_m=0.5, track_m=0.6, max_speed_m_s=1.2)
    >>> failsafe = FailSafe(make_handler("forest-pledge", vehicle=vehicle), vehicle)
    >>> print(failsafe.update(0.0, heading_deg=10.0, goal_heading_deg=0.0, stuck=False))
    None
    >>> failsafe.update(0.05, heading_deg=10.0, goal_heading_deg=0.0, stuck=True).phase.value
    'back_off'
    """

    def __init__(
        self, handler: EscapeHandler, vehicle: Vehicle, *,
        free_run_m: Metres = 1.0, free_run_max_m: Metres = 16.0, relapse_s: Seconds = 10.0,
    ) -> None:  # fmt: skip
        self._handler = handler
        self._half_speed_m_s = vehicle.max_speed_m_s / 2
        self._first_run_m = self._run_m = check_number("FailSafe", "free_run_m", free_run_m, Metres)
        self._longest_run_m = check_number("FailSafe", "free_run_max_m", free_run_max_m, Metres)
        self._relapse_s = check_number("FailSafe", "relapse_s", relapse_s, Seconds)
        self._decision: Decision | None = None
        self._last_t_s = self._given_back_t_s = -inf
        self._time_s = self._travelled_m = 0.0
        self._followed_from_m = 0.0

    @property
    def drives(self) -> bool:
        """Whether the handler drives now."""
        return self._decision is not None

    def update(
        self, t_s: float, heading_deg: float, goal_heading_deg: float, *, stuck: object, blind: object = False
    ) -> Decision | None:
        """Return None while the planner may drive, else the decision for this tick; never raises.

        Args:
            t_s: time of this tick, seconds on a clock that never goes back; at the same time the answer is the same.
            heading_deg: degrees clockwise, any number of turns. While it is not finite, the handler stops the wheels.
            goal_heading_deg: the heading of the way out, from the same north.
            stuck: whether the rover is commanded to drive now and does not move, or tilts, or touches something, as
                ``StuckDetector`` finds it. It must be false as soon as that is over, because the handler takes it as a
                new anomaly. Any truth value, such as NumPy's.
            blind: whether the planner has no data to plan with; as ``stuck`` any truth value.
        """
        # Compiled handlers take Python's own numbers only, not NumPy's.
        t_s, heading_deg, goal_heading_deg = float(t_s), float(heading_deg), float(goal_heading_deg)
        dt_s = t_s - self._last_t_s
        if not dt_s > 0.0:
            return self._decision
        self._last_t_s = t_s
        if self._decision is None:
            if not (stuck or blind):
                return None
            if stuck:
                relapsed = t_s - self._given_back_t_s < self._relapse_s
                self._run_m = min(self._run_m * 2, self._longest_run_m) if relapsed else self._first_run_m
            self._followed_from_m = -inf  # nothing to be free from yet
            self._handler.reset()
        elif self._decision is not NO_HEADING:  # waiting for a heading counts neither as time nor as distance
            (left, right), dt_s = self._decision.wheels, min(dt_s, GAP_MAX_S)
            self._time_s += dt_s
            self._travelled_m += abs(left + right) * self._half_speed_m_s * dt_s
        decision = NO_HEADING
        if isfinite(heading_deg + goal_heading_deg):
            anomalies = _STUCK if stuck else ()
            decision = self._handler.decide(
                Observation(
                    self._time_s,
                    heading_deg % 360.0,
                    0.0,
                    0.0,
                    anomalies,
                    None,
                    goal_heading_deg % 360.0,
                    self._travelled_m,
                )
            )
            if decision.phase is not Phase.FOLLOW:
                self._followed_from_m = self._travelled_m
        self._decision = decision
        is_free = decision.phase is Phase.FOLLOW and self._travelled_m - self._followed_from_m >= self._run_m
        if is_free and not (stuck or blind):
            self._decision, self._given_back_t_s = None, t_s
        return self._decision
