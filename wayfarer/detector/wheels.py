"""The wheels as witnesses: do the rims turn, as encoders say, and as the motors' current says.

Both are judged as driving is, by the windows of ``StallMonitor``, with the way of the rims in place of the ground's.
Encoders measure it. The current shows it as well: that of a motor falls in a line from the stall current at rest to
nothing at free speed, so rims turn at ``duty - current / stall current`` of the speed at full duty. A limit in amperes
would not do: at a third of the duty a motor that is held draws a third of its stall current.

Rims that turn say nothing: wheels spin if the ground gives no grip. Who is believed is in ``witnesses``.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Final

from wayfarer.angles import clamp
from wayfarer.detector.response import StallMonitor
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import WheelCommand, WheelReading
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import Moved, ReadingInterval, TickInterval

# No grip keeps rims from gaining speed, only the motors and what they carry: a body of some kilograms takes 0.1 to
# 0.2 s (its stall force and free speed, ``simhal.world.skid_steering``). Chosen by us, with a margin.
RIM_GAIN_M_S2: Final = 2.0
# A motor that starts or is reversed draws up to its stall current, or twice that (0.5 s: walker robots, and the advice
# of makers of motor boards; docs/reference/hardware.md).
BLANK_S: Final = 0.5
MOST_STALLS: Final = 3.0  # stall currents; a motor that is reversed at full speed draws two, more is not possible
# Steered more sharply than this share of driving ahead, skid-steered motors are loaded by the turn.
SHARP_SHARE: Final = 0.5
# Rims turn that go this share of what was commanded, even if the other witness disagrees.
TURNS_SHARE: Final = 0.5
# With encoders each side that is driven with at least this share of the mean is judged by itself: the slower one
# counts. The current does not say which way it flows: that of the inner side in a curve, which the ground drags along,
# looks like a load. So of currents the mean counts.
SIDE_SHARE: Final = 0.5
# A body that turned so far on the spot has turned its wheels: an encoder that said only zeros has lost its wire.
# Far above the noise of a compass; chosen by us.
TURNED_DEG: Final = 45.0


class RimWindow(ReadingInterval):
    """What one witness says of the rims: ``stall`` judges, ``turns`` is whether the newest reading shows that they do.

    ``moved`` is what the newest reading shows, ``since_m`` the way commanded since.
    """

    def __init__(self, settings: DetectorSettings, vehicle: Vehicle) -> None:
        super().__init__(vehicle.max_speed_m_s)
        quick = replace(settings, gain_m_s2=max(settings.gain_m_s2, RIM_GAIN_M_S2))
        self.stall = StallMonitor(quick, vehicle)
        self.turns = False

    @property
    def since_m(self) -> float:
        """Metres commanded since the latest reading, both ways added."""
        return self._next.way_m

    def drive(self, interval: TickInterval, turned_deg: float) -> None:
        """Add a tick, and how far the body turned in it."""
        self._next.drive(interval, turned_deg, self._max_speed_m_s)

    def begin(self, t_s: float) -> Moved:
        """End the interval at a reading, or at a tick without one, and begin the next."""
        self.turns = False
        return self._close(t_s)

    def see(self, moved: Moved, left_m: float, right_m: float) -> None:
        """Take the way of the rims in the interval that has ended."""
        commanded_m, way_m = moved.commanded_m, moved.way_m
        mean_m = (left_m + right_m) / 2.0
        # Rims may go further than the body, and as the odometer they must not go further than was commanded.
        moved.see(clamp(mean_m, -way_m, way_m), 0.0, signed=True)
        self.turns = mean_m * commanded_m >= TURNS_SHARE * commanded_m * commanded_m


class WheelMonitor:
    """Judges each reading once: ``stood`` is whether the wheels are driven and do not turn.

    ``rims`` is what encoders say, and ``moved`` what this tick's reading shows of them, None if there is none;
    ``spoke_t_s`` is when the sensor last said something.

    Args:
        settings: thresholds.
        vehicle: gives the speed at full duty.
        witnesses: who is named in the rover file; if none is, silence is not a condition and nothing stands.
    """

    def __init__(self, settings: DetectorSettings, vehicle: Vehicle, witnesses: frozenset[str]) -> None:
        self._stale_s = settings.wheels_stale_s
        self._needed = bool(witnesses & {"wheels", "current"})
        self._by_way = "wheels" in witnesses
        self._speed_max_m_s = 2.0 * vehicle.max_speed_m_s
        self._full_m_s = vehicle.max_speed_m_s
        self._stall_a = settings.stall_current_a or 0.0
        self.rims = RimWindow(settings, vehicle)
        self._drawn = RimWindow(settings, vehicle) if "current" in witnesses and self._stall_a else None
        self._left_turned_deg = self._right_turned_deg = 0.0  # on the spot, since an encoder said that its side turns
        self._way = 0
        self._begun_s = self._read_t_s = -inf
        self.spoke_t_s = 0.0
        self.moved: Moved | None = None
        self.stood = False

    @property
    def turns(self) -> bool:
        """Whether the newest reading shows that the wheels turn."""
        return self.rims.turns or (self._drawn is not None and self._drawn.turns)

    def start(self, t_s: float) -> None:
        """Begin all ages now."""
        self.spoke_t_s = t_s
        self.rims.start(t_s)
        if self._drawn is not None:
            self._drawn.start(t_s)

    def update(
        self, interval: TickInterval, duties: WheelCommand, turned_deg: float, reading: WheelReading | None,
        conditions: list[Condition],
    ) -> None:  # fmt: skip
        """Take in a tick.

        Args:
            interval: the wheel commands since the previous one.
            duties: those of the motors, with what a slope takes up.
            turned_deg: how far the rover has turned since then.
            reading: what the sensor says, if anything.
            conditions: takes what is found.
        """
        t_s, forward_m, drawn = interval.t_s, interval.forward_m, self._drawn
        way = 1 if forward_m > 0.0 else -1 if forward_m < 0.0 else 0
        if way != self._way:
            self._way, self._begun_s = way, t_s
        self.rims.drive(interval, turned_deg)
        if drawn is not None:
            drawn.drive(interval, turned_deg)
        self.moved = None
        if interval.left * interval.right < 0.0:
            self._left_turned_deg += turned_deg
            self._right_turned_deg += turned_deg
        if reading is not None and self._read_t_s < reading.t_s <= t_s:
            self._take(duties, reading)
        elif t_s - self.spoke_t_s > self._stale_s:
            self.stood = False
            self.moved = self.rims.begin(t_s)
            self.rims.stall.clear()
            if drawn is not None:
                drawn.begin(t_s)
                drawn.stall.clear()
            if self._needed:
                conditions.append(Condition.WHEELS_STALE)

    def _take(self, duties: WheelCommand, reading: WheelReading) -> None:
        read_t_s, left_m, right_m, drawn = reading.t_s, reading.left_m, reading.right_m, self._drawn
        rims = self.rims
        moved = self.moved = rims.begin(read_t_s)
        moved.read_s = read_t_s - max(self._read_t_s, self.spoke_t_s)
        self._read_t_s = self.spoke_t_s = read_t_s
        most_m = self._speed_max_m_s * moved.read_s
        # NaN is not a distance: a log has it as none.
        if left_m is not None and right_m is not None and abs(left_m) <= most_m and abs(right_m) <= most_m:
            if left_m:
                self._left_turned_deg = 0.0
            if right_m:
                self._right_turned_deg = 0.0
            if max(abs(self._left_turned_deg), abs(self._right_turned_deg)) < TURNED_DEG:
                rims.see(moved, left_m, right_m)
                left_driven_m, right_driven_m = moved.commanded_m + moved.led_m, moved.commanded_m - moved.led_m
                least_m = SIDE_SHARE * moved.commanded_m * moved.commanded_m
                if min(left_driven_m * moved.commanded_m, right_driven_m * moved.commanded_m) >= least_m > 0.0:
                    share = clamp(min(left_m / left_driven_m, right_m / right_driven_m), -1.0, 1.0)
                    moved.counted_m = share * moved.commanded_m
        rims.stall.add(moved)
        self.stood = self._by_way and rims.stall.found
        if drawn is not None:
            self._weigh(drawn, duties, reading, moved.known)

    def _weigh(self, drawn: RimWindow, duties: WheelCommand, reading: WheelReading, rims_known: bool) -> None:
        """Take the currents of a reading, and join what both say."""
        moved = drawn.begin(reading.t_s)
        left_a, right_a = reading.left_a, reading.right_a
        sharp = abs(moved.led_m) > SHARP_SHARE * abs(moved.commanded_m)
        most_a = MOST_STALLS * self._stall_a
        # A motor that is driven draws something: zero is not a measurement, and must not speak against the encoders.
        if left_a is not None and right_a is not None and 0.0 < left_a <= most_a and 0.0 < right_a <= most_a:
            full_m = self._full_m_s * moved.driven_s
            left, right = duties.left, duties.right
            left_m = (left - (left_a if left > 0.0 else -left_a) / self._stall_a) * full_m
            right_m = (right - (right_a if right > 0.0 else -right_a) / self._stall_a) * full_m
            if not sharp and reading.t_s - self._begun_s >= BLANK_S:
                drawn.see(moved, left_m, right_m)
        drawn.stall.add(moved)
        if self.stood and drawn.turns:  # little current is drawn: the encoders are wrong
            self.stood = False
        elif drawn.stall.found and not (rims_known and self.rims.turns):
            self.stood = True
