"""Calibration of the compass: rotate the rover until the chip is calibrated, store that, verify with quarter turns.

The part calibrates itself only while this runs. In the field that is off: near a trunk with wire in it, or under the
motors' current, a part that goes on calibrating learns the wrong field and moves the heading (field.md 2, item 20).
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from typing import Protocol, runtime_checkable

from wayfarer.angles import circular_mean, wrap180
from wayfarer.commissioning.manual_drive import Operator, sample_headings
from wayfarer.config.calibration_file import CompassEntry, stamp
from wayfarer.errors import BadReading, WayfarerError
from wayfarer.hal import Compass

# Calibration config bytes of the CMPS14, data sheet page 3: accelerometer and magnetometer without auto-save; all off.
LEARN, OFF = 0x83, 0x80
FULL = 3
LOOK_S = 0.5
PATIENCE_S = 300.0
STEADY_S = 1.0
# Quarter turns by hand against an edge are right within a few degrees; this far off, something else went wrong.
FOLLOWS_WITHIN_DEG = 45.0

PREPARE = (
    "Take the rover outdoors, 5 m from cars and fences, 0.5 m from computers; leave keys and phone 0.15 m away. Ready?"
)
TURN_ABOUT = (
    "Lift the rover and turn it slowly about all three axes: nose up and down, onto each side, and right round; "
    "hold it still for a second in between."
)
QUARTERS = (
    "Set the rover down with one side along a straight edge (a plank) and step back.",
    "Turn it to the right by exactly a quarter turn, its rear along the edge, and step back.",
    "Turn it to the right by another quarter turn.",
    "Turn it to the right by the last quarter turn.",
)


class CompassLevels(Protocol):
    """How well parts of a compass are calibrated, each 0 to 3. The CMPS14's gyro level is broken and not looked at."""

    @property
    def accel(self) -> int:
        """Of tilt."""

    @property
    def mag(self) -> int:
        """Of the field."""


@runtime_checkable
class CalibratableCompass(Compass, Protocol):
    """A compass that can be told when to calibrate itself, as the CMPS14."""

    async def calibration(self) -> CompassLevels:
        """Return the levels now."""

    async def configure(self, config: int) -> None:
        """Choose what calibrates itself, by the part's config byte."""

    async def store_profile(self) -> None:
        """Have the part keep its calibration without power."""

    async def erase_profile(self) -> None:
        """Go back to the calibration of the factory."""


async def calibrate_compass(compass: Compass, operator: Operator, t_wall: float) -> CompassEntry:
    """Guide a person through calibrating an open compass.

    Raises:
        DriverError: it stopped answering.
        WayfarerError: it cannot be calibrated here; the text says why. It is left as it was, or as far as it got, with
            calibration off.
    """
    await operator.wait(PREPARE)
    if isinstance(compass, CalibratableCompass):
        await _teach(compass, operator)
    else:
        await operator.say(f"{compass.name} accepts no calibration: only its error is measured.")
    error_deg = residual_deg([await _heading(compass, operator, text) for text in QUARTERS])
    if error_deg > FOLLOWS_WITHIN_DEG:
        raise WayfarerError(
            f"{compass.name}: the heading was {error_deg:.0f}° off after quarter turns; it was turned to the left, or "
            "there is a magnet or iron beside the compass: move it onto a mast and calibrate again"
        )
    level = (await compass.read()).calibration
    await operator.say(f"Quarter turns were off by {error_deg:.1f}° on average.")
    return CompassEntry(**stamp(compass.name, t_wall), level=level or 0, residual_deg=error_deg)


async def _teach(compass: CalibratableCompass, operator: Operator) -> None:
    """Ask for turns until the levels are full, and store the calibration; calibrating ends in any case."""
    if await operator.ask("Forget the stored calibration first (right after the compass was moved to another place)?"):
        await compass.erase_profile()
    try:
        await compass.configure(LEARN)
        await operator.say(TURN_ABOUT)
        async with asyncio.timeout(PATIENCE_S):
            await _until_full(compass, operator)
        await compass.store_profile()
    except TimeoutError:
        raise WayfarerError(
            f"{compass.name}: not calibrated within {PATIENCE_S:.0f} s of turning; there may be iron or current near "
            "it: go elsewhere, switch the motors' power off, and calibrate again"
        ) from None
    finally:
        await compass.configure(OFF)


async def _until_full(compass: CalibratableCompass, operator: Operator) -> None:
    """Show the levels as they change until both are full."""
    shown = ""
    while True:
        with suppress(BadReading):  # a cable that is moved about
            levels = await compass.calibration()
            text = f"field {levels.mag} of {FULL}, tilt {levels.accel} of {FULL}"
            if text != shown:
                await operator.say(text)
                shown = text
            if levels.mag == levels.accel == FULL:
                return
        await asyncio.sleep(LOOK_S)


async def _heading(compass: Compass, operator: Operator, text: str) -> float:
    """Return the mean heading of a second, once the rover is placed as asked."""
    await operator.wait(text)
    mean_deg, _ = circular_mean(await sample_headings(compass.read, STEADY_S))
    return mean_deg


def residual_deg(headings_deg: Sequence[float]) -> float:
    """Return by how much the turns between headings that are a quarter apart, all round, differ from 90° on average."""
    turned_deg = [
        wrap180(after - before)
        for before, after in zip(headings_deg, [*headings_deg[1:], headings_deg[0]], strict=True)
    ]
    return sum(abs(wrap180(turn_deg - 90.0)) for turn_deg in turned_deg) / len(turned_deg)
