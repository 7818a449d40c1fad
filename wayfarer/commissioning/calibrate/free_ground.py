"""Short drives on free ground with a person beside the rover, and the sensor readings during them.

Commands pass the gate of a mission (``gate.Gate``: highest duty, growth of duty), and the wheels are stopped after
each drive in any case. A rover that tilts is not on free ground any more: it stops and says so.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

from wayfarer.angles import wrap180
from wayfarer.commissioning.calibrate.response import Sample
from wayfarer.commissioning.checks import deadman, parts
from wayfarer.commissioning.checks.api import CheckVerdict, StandaloneInspection, run_checks
from wayfarer.commissioning.manual_drive import RATE_HZ, wheels_stopped_after
from wayfarer.control.rate import Rate
from wayfarer.errors import WayfarerError
from wayfarer.hal import CompassReading, WheelCommand
from wayfarer.safety.gate import Gate
from wayfarer.safety.tick_interval import Debounce

REST_S = 1.0  # between drives: from 1 m/s on the most slippery ground (a friction of 0.1) a body slides for a second
MUST_NOT_FAIL = (parts.motor_board, parts.motor_faults, parts.battery, deadman.proved)


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
