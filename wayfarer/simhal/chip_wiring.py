"""Finds the simulated chip of a driver and puts it on the simulated buses.

Built-in chips are in ``built_in_chips.py``. A third party adds one with an entry point in the group ``wayfarer.chips``,
under the driver's name, or by the attribute ``simulated_chip = "FILE.py:NAME"`` of its driver class, or
``"module:attribute"``; no file of wayfarer is touched.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import getfile
from pathlib import Path
from typing import Any, Final, Protocol

from wayfarer.config.own_file import blaming, whole_name
from wayfarer.config.registry import BUILT_IN_DRIVERS, installed_points, load_path
from wayfarer.config.rover_file import part_settings
from wayfarer.errors import BadInput
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.simulated_world import SimulatedWorld

CHIP_GROUP: Final = "wayfarer.chips"

# Built-in chips, by the driver's name in a rover file.
BUILT_IN_CHIPS: Final[Mapping[str, str]] = {
    "bno055": "wayfarer.simhal.built_in_chips:BNO055",
    "camera_motion": "wayfarer.simhal.built_in_chips:CAMERA",
    "cmps14": "wayfarer.simhal.built_in_chips:CMPS14",
    "encoders": "wayfarer.simhal.built_in_chips:ENCODERS",
    "gpio_light": "wayfarer.simhal.built_in_chips:NO_CHIP",
    "gpio_motors": "wayfarer.simhal.built_in_chips:GPIO_MOTORS",
    "pmw3901": "wayfarer.simhal.built_in_chips:PMW3901",
    "roboclaw": "wayfarer.simhal.built_in_chips:ROBOCLAW",
    "roboclaw_wheels": "wayfarer.simhal.built_in_chips:ROBOCLAW_WHEELS",
    "sabertooth": "wayfarer.simhal.built_in_chips:SABERTOOTH",
    "thunderborg": "wayfarer.simhal.built_in_chips:THUNDERBORG",
    "thunderborg_light": "wayfarer.simhal.built_in_chips:NO_CHIP",
}
_NAMES: Final = {path: name for name, path in BUILT_IN_DRIVERS.items()}


class MotorBoard(Protocol):
    """A chip that drives the wheels and has its own deadman."""

    @property
    def stops_by_s(self) -> float:
        """When the deadman stops the wheels unless a command comes before; infinite while it is off."""

    def power_cycle(self) -> None:
        """Lose power for a moment."""

    def tick(self) -> None:
        """Let the deadman stop the wheels, at its own time, if that has come."""


class ChipWiring:
    """The simulated buses of one rover, and what its chips feel and drive.

    ``clock`` is seconds on the clock of the world. Sensor chips use ``sense_clock`` instead, which lets the motor
    boards act first. Each motor board must be in ``boards``.
    """

    def __init__(
        self, world: SimulatedWorld, streams: RandomStreams, clock: Callable[[], float], buses: FakeBuses
    ) -> None:
        self.world, self.streams, self.clock, self.buses = world, streams, clock, buses
        self.boards: list[MotorBoard] = []
        buses.pins().before_read.append(lambda: self.world.advance_to(self.sense_clock()))

    def tick(self) -> None:
        """Let deadmen trip whose time has come."""
        for board in self.boards:
            board.tick()

    def sense_clock(self) -> float:
        """Return the time, once deadmen have tripped whose time has come."""
        self.tick()
        return self.clock()

    def attach(self, part: str, table: Mapping[str, Any]) -> bool:
        """Put the chip of a part of a rover file where the settings say; False if its driver has no simulated chip."""
        chip, settings = chip_of(part, table)
        if chip is None:
            return False
        with blaming(f"the simulated chip of driver '{driver_name(table)}' of 'parts.{part}' failed while it was made"):
            chip.attach(settings, self)
        return True


def _no_quanta(_settings: Any) -> Mapping[str, float]:
    return {}


@dataclass(frozen=True, slots=True)
class SimulatedChip:
    """How the part of a driver is simulated; both functions get the driver's settings.

    Args:
        attach: makes the chip and puts it on the buses of a ``ChipWiring``.
        quanta: what the part at device depth needs to give the same readings: arguments of ``SimCompass``
            (``opens_s``), ``SimFlow`` (``m_per_count``, ``opens_s``), ``SimMotors`` (``steps``) or ``SimWheels``.
    """

    attach: Callable[[Any, ChipWiring], None]
    quanta: Callable[[Any], Mapping[str, float]] = _no_quanta


def driver_name(table: Mapping[str, Any]) -> str:
    """Return the driver's name in a part's table; a built-in driver may be given by its path there."""
    given: str = table["driver"]
    return _NAMES.get(given, given)


def chip_of(part: str, table: Mapping[str, Any]) -> tuple[SimulatedChip | None, Any]:
    """Return how a part of a rover file is simulated, None if its driver has no chip, and its settings.

    Raises:
        BadInput: a third party's chip cannot be imported, or is not a ``SimulatedChip``.
    """
    driver, settings = part_settings(part, table)
    name = driver_name(table)
    if name in BUILT_IN_CHIPS:
        path = BUILT_IN_CHIPS[name]
    elif name in (points := installed_points(CHIP_GROUP)):
        path = points[name].value
    elif hasattr(driver, "simulated_chip"):
        path = whole_name("chip", driver.simulated_chip, Path(getfile(driver)).parent)
    else:
        return None, settings
    chip = load_path("chip", path)
    if not isinstance(chip, SimulatedChip):
        raise BadInput(f"chip '{path}' of driver '{name}' is not a wayfarer.testing.SimulatedChip")
    return chip, settings
