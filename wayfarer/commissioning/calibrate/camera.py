"""Calibration of a camera without direction: how much the image changes at rest and in motion.

The numbers belong to the ground and the light of that day, so they go into the rover file, where a person sees them.
"""

from __future__ import annotations

import asyncio
from statistics import median
from typing import Protocol, runtime_checkable

from wayfarer.commissioning.manual_drive import sample_during
from wayfarer.commissioning.operator import Operator
from wayfarer.config.calibration_file import FlowEntry, stamp
from wayfarer.errors import WayfarerError
from wayfarer.hal import MotionReading

STILL_S = 2.0  # at 10 pictures a second: 20 of them
TIMES_STILL_MIN = 2.0  # less change than that is not told from noise


@runtime_checkable
class ChangeSensor(Protocol):
    """A motion sensor that can say how much its picture changes; see ``drivers.camera_motion``."""

    name: str

    async def read(self) -> MotionReading:
        """Return a reading; one that is not ``signed`` says only that something changed."""

    async def change(self) -> float:
        """Return the mean change of a pixel since the picture before, in grey levels."""


async def calibrate_picture(motion: ChangeSensor, operator: Operator, distance_m: float, t_wall: float) -> FlowEntry:
    """Guide a person through standing still and a push, and say what to write into the rover file.

    Raises:
        DriverError: the camera stopped answering.
        WayfarerError: the picture hardly changes when the rover moves.
    """
    await operator.say("Hands off: looking at the ground while nothing moves.")
    still = median(await sample_during(asyncio.sleep(STILL_S), motion.change, 0.0))  # the camera sets the pace
    time = asyncio.get_running_loop().time
    starts_s = time()
    told = operator.wait(f"Push it straight ahead by {distance_m:g} m, at cruising speed, and stop there.")
    moving = median(await sample_during(told, motion.change, 0.0))
    if moving < TIMES_STILL_MIN * still:
        raise WayfarerError(
            f"{motion.name}: its picture changes by {moving:.1f} grey levels when pushed and by {still:.1f} when still;"
            " push it faster, fix exposure_us under [parts.motion], or let the camera look at rougher ground"
        )
    speed_m_s = distance_m / (time() - starts_s)
    await operator.say(
        f"Write under [parts.motion]: difference_still = {still:.1f}, difference_moving = {moving:.1f}, "
        f"difference_speed_m_s = {speed_m_s:.2f}"
    )
    return FlowEntry(**stamp(motion.name, t_wall), scale=1.0)
