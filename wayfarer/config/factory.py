"""Builds the bundle of drivers of a real rover from its file. No device is touched before it is opened."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wayfarer.config.calibration_file import Calibration
from wayfarer.config.messages import located
from wayfarer.config.own_file import OwnMistake, blaming
from wayfarer.config.registry import make_buses
from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.errors import BadConfig, BadInput, DriverError
from wayfarer.hal import MotionReading, MotionSensor, Rover, error_counts_of

if TYPE_CHECKING:
    from wayfarer.drivers.buses import Buses

NEEDED = ("compass", "motors")
UNCALIBRATED = Calibration()


def connect(
    config: RoverConfig, where: str, calibration: Calibration = UNCALIBRATED, *, checking: bool = False
) -> tuple[Buses, Rover]:
    """Return the buses that a rover file names and the rover on them.

    Args:
        config: the rover.
        where: its file, or the name of a shipped one.
        calibration: what calibrating it has found out.
        checking: a part whose driver cannot be made does not open, so that the others can be checked.

    Raises:
        BadConfig: its buses cannot be made, or it lacks a part; the text names file and key.
        OwnMistake: a driver of one's own failed while it was made.
    """
    try:
        buses: Buses = make_buses(config.buses)
    except BadInput as error:
        raise BadConfig(located(where, f"key 'buses': {error}")) from None
    try:
        return buses, assemble(config, buses, calibration, checking=checking)
    except BadConfig as error:
        raise BadConfig(located(where, str(error))) from None


def assemble(
    config: RoverConfig,
    buses: Buses,
    calibration: Calibration = UNCALIBRATED,
    *,
    checking: bool = False,
) -> Rover:
    """Return the rover that a file describes, on these buses, with what calibrating it has found out.

    Raises:
        BadConfig: the file names no compass or no motors.
        OwnMistake: as ``connect``.
    """
    for part in NEEDED:
        if part not in config.parts:
            raise BadConfig(
                f"key 'parts.{part}' is missing: rover '{config.name}' has no [parts.{part}] and can only be simulated "
                "(wayfarer run --sim); for a real rover name its parts, as in forestrover.toml"
            )
    rover = Rover(**{part: make_part(part, table, buses, checking) for part, table in config.parts.items()})
    if calibration.flow is not None and not isinstance(rover.motion, UnmadePart | None):
        rover = replace(rover, motion=_scaled(config.parts["motion"], rover.motion, buses, calibration.flow.scale))
    return rover


def make_part(part: str, table: dict[str, Any], buses: Buses, checking: bool) -> Any:
    """Return the driver of one part, from its table in a rover file; while checking, what stands for an unmade one."""
    driver, settings = part_settings(part, table)
    try:
        with blaming(f"driver '{table['driver']}' of 'parts.{part}' failed while it was made"):
            return driver(settings, buses)
    except OwnMistake as mistake:
        if checking:
            return UnmadePart(part, mistake)
        raise


class UnmadePart:
    """Stands for a part whose driver failed while it was made: it does not open, and the checks say why."""

    def __init__(self, part: str, mistake: OwnMistake) -> None:
        self.name, self.deadman_s, self._what = part, None, mistake.what

    async def open(self) -> None:
        """Say what failed.

        Raises:
            DriverError: always.
        """
        raise DriverError(self._what, "correct that and run it again")

    async def close(self) -> None:
        """There is nothing to close."""

    stop = close


def _scaled(table: dict[str, Any], sensor: MotionSensor, buses: Buses, scale: float) -> MotionSensor:
    """Return a calibrated motion sensor; one that knows the angle of a count judges by it what it can have seen."""
    driver, settings = part_settings("motion", table)
    if not hasattr(settings, "rad_per_count"):
        return ScaledMotionSensor(sensor, scale)
    calibrated: MotionSensor = driver(replace(settings, rad_per_count=settings.rad_per_count * scale), buses)
    return calibrated


class ScaledMotionSensor:
    """A motion sensor whose metres were calibrated; implements ``hal.MotionSensor``."""

    def __init__(self, sensor: MotionSensor, scale: float) -> None:
        self.name = sensor.name  # calibration is kept under it
        self._sensor = sensor
        self._scale = scale

    @property
    def error_counts(self) -> Mapping[str, int]:
        """What the sensor has counted."""
        return error_counts_of(self._sensor)

    async def open(self) -> None:
        """Open the sensor."""
        await self._sensor.open()

    async def close(self) -> None:
        """Close the sensor."""
        await self._sensor.close()

    async def read(self) -> MotionReading:
        """Read the sensor and scale its metres."""
        reading = await self._sensor.read()
        return reading._replace(forward_m=reading.forward_m * self._scale, right_m=reading.right_m * self._scale)
