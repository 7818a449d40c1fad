"""The driver interface: one small protocol per capability, and the types of the readings.

Everything above this file (detector, escape handler, safety gate, supervisor) knows a rover only through these
protocols; everything below it (``drivers`` for real parts, ``simhal`` for simulated ones) implements them. Field code
never asks which of the two it was given.

Conventions, everywhere:

* ``t_s`` is the time of the reading on the event loop's clock (``asyncio.get_running_loop().time()``), in seconds.
* headings are degrees clockwise from magnetic north in [0, 360).
* pitch is positive nose up, roll is positive right side down, both in degrees in [-180, 180].
* forward and right are positive, in metres.
* a value that is not known is ``None`` or a low quality. It is never 0: 0 is north, still, level.
* readings are immutable, finite and in range; a driver that cannot give such a reading raises ``BadReading``.

Life cycle of a driver: ``__init__`` only stores what it is given and touches nothing; ``open`` speaks to the part for
the first time; ``close`` may come at any moment after that, twice, or after a failed ``open``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol, runtime_checkable


class Side(Enum):
    """Where the body touches something, seen from the rover."""

    FRONT = "front"
    LEFT = "left"
    RIGHT = "right"
    REAR = "rear"


class CompassReading(NamedTuple):
    """Heading and tilt of the body at ``t_s``.

    ``calibration`` is 0 (not calibrated) to 3 (fully), or None where the part does not tell.
    """

    t_s: float
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    calibration: int | None


class MotionReading(NamedTuple):
    """Displacement over ground since the previous read, in the body's own frame.

    ``quality`` runs from 0 (nothing can be said) to 1. **Low quality means unknown, never still**: a leaf on the lens
    also reads zero. A sense that sees how much changed but not which way (successive images of a forward-looking
    camera) is not ``signed``: its ``forward_m`` is a magnitude.
    """

    t_s: float
    forward_m: float
    right_m: float
    quality: float
    signed: bool = True


class ContactReading(NamedTuple):
    """What touches the body at ``t_s``.

    ``sides`` is empty when nothing does. ``obstacle_bearing_deg`` is the compass bearing of the long axis of what is
    touched, in [0, 180), or None where that is not known (a tree, a rover without that sense).
    """

    t_s: float
    sides: tuple[Side, ...]
    obstacle_bearing_deg: float | None


class Snapshot(NamedTuple):
    """What all sensors say at one control tick; None where a sensor has not spoken (motion: since the last tick)."""

    t_s: float
    compass: CompassReading | None
    motion: MotionReading | None
    contact: ContactReading | None


class WheelCommand(NamedTuple):
    """Duty of the left and right wheels, each in -1 (full reverse) to 1 (full ahead); 0 stops."""

    left: float
    right: float


STOP = WheelCommand(0.0, 0.0)


class MotorHealth(NamedTuple):
    """State of the motor board: battery in volts (None where it is not measured) and fault texts, empty when well."""

    battery_v: float | None
    faults: tuple[str, ...]


class Colour(NamedTuple):
    """Colour of a status light; each part in 0 (off) to 1. A light of one colour shows whether any part is above 0."""

    red: float
    green: float
    blue: float


class PositionFix(NamedTuple):
    """A position for the log and for mission limits; escape decisions never see one.

    Degrees north and east (WGS 84) and the horizontal error in metres (None where the receiver does not tell).
    """

    t_s: float
    latitude_deg: float
    longitude_deg: float
    error_m: float | None


@runtime_checkable
class Driver(Protocol):
    """What every part can do. ``name`` is for logs and messages: the part and where it is connected."""

    name: str

    async def open(self) -> None:
        """Speak to the part for the first time and make sure that it is the right one.

        Raises:
            NotResponding: no answer; the text names bus, address and the likely cause.
            WrongPart: something else answered.
        """

    async def close(self) -> None:
        """Release the part. Safe twice and after a failed ``open``; never raises."""


@runtime_checkable
class Compass(Driver, Protocol):
    """Tilt-compensated compass, typically read at 20 Hz."""

    async def read(self) -> CompassReading:
        """Return the latest heading and tilt.

        Raises:
            NotResponding: no answer within the bus's deadline.
            BadReading: an answer that cannot be true.
        """


@runtime_checkable
class MotionSensor(Driver, Protocol):
    """Wheel-independent evidence of motion (optical flow or camera), typically read at 20 Hz."""

    async def read(self) -> MotionReading:
        """Return the displacement since the previous call; it never waits for motion to happen.

        Raises:
            NotResponding: no answer within the bus's deadline.
            BadReading: an answer that cannot be true.
        """


@runtime_checkable
class ContactSensor(Driver, Protocol):
    """Bumpers, typically read at 20 Hz."""

    async def read(self) -> ContactReading:
        """Return what touches the body now.

        Raises:
            NotResponding: no answer within the bus's deadline.
        """


@runtime_checkable
class DriveMotors(Driver, Protocol):
    """The left and right wheels of a skid-steered rover.

    ``deadman_s`` is how long after the last command the board itself stops the wheels; None where it cannot. ``open``
    arms that deadman and verifies it if the board can report it; the controller opens the motors again at each arming,
    because a board that lost its power for a moment has forgotten it.
    """

    deadman_s: float | None

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply the command and return what was really applied after the driver's own limits.

        Raises:
            NotResponding: the board did not acknowledge; the wheels may still turn until its deadman trips.
            PowerLost: the board has forgotten its deadman; the wheels stand, and it wants to be opened again.
        """

    async def stop(self) -> None:
        """Stop both wheels. Needs no earlier state, works before ``open``, may be repeated, never raises."""

    def halt(self) -> None:
        """Send a stop without waiting for it, from any thread: it works also when the event loop is blocked.

        It never raises and never blocks. Where the bus hangs, the stop goes out first when it is back.
        """

    async def read_back(self) -> WheelCommand | None:
        """Return what the board says that it applies now, or None where the board cannot be asked.

        Raises:
            NotResponding: the board did not answer.
            BadReading: what it answered cannot be.
        """

    async def health(self) -> MotorHealth:
        """Return battery voltage and board faults.

        Raises:
            NotResponding: the board did not answer.
            BadReading: what it answered cannot be.
        """


@runtime_checkable
class StatusLight(Driver, Protocol):
    """A light (or a buzzer) that shows a person at ten metres what the rover is about to do."""

    async def show(self, colour: Colour) -> None:
        """Show a colour until the next call.

        Raises:
            NotResponding: the light did not acknowledge.
        """


@runtime_checkable
class PositionLogger(Driver, Protocol):
    """A receiver such as GPS, read at about 1 Hz, for the log and for mission limits only."""

    async def read(self) -> PositionFix | None:
        """Return the latest fix, or None while there is none.

        Raises:
            NotResponding: the receiver, or the service that reads it, is gone.
        """


@runtime_checkable
class Counting(Driver, Protocol):
    """What a part of any kind may have besides: it counts what went wrong and did no harm, such as a read again."""

    @property
    def troubles(self) -> Mapping[str, int]:
        """How often since the part was made, by what it was, in a few words: ``{"reads retried": 3}``."""


def troubles_of(part: Driver) -> Mapping[str, int]:
    """Return what a part has counted, nothing where it does not count."""
    return part.troubles if isinstance(part, Counting) else {}


async def can_be_asked(motors: DriveMotors) -> bool:
    """Return whether an open motor board answers, so that opening it proved that it is there and its deadman armed.

    Of a board that does not, nothing is believed that no person has seen.

    Raises:
        DriverError: it can be asked, and did not answer well.
    """
    return await motors.read_back() is not None


@dataclass(frozen=True, slots=True)
class Rover:
    """The bundle of drivers that makes one rover; members that a rover does not have are None."""

    compass: Compass
    motors: DriveMotors
    motion: MotionSensor | None = None
    contact: ContactSensor | None = None
    position: PositionLogger | None = None
    light: StatusLight | None = None

    @property
    def parts(self) -> Mapping[str, Driver]:
        """The parts that there are, by capability, in the order of opening: motors first, to be stopped first."""
        names = ("motors", "compass", "motion", "contact", "position", "light")
        return {name: part for name in names if (part := getattr(self, name)) is not None}
