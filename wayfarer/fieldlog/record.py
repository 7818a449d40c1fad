"""The records of a field log: one class for each kind, and the only description of it.

A line of a log is one record as a JSON object; its key ``record`` names the kind. From the classes follow what is
written and what is read: types, ranges, and the columns of tables and plots. ``docs/reference/log.md`` says what the
keys mean; a test compares it with the classes. A value that is as by default is not written, and a number that is none
(NaN) is null.

Ranges are far wider than any run needs, so that no view has to think of a time of a million years. What a sensor said
has no range: a failing part may say anything, and the log keeps it as it came.

Not compiled: a compiled ``Struct`` loses its tag, which is how a record says its kind (seen with mypyc 2.4).
"""

from __future__ import annotations

from math import nan
from numbers import Integral, Real
from typing import Annotated, Any, NamedTuple

import msgspec
from msgspec import Meta, Struct

from wayfarer.fieldlog.fields import escape_document
from wayfarer.hal import CompassReading, ContactReading, MotionReading, PositionFix, Side, WheelReading

SCHEMA = 4

# Types with units and ranges; seconds of a loop's clock up to 31 years, seconds since 1970 up to the year 2286.
Count = Annotated[int, Meta(ge=0, le=2**53)]
Seconds = Annotated[float, Meta(ge=0.0, le=1e9)]
Elapsed = Annotated[float, Meta(ge=-1e9, le=1e9)]
Wall = Annotated[float, Meta(ge=0.0, le=1e10)]
Metres = Annotated[float, Meta(ge=-1e6, le=1e6)]
Angle = Annotated[float, Meta(ge=-360.0, le=360.0)]
Duty = Annotated[float, Meta(ge=-1.01, le=1.01)]  # a driver may round
Latitude = Annotated[float, Meta(ge=-90.0, le=90.0)]
Longitude = Annotated[float, Meta(ge=-180.0, le=180.0)]
Numbers = Annotated[tuple[float, ...], Meta(min_length=2)]


class ReckonedPose(NamedTuple):
    """A position relative to where the log begins, metres, and the heading in degrees from magnetic north."""

    t_s: float
    north_m: float
    east_m: float
    heading_deg: float


class Record(Struct, kw_only=True, omit_defaults=True, tag_field="record"):
    """What every record has.

    ``n`` is its number from 1: one that is missing was lost. A header has none, because each part of a log begins with
    it. ``t_s`` is the loop's clock, ``elapsed_s`` the seconds since the run began, by which all tools name a moment,
    and ``t_wall`` the wall time in seconds since 1970, which may step.
    """

    n: Count = 0
    t_s: Seconds
    elapsed_s: Elapsed = 0.0
    t_wall: Wall


WORLD_SIZE_M = 50.0  # paper, section IV-A: a simulated forest is 50 x 50 m
WORLD_CORNER = PositionFix(0.0, 51.0, 0.0, None)  # its south-west corner; nothing depends on where on the globe it is


class World(Struct, kw_only=True, omit_defaults=True):
    """The forest of a simulated run, as a line of a forest file."""

    forest: int
    noise: int
    start_m: tuple[float, float]
    heading_deg: float
    goal_y_m: float
    trunk_diameter_m: float
    tree_radius_m: float
    trunks_m: list[tuple[float, float, float, float, str]]
    trees_m: list[Numbers]
    shortest_path_m: float | None = None
    diameters_m: list[float] = []

    @property
    def thick_trunks(self) -> list[tuple[tuple[float, float, float, float, str], float]]:
        """Each trunk with its diameter, metres."""
        diameters_m = self.diameters_m or [self.trunk_diameter_m] * len(self.trunks_m)
        return list(zip(self.trunks_m, diameters_m, strict=False))  # a file may lack some


class Header(Record, kw_only=True, tag="run"):
    """What ran; None if the log does not say."""

    schema: int
    part: Count = 1
    version: str | None = None
    rover: str | None = None
    algorithm: str | None = None
    seed: int | None = None
    algorithm_seed: int | str | None = None
    ladder_seed: int | str | None = None
    config: dict[str, Any] | None = None
    config_hash: str | None = None
    files: dict[str, dict[str, str]] = {}
    parts: dict[str, str] = {}
    calibration: dict[str, Any] | None = None
    simulated: bool | None = None
    dry_run: bool | None = None
    log: str | None = None
    start_delay_s: Seconds | None = None
    boot_id: str | None = None
    world: World | None = None
    trial: Count | None = None
    forest: int | None = None
    noise: int | None = None
    budget_m: Metres | None = None
    mujoco: dict[str, Any] | None = None
    ground: str | None = None
    sim: dict[str, Any] | None = None

    def setting(self, section: str, key: str) -> float | None:
        """Return a number of the rover file, such as ``max_speed_m_s`` of ``vehicle``; None if it is not there."""
        table = (self.config or {}).get(section)
        value = table.get(key) if isinstance(table, dict) else None
        return value if isinstance(value, int | float) and not isinstance(value, bool) else None


# -- what sensors said -------------------------------------------------------------------------------------------------


class Compass(Struct):
    """``hal.CompassReading``."""

    t_s: float | None
    heading_deg: float | None
    pitch_deg: float | None
    roll_deg: float | None
    calibration: int | None = None

    def reading(self) -> CompassReading:
        """Return the reading."""
        pitch_deg, roll_deg = or_nan(self.pitch_deg), or_nan(self.roll_deg)
        return CompassReading(or_nan(self.t_s), or_nan(self.heading_deg), pitch_deg, roll_deg, self.calibration)


class Motion(Struct):
    """``hal.MotionReading``."""

    t_s: float | None
    forward_m: float | None
    right_m: float | None
    quality: float | None
    signed: bool = True

    def reading(self) -> MotionReading:
        """Return the reading."""
        forward_m, right_m = or_nan(self.forward_m), or_nan(self.right_m)
        return MotionReading(or_nan(self.t_s), forward_m, right_m, or_nan(self.quality), self.signed)


class Contact(Struct):
    """``hal.ContactReading``."""

    t_s: float | None
    sides: tuple[str, ...]
    obstacle_bearing_deg: float | None = None

    def reading(self) -> ContactReading:
        """Return the reading.

        Raises:
            ValueError: a side is none of ``hal.Side``.
        """
        return ContactReading(or_nan(self.t_s), tuple(map(Side, self.sides)), self.obstacle_bearing_deg)


class Wheels(Struct):
    """``hal.WheelReading``."""

    t_s: float | None
    left_m: float | None
    right_m: float | None
    left_a: float | None = None
    right_a: float | None = None

    def reading(self) -> WheelReading:
        """Return the reading; a number that was none is not known."""
        return WheelReading(or_nan(self.t_s), self.left_m, self.right_m, self.left_a, self.right_a)


class Manual(Struct):
    """``manual.ManualSample``: what the person wants who drives; ``sent_s`` is what the client says."""

    seq: Count
    forward: Duty
    turn: Duty
    sent_s: float


# -- the kinds ---------------------------------------------------------------------------------------------------------


class Tick(Record, kw_only=True, tag="tick"):
    """One control tick: what sensors said, what the rover knew, what it wanted, and what the motors took.

    ``north_m``, ``east_m`` and ``path_m`` are dead reckoning from where the log begins; the mission's time and way are
    None without a mission. ``memory`` is what the algorithm remembers; a third party's may be anything.
    """

    mode: str = "disarmed"
    held: bool = False
    phase: str
    why: str
    compass: Compass | None = None
    motion: Motion | None = None
    contact: Contact | None = None
    wheels: Wheels | None = None
    manual: Manual | None = None
    decision_t_s: Seconds | None = None
    heading_deg: Angle | None = None
    pitch_deg: Angle | None = None
    roll_deg: Angle | None = None
    anomalies: tuple[str, ...] = ()
    goal_heading_deg: Angle | None = None
    travelled_m: Metres | None = None
    covered_m: Metres | None = None
    north_m: Metres | None = None
    east_m: Metres | None = None
    path_m: Metres = 0.0
    mission_s: Seconds | None = None
    mission_m: Metres | None = None
    wanted_left: float | None
    wanted_right: float | None
    applied_left: Duty | None
    applied_right: Duty | None
    level: str = "well"
    cause: str | None = None
    memory: dict[str, Any] = {}

    @property
    def place(self) -> ReckonedPose | None:
        """Where dead reckoning has the rover; None before the first heading."""
        if self.north_m is None or self.east_m is None or self.heading_deg is None:
            return None
        return ReckonedPose(self.t_s, self.north_m, self.east_m, self.heading_deg)

    @property
    def duty(self) -> float:
        """The larger duty of the two sides, 0 to 1."""
        return max(abs(self.applied_left or 0.0), abs(self.applied_right or 0.0))

    def remembered(self, key: str) -> float | None:
        """Return a number that the algorithm remembers, None if it is none."""
        value = self.memory.get(key)
        return value if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e10 else None


class Event(Record, kw_only=True, tag="event"):
    """Something that happened: its name, a sentence for people, how urgent it is, and its details.

    ``run`` is the name of the run's folder, ``mission`` the number of the mission in this run, 0 before the first.
    """

    name: str
    text: str
    severity: str = "info"
    run: str = ""
    mission: Count = 0
    data: dict[str, Any] = {}

    def number(self, key: str) -> float | None:
        """Return a number of its details, None if it is none."""
        value = self.data.get(key)
        return value if isinstance(value, int | float) and not isinstance(value, bool) else None

    def word(self, key: str) -> str | None:
        """Return a text of its details, None if it is none."""
        value = self.data.get(key)
        return value if isinstance(value, str) else None


class Fix(Record, kw_only=True, tag="position"):
    """A position from the receiver; ``error_m`` is horizontal, and ``utc_s`` its clock; None if they are unknown."""

    latitude_deg: Latitude
    longitude_deg: Longitude
    error_m: Annotated[float, Meta(ge=0.0, le=1e8)] | None = None
    utc_s: Annotated[float, Meta(ge=-1e11, le=1e12)] | None = None  # the calendar's years 1 to 9999


class Board(Record, kw_only=True, tag="board"):
    """What the motor board said of itself; ``says_left`` and ``says_right`` are the duties that it reports."""

    battery_v: float | None = None
    faults: tuple[str, ...] = ()
    says_left: float | None = None
    says_right: float | None = None


class Computer(Record, kw_only=True, tag="computer"):
    """How the computer is; None for what cannot be read."""

    cpu_c: Annotated[float, Meta(ge=-273.0, le=1000.0)] | None = None
    throttled: str | None = None
    load_1min: Annotated[float, Meta(ge=0.0, le=1e6)] | None = None
    disk_free_mb: Annotated[float, Meta(ge=0.0, le=1e12)] | None = None
    disk_read_only: bool | None = None
    disk_memory: str | None = None
    log_dropped: Count | None = None
    log_sync_ms: Annotated[float, Meta(ge=0.0, le=1e9)] | None = None

    @property
    def power_bits(self) -> str:
        """The power and heat bits that are set, hexadecimal; empty if none is."""
        return (self.throttled or "").removeprefix("0x").lstrip("0")


class Truth(Record, kw_only=True, tag="truth"):
    """Where a simulated rover really is, in the metres of its forest; ``driven_m`` is the way so far, both ways."""

    x_m: Metres
    y_m: Metres
    heading_deg: Angle = 0.0
    pitch_deg: Angle = 0.0
    roll_deg: Angle = 0.0
    driven_m: Metres
    slipping: bool = False
    touching: bool = False


class FaultInjected(Record, kw_only=True, tag="fault"):
    """A scenario's fault begins or ends; ``for_s`` is None if it lasts to the end of the run."""

    target: str
    kind: str
    begins: bool
    for_s: Seconds | None = None
    params: dict[str, Any] = {}


class Outcome(Record, kw_only=True, tag="outcome"):
    """The run is over; ``dropped`` records could not be written."""

    reason: str
    text: str
    dropped: Count = 0


AnyRecord = Header | Tick | Event | Fix | Board | Computer | Truth | FaultInjected | Outcome
KINDS = {kind.__struct_config__.tag: kind for kind in AnyRecord.__args__}


def _as_json(value: object) -> object:
    """Return a value of another library: a number as one, anything else by its repr."""
    if isinstance(value, Integral):
        return int(value)
    return float(value) if isinstance(value, Real) else repr(value)


_decoder: msgspec.json.Decoder[Any] = msgspec.json.Decoder(AnyRecord)
_encoder = msgspec.json.Encoder(enc_hook=_as_json)


def encode(record: Record) -> bytes:
    """Return the line of a record, without its end. A third party's algorithm or driver may say anything.

    Raises:
        Exception: a third party's value breaks while it is written.
    """
    try:
        return _encoder.encode(record)
    except UnicodeEncodeError:  # half a character, as in the name of a file that is not UTF-8
        return _encoder.encode(escape_document(msgspec.to_builtins(record, enc_hook=_as_json)))


def decode(line: bytes) -> AnyRecord:
    """Return the record of a line.

    Raises:
        msgspec.ValidationError: it is JSON, but no record: an unknown kind, or a value that cannot be.
        msgspec.DecodeError: it is not JSON.
    """
    record: AnyRecord = _decoder.decode(line)
    return record


def or_nan(value: float | None) -> float:
    """Return a number, NaN for one that is not known."""
    return nan if value is None else value
