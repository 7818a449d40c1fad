"""The driver interface: one small protocol per capability, and what goes through it (``readings``).

Everything above this file (detector, escape handler, safety gate, supervisor) knows a rover only through these
protocols; everything below it (``drivers`` for real parts, ``simhal`` for simulated ones) implements them. Field code
never asks which of the two it was given.

Conventions, everywhere:

* ``t_s`` is the time of the reading on the event loop's clock (``asyncio.get_running_loop().time()``), in seconds.
* headings are degrees clockwise from magnetic north in [0, 360).
* pitch is positive nose up, roll is positive right side down, both in degrees in [-180, 180].
* forward and right are positive, in metres.
* an unknown value is ``None`` or has a low quality. It is never 0, because 0 means north, still or level.
* readings are immutable, finite and in range; a driver that cannot give such a reading raises ``BadReading``.

Life cycle of a driver: ``__init__`` only stores its arguments and uses no bus; ``open`` is the first to communicate
with the part; ``close`` may be called at any time after that, also twice, or after a failed ``open``. ``open`` may be
called again, as it is after a failure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from wayfarer.readings import STOP, CompassReading, ContactReading, MotionReading, Side, WheelCommand, WheelReading

# What is in ``readings`` because it is compiled; everything else of an interface is here.
__all__ = ["STOP", "CompassReading", "ContactReading", "MotionReading", "Side", "WheelCommand", "WheelReading"]


class Snapshot(NamedTuple):
    """The readings of all sensors at one control tick.

    None if a sensor has no reading yet; motion and wheels: since the last tick.
    """

    t_s: float
    compass: CompassReading | None
    motion: MotionReading | None
    contact: ContactReading | None
    wheels: WheelReading | None = None


class MotorHealth(NamedTuple):
    """State of the motor board: battery in volts (None if not measured), and texts of its faults, empty if none."""

    battery_v: float | None
    faults: tuple[str, ...]


class Colour(NamedTuple):
    """Colour of a status light; each part in 0 (off) to 1. A light of one colour shows whether any part is above 0."""

    red: float
    green: float
    blue: float


class PositionFix(NamedTuple):
    """A position for the log and for mission limits; escape decisions never see one.

    Degrees north and east (WGS 84) and the horizontal error in metres (None if the receiver does not report it).
    ``utc_s`` is the time of the receiver's own clock, UTC in seconds since 1970, unchecked; None if it has none.
    """

    t_s: float
    latitude_deg: float
    longitude_deg: float
    error_m: float | None
    utc_s: float | None = None


@runtime_checkable
class Driver(Protocol):
    """The methods of every part. ``name`` is for logs and messages: the part and where it is connected."""

    name: str

    async def open(self) -> None:
        """Communicate with the part for the first time and check that it is the right one.

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
            BadReading: an impossible answer.
        """


@runtime_checkable
class MotionSensor(Driver, Protocol):
    """Wheel-independent evidence of motion (optical flow or camera), typically read at 20 Hz."""

    async def read(self) -> MotionReading:
        """Return the displacement since the previous call; it never waits for motion.

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
class WheelSensor(Driver, Protocol):
    """Encoders of the wheels, or a motor board that measures its current, or both; typically read at 20 Hz."""

    async def read(self) -> WheelReading:
        """Return what the wheels did since the previous call; it never waits for them to turn.

        Raises:
            NotResponding: no answer within the bus's deadline.
            BadReading: an answer that cannot be true.
        """


@runtime_checkable
class DriveMotors(Driver, Protocol):
    """The left and right wheels of a skid-steered rover.

    ``deadman_s`` is how long after the last command the board itself stops the wheels; None if it cannot. ``open``
    arms that deadman and verifies it if the board can report it, and turns no wheel. The motors are opened again at
    each arming, and after each failure during a mission, because a board that lost its power for a moment has forgotten
    its deadman.
    """

    deadman_s: float | None

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply the command and return what was really applied after the driver's own limits.

        Raises:
            NotResponding: the board did not acknowledge; the wheels may still turn until its deadman trips.
            PowerLost: the board has forgotten its deadman; the wheels are stopped, and it must be opened again.
        """

    async def stop(self) -> None:
        """Stop both wheels. Needs no earlier state, works before ``open``, may be repeated, never raises."""

    def halt(self) -> None:
        """Send a stop without waiting for it, from any thread: it works also when the event loop is blocked.

        It never raises and never blocks. If the bus hangs, the stop is the first command sent when the bus works again.
        """

    async def read_back(self) -> WheelCommand | None:
        """Return the duties that the board reports as applied now, or None if the board cannot report them.

        Raises:
            NotResponding: the board did not answer.
            BadReading: an impossible answer.
        """

    async def health(self) -> MotorHealth:
        """Return battery voltage and board faults.

        Raises:
            NotResponding: the board did not answer.
            BadReading: an impossible answer.
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
class PositionReceiver(Driver, Protocol):
    """A receiver such as GPS, read at about 1 Hz, for the log and for mission limits only."""

    async def read(self) -> PositionFix | None:
        """Return the latest fix, or None while there is none.

        Raises:
            NotResponding: the receiver, or the service that reads it, is gone.
        """


class NoFix(NamedTuple):
    """Why a receiver gives no fix: what was found, the likely cause, and what to do; one line each."""

    found: str
    cause: str
    remedy: str


@runtime_checkable
class ExplainsNoFix(Protocol):
    """An optional method of a position receiver, for ``wayfarer check``."""

    def why_no_fix(self) -> NoFix:
        """Return why the last ``read`` gave None."""


@runtime_checkable
class Recognised(Protocol):
    """A driver that can say whether its part is there, so that ``wayfarer init`` finds it.

    It can be made with the defaults of its settings. For a part on a bus, the setting ``bus`` names the device; a
    driver on an I2C bus also has the class attribute ``addresses``: where such a part may answer.
    """

    async def identify(self) -> None:
        """Make sure that the part answers, by reading what identifies it; changes nothing, turns no wheel.

        Raises:
            NotResponding: nothing answers.
            WrongPart: something else answers.
            BadReading: something answers, and the answer cannot be true.
        """


@runtime_checkable
class HasErrorCounts(Driver, Protocol):
    """An optional property of any part: it counts errors that it recovered from, such as a read that was repeated."""

    @property
    def error_counts(self) -> Mapping[str, int]:
        """The number of each error since the part was made, by a short name: ``{"reads retried": 3}``."""


@runtime_checkable
class HasNote(Driver, Protocol):
    """An optional attribute of a compass or motors: a note on how it is connected, for ``wayfarer check``."""

    note: str


def error_counts_of(part: Driver) -> Mapping[str, int]:
    """Return the error counts of a part; empty if it does not count."""
    return part.error_counts if isinstance(part, HasErrorCounts) else {}


async def has_readback(motors: DriveMotors) -> bool:
    """Return whether an open motor board can report its state.

    If it can, opening it has proved that its deadman is on, if it has one (``deadman_s``). If it cannot, only a person
    who watches the wheels can confirm the deadman.

    Raises:
        DriverError: it can be asked, and did not answer correctly.
    """
    return await motors.read_back() is not None


@dataclass(frozen=True, slots=True)
class Rover:
    """The bundle of drivers that makes one rover; members that a rover does not have are None."""

    compass: Compass
    motors: DriveMotors
    motion: MotionSensor | None = None
    contact: ContactSensor | None = None
    wheels: WheelSensor | None = None
    position: PositionReceiver | None = None
    light: StatusLight | None = None

    @property
    def parts(self) -> Mapping[str, Driver]:
        """The parts of this rover, by capability, in the order of opening: the motors first."""
        names = ("motors", "compass", "motion", "contact", "wheels", "position", "light")
        return {name: part for name in names if (part := getattr(self, name)) is not None}
