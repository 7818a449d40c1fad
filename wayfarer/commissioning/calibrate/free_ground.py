"""Short drives on free ground with a person beside the rover, and how the body responds to wheel duty in them.

Commands pass the gate of a mission (``gate.Gate``: highest duty, growth of duty), and the wheels are stopped after
each drive in any case. A rover that tilts is not on free ground any more: it stops and says so.

*Turning.* Tyres of a skid-steered rover must slide sideways before it turns, so nothing turns up to some duty, its dead
zone. Beyond that the rate grows along a straight line (Mandow 2007; docs/explanation/physics.md has the closed form).

*Gaining speed.* A body that gains speed evenly is behind one that had full speed at once by half the time it takes.
Sums of displacement tell that well where single readings are noise.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager
from statistics import linear_regression
from typing import NamedTuple

from wayfarer.angles import wrap180
from wayfarer.clamp import clamp
from wayfarer.commissioning.checks import deadman, parts
from wayfarer.commissioning.checks.api import CheckVerdict, StandaloneInspection, run_checks
from wayfarer.commissioning.manual_drive import RATE_HZ, wheels_stopped_after
from wayfarer.config.calibration_file import SLOPE_MIN, SpeedGain, TurnResponse
from wayfarer.control.rate import Rate
from wayfarer.errors import WayfarerError
from wayfarer.hal import CompassReading, WheelCommand
from wayfarer.safety.gate import Gate
from wayfarer.safety.tick_interval import Debounce

REST_S = 1.0  # between drives: from 1 m/s on the most slippery ground (a friction of 0.1) a body slides for a second
MUST_NOT_FAIL = (parts.motor_board, parts.motor_faults, parts.battery, deadman.proved)
# A compass with a noise of 1 degree, read for 0.6 s at 20 Hz, gives a rate within 1.7 deg/s (one standard deviation).
TURNS_FROM_DEG_S = 8.0
POINTS_MIN = 3  # of a line: two would not show that it is one
UNSEEN_MAX = 0.05  # share of readings without quality: the way made during them is missing
LAST_S = 1.0  # of a drive ahead, at its final speed: a sensor with an error of 3 % a reading tells it within 1 %
MOVED_MIN_SHARE = 0.2  # of the speed it was told: less is a sensor that sees nothing, or a body that is held


class Sample(NamedTuple):
    """One tick: the heading gained (clockwise, through any number of turns) and the way made ahead since the start.

    ``seen`` is whether the motion sensor saw the ground.
    """

    t_s: float
    turned_deg: float
    ahead_m: float
    seen: bool


class FreeGround:
    """Drives a rover, and watches it by its compass and its motion sensor, where it has one.

    Args:
        inspection: the rover; nothing else uses it.
        scale: what the metres of the motion sensor must be multiplied by.
    """

    def __init__(self, inspection: StandaloneInspection, scale: float) -> None:
        self._inspection, self._scale = inspection, scale
        detector = inspection.config.detector
        self._quality_min, self._tilt_deg = detector.quality_min, detector.tilt_deg
        self._tilts = Debounce(detector.tilt_s)
        self._gate = Gate(inspection.config.safety, RATE_HZ)
        self._heading_deg = 0.0
        self._now = Sample(0.0, 0.0, 0.0, seen=False)

    async def refuse_unsafe(self) -> None:
        """Open the motors and make sure that they may drive a rover on the ground, by what arming asks of them.

        Raises:
            WayfarerError: they may not; the text says why and what to do.
        """
        for finding in await run_checks(self._inspection, MUST_NOT_FAIL):
            if finding.verdict is CheckVerdict.FAIL:
                raise WayfarerError(f"{finding.name}: {finding.found}; {finding.cause}: {finding.remedy}")

    @asynccontextmanager
    async def drives(self) -> AsyncGenerator[None]:
        """Let the wheels turn; on the way out they are stopped, and the body comes to rest."""
        reading = await self._inspection.rover.compass.read()
        await self._inspection.motion()  # what came before is not ours
        self._heading_deg, self._now = reading.heading_deg, Sample(reading.t_s, 0.0, 0.0, seen=True)
        async with wheels_stopped_after(self._inspection.rover.motors):
            self._gate = Gate(self._inspection.config.safety, RATE_HZ)
            yield
        await asyncio.sleep(REST_S)

    async def drive(self, wanted: WheelCommand, for_s: float) -> list[Sample]:
        """Give a command for a time, and return what was sensed after each tick of it.

        Raises:
            DriverError: a part did not answer.
            WayfarerError: the rover tilts.
        """
        rate, samples = Rate(RATE_HZ), []
        for _ in range(round(for_s * RATE_HZ)):
            wheels = self._gate.update((), lambda: wanted, armed=True)
            await self._inspection.rover.motors.drive(wheels)
            await rate.wait()
            samples.append(await self._sense())
        return samples

    async def _sense(self) -> Sample:
        reading, motion = await self._inspection.rover.compass.read(), await self._inspection.motion()
        self._refuse_tilt(reading)
        _, turned_deg, ahead_m, _ = self._now
        turned_deg += wrap180(reading.heading_deg - self._heading_deg)
        self._heading_deg = reading.heading_deg
        seen = motion is not None and motion.signed and motion.quality >= self._quality_min
        if motion is not None:
            ahead_m += motion.forward_m * self._scale
        self._now = Sample(reading.t_s, turned_deg, ahead_m, seen)
        return self._now

    def _refuse_tilt(self, reading: CompassReading) -> None:
        tilt_deg = max(abs(reading.pitch_deg), abs(reading.roll_deg))
        if self._tilts.update(reading.t_s, tilt_deg > self._tilt_deg):
            raise WayfarerError(
                f"stopped: the rover tilts by {tilt_deg:.0f}°; it ran onto something, or the ground is not level:"
                " set it on free, level ground and begin again"
            )


# -- fits to the samples ----------------------------------------------------------------------------------------------


def rate_deg_s(samples: Sequence[Sample]) -> float:
    """Return the rate of turn, clockwise: the slope of the heading.

    A shift of the heading by the motors' own field, which comes and goes with their current, is not in it.
    """
    slope, _ = linear_regression([each.t_s for each in samples], [each.turned_deg for each in samples])
    return slope


def turn_response(points: Sequence[tuple[float, float]]) -> TurnResponse | None:
    """Return the line through the points (duty, rate in the wanted direction) at which the body turned, least squares.

    Points are in rising order of duty; those up to the last one at which it stood are left out. None where fewer than
    ``POINTS_MIN`` are left: the body cannot turn, or hardly.
    """
    stood_at_duty, turning = 0.0, list(points)
    for index, (duty, rate) in enumerate(points):
        if rate < TURNS_FROM_DEG_S:
            stood_at_duty, turning = duty, list(points[index + 1 :])
    if len(turning) < POINTS_MIN:
        return None
    duties, rates = [duty for duty, _ in turning], [rate for _, rate in turning]
    slope, at_zero = linear_regression(duties, rates)
    if not slope >= SLOPE_MIN:  # NaN as well
        return None
    from_duty = clamp(-at_zero / slope, 0.0, duties[0])
    return TurnResponse(stood_at_duty=stood_at_duty, from_duty=from_duty, deg_s_per_duty=slope)


def speed_gain(samples: Sequence[Sample], commanded_m_s: float) -> SpeedGain | None:
    """Return how a body gained speed from rest; None where the motion sensor hardly saw the ground, or hardly a move.

    Its first command was given a tick before the first sample. It may still gain speed at the end, if evenly.
    """
    if sum(not each.seen for each in samples) > UNSEEN_MAX * len(samples):
        return None
    end_s, _, ahead_m, _ = samples[-1]
    last = [each for each in samples if each.t_s >= end_s - LAST_S]
    speed_m_s, _ = linear_regression([each.t_s for each in last], [each.ahead_m for each in last])
    if speed_m_s < MOVED_MIN_SHARE * commanded_m_s:
        return None
    tick_s = samples[1].t_s - samples[0].t_s
    driven_s = end_s - samples[0].t_s + tick_s
    takes_s = max(2.0 * (driven_s - ahead_m / speed_m_s), tick_s)  # ticks tell no shorter time
    return SpeedGain(speed_m_s=speed_m_s, takes_s=takes_s, gain_m_s2=speed_m_s / takes_s)
