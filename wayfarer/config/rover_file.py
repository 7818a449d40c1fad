"""Rover files: the complete description of one rover in TOML, validated before anything moves.

A file gives the body, and what differs from the defaults in the code: rates, manoeuvres, thresholds,
each with its unit in the key's name. Unknown keys are refused by name, values outside their range with the range. The
shipped files are in ``wayfarer/rovers``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from posixpath import normpath
from typing import Annotated, Any, Self

from annotated_types import Interval
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from wayfarer.config.messages import located, shown, validated
from wayfarer.config.own_file import forget_changed, names_file, whole_name
from wayfarer.config.registry import check_buses, driver_names, find_driver
from wayfarer.config.rover_path import ROVER_FILE_BYTES, SHIPPED, is_rover_file, own_folder, rover_path
from wayfarer.config.settings import Chassis, MavlinkSettings
from wayfarer.detector import DetectorSettings
from wayfarer.detector.witnesses import WITNESSES
from wayfarer.errors import BadConfig, BadInput, UnknownName, one_line
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.files import read_regular
from wayfarer.safety.gate import STALL_LIMIT_S
from wayfarer.safety.settings import BoardSettings, EntrapmentSettings, ManualSettings, SafetySettings
from wayfarer.setting_ranges import Hertz, SignedDegrees

# The schema is built when a file is read: a worker of a campaign gets its rover read already.
_STRICT = ConfigDict(extra="forbid", frozen=True, defer_build=True)
_STALL_MARGIN = 1.5  # the stall guard waits for so many control periods at least
_COMMANDS_PER_DEADMAN = 2  # one command may be lost or late, and a healthy rover drives on
_TEXT_MAX = 255  # bytes of a text, as Linux allows in a file's name (NAME_MAX)
SOURCES = rf"^({'|'.join(WITNESSES)})(\+({'|'.join(WITNESSES)}))*$"
_TEXT = "utf-8-sig"  # some editors begin a file with a byte order mark


@dataclass(frozen=True, slots=True)
class LogSettings:
    """Limits of the logs, in MB (1,000,000 bytes). At 20 Hz a run writes 14 kB per second: 50 MB per hour."""

    part_mb: Annotated[float, Interval(ge=1, le=2000)] = 50.0
    """Size of one file of a log: an hour, small enough for an editor and for a phone's connection, and far below the
    4 GB that a file may have on FAT. A rover is armed only if one fits beside ``free_mb``."""
    run_mb: Annotated[float, Interval(ge=10, le=500_000)] = 1000.0
    """A longer run, which is most of a day and should be several parts, loses its oldest parts, but never the first,
    which says how it began: a daemon that stays disarmed for weeks must not fill the card."""
    free_mb: Annotated[float, Interval(ge=0, le=50_000)] = 100.0
    """With less left on the disk only events are written: the computer needs that to boot and to let a person log
    in."""
    keep_mb: Annotated[float, Interval(ge=10, le=100_000_000)] | None = None
    """The daemon deletes the oldest runs while all together take more; without it none. The newest stays, and each run
    with a file ``keep``, which ``wayfarer mark`` makes."""


# One file, on any disk: the same simulated trial writes the same bytes everywhere.
UNLIMITED = LogSettings(part_mb=inf, run_mb=inf, free_mb=0.0)


class Rates(BaseModel):
    """How often each sensor is read."""

    model_config = _STRICT

    compass_hz: Hertz = 20.0
    """Readings of the compass per second."""
    motion_hz: Hertz = 20.0
    """Readings of the motion sensor per second."""
    contact_hz: Hertz = 20.0
    """Readings of the bumper per second."""
    wheels_hz: Hertz = 20.0
    """Readings of the wheels' encoders and currents per second."""
    position_hz: Hertz = 1.0
    """Readings of the receiver per second."""


class RoverConfig(BaseModel):
    """One rover, as its file describes it."""

    model_config = _STRICT

    name: str = Field(min_length=1, max_length=40)
    """What this rover is called in logs and reports."""
    control_hz: Hertz = 20.0
    """Control ticks per second."""
    anomaly_source: Annotated[str, Field(max_length=_TEXT_MAX, json_schema_extra={"pattern": SOURCES})] = "motion"
    """Who notices that the rover is stuck: one or more of `motion`, `contact`, `wheels`, `current` and `yaw`, joined by
    `+`, such as `wheels+current`. `contact` goes with the motion sensor, if there is one. Without `motion` nothing sees
    wheels that spin."""
    vehicle: Vehicle
    chassis: Chassis = Chassis()
    rates: Rates = Rates()
    escape: EscapeSettings = EscapeSettings()
    detector: DetectorSettings = DetectorSettings()
    safety: SafetySettings = SafetySettings()
    manual: ManualSettings = ManualSettings()
    progress: EntrapmentSettings = EntrapmentSettings()
    board: BoardSettings = BoardSettings()
    log: LogSettings = LogSettings()
    mavlink: MavlinkSettings = MavlinkSettings()
    declination_deg: SignedDegrees | None = None
    """How far magnetic north lies east of true north where the rover drives, in degrees; without it bearings are
    magnetic only. For ``--north true``."""
    buses: str = Field(default="linux", max_length=_TEXT_MAX)
    """Who hands out the buses that the parts sit on: ``linux`` for the device files of a Linux board, or
    ``module:attribute``."""
    parts: dict[str, dict[str, Any]] = {}
    """A driver and its settings for each part; a rover without parts can only be simulated."""

    @property
    def sources(self) -> frozenset[str]:
        """The names in ``anomaly_source``."""
        return frozenset(self.anomaly_source.split("+"))

    @property
    def uses_motion(self) -> bool:
        """Whether a motion sensor is read, if there is one."""
        return not self.sources.isdisjoint({"motion", "contact"})

    @field_validator("anomaly_source")
    @classmethod
    def _sources_are_witnesses(cls, source: str) -> str:
        """Refuse what is not a list of witnesses."""
        names = source.split("+")
        if len(set(names)) < len(names) or not WITNESSES.keys() >= set(names):
            allowed = ", ".join(map(repr, WITNESSES))
            raise ValueError(f"input should be one or more of {allowed}, each once, joined by '+'")
        return source

    @model_validator(mode="after")
    def _current_is_measured_against_something(self) -> Self:
        if "current" in self.sources and self.detector.stall_current_a is None:
            raise ValueError(
                f"key 'anomaly_source' = '{self.anomaly_source}': 'current' needs detector.stall_current_a, what the "
                "motors of one side draw that are held at full duty; their data sheet has it for one motor"
            )
        return self

    @model_validator(mode="after")
    def _rates_meet_their_deadlines(self) -> Self:
        """Refuse a rover that would always hold its wheels: a period is longer than what counts as late."""
        periods = {
            "control_hz": (self.control_hz, "safety.tick_late_s", self.safety.tick_late_s),
            "rates.compass_hz": (self.rates.compass_hz, "detector.compass_stale_s", self.detector.compass_stale_s),
            "rates.motion_hz": (self.rates.motion_hz, "detector.motion_stale_s", self.detector.motion_stale_s),
            "rates.contact_hz": (self.rates.contact_hz, "detector.contact_stale_s", self.detector.contact_stale_s),
            "rates.wheels_hz": (self.rates.wheels_hz, "detector.wheels_stale_s", self.detector.wheels_stale_s),
        }
        for key, (rate_hz, limit, limit_s) in periods.items():
            if 1.0 / rate_hz >= limit_s:
                raise ValueError(
                    f"key '{key}' = {rate_hz:g}: too slow, {limit} = {limit_s:g} s is over before the next"
                )
        return self

    @model_validator(mode="after")
    def _no_speed_is_above_the_top_speed(self) -> Self:
        """Refuse a speed that the rover cannot have: most are in km/h, which the range of values cannot show."""
        usual, top_m_s = EscapeSettings(), self.vehicle.max_speed_m_s
        speeds = {
            "escape.cruise_m_s": (self.escape.cruise_m_s, usual.cruise_m_s),
            "escape.reverse_m_s": (self.escape.reverse_m_s, usual.reverse_m_s),
            "manual.speed_m_s": (self.manual.speed_m_s or 0.0, 0.0),
        }
        for key, (speed_m_s, default_m_s) in speeds.items():
            if top_m_s < speed_m_s != default_m_s:
                raise ValueError(
                    f"key '{key}' = {speed_m_s:g}: vehicle.max_speed_m_s is {top_m_s:g} metres per second; if it is in "
                    f"km/h, write {speed_m_s / 3.6:.3g}"
                )
        return self

    @model_validator(mode="after")
    def _wheels_are_commanded_in_time(self) -> Self:
        """Refuse a control rate at which a healthy rover's wheels would be stopped, or a stop would reach them late."""
        settings = part_settings("motors", self.parts["motors"])[1] if "motors" in self.parts else None
        least_hz = {"the stall guard stops the wheels": _STALL_MARGIN / STALL_LIMIT_S}
        if deadman_s := getattr(settings, "deadman_s", None):
            commands = getattr(settings, "commands_per_deadman", _COMMANDS_PER_DEADMAN)
            least_hz[f"the board's own deadman of {deadman_s:g} s stops the wheels"] = commands / deadman_s
        for what, rate_hz in least_hz.items():
            if self.control_hz < rate_hz:
                raise ValueError(f"key 'control_hz' = {self.control_hz:g}: too slow, {what} below {rate_hz:.3g}")
        keeps_up_with = getattr(settings, "keeps_up_with", None)
        if keeps_up_with and (why := keeps_up_with(self.control_hz)):
            raise ValueError(f"key 'control_hz' = {self.control_hz:g}: too fast for parts.motors.{why}")
        return self

    @field_validator("parts")
    @classmethod
    def _parts_have_their_drivers(cls, parts: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """Refuse a part whose driver is unknown or does not understand its settings, and two chips at one place."""
        parts = _with_whole_names(parts)
        # By serial port, or bus and address; drivers of one chip, such as a board's light, share it.
        there: dict[tuple[str, int | None], tuple[str, object, object]] = {}
        for part, table in parts.items():
            driver, settings = part_settings(part, table)
            port, address = getattr(settings, "port", None), getattr(settings, "address", None)
            bus = port if port and isinstance(port, str) else str(getattr(settings, "bus", ""))
            if bus == port:
                address = None
            elif address is None:
                continue
            chip, baud = getattr(driver, "chip", driver), getattr(settings, "baud", None)
            other, of, its_baud = there.setdefault((normpath(bus), address), (part, chip, baud))
            if of != chip and address is None:
                raise ValueError(
                    f"key 'parts.{part}.port' = '{bus}': parts.{other} is on this port already; correct one of them"
                )
            if baud != its_baud and of == chip:
                raise ValueError(f"key 'parts.{part}.baud' = {baud}: parts.{other} has {its_baud} on the same port")
            if of != chip:
                raise ValueError(
                    f"key 'parts.{part}.address' = 0x{address:02X}: parts.{other} has this address on {bus} already; "
                    "correct the one that is wrong (i2cdetect shows which addresses answer), or set another on the chip"
                )
        return parts

    @field_validator("buses")
    @classmethod
    def _buses_have_a_known_name(cls, buses: str) -> str:
        """Refuse a name that stands for no buses; what ``"module:attribute"`` gives is seen when they are made."""
        try:
            check_buses(buses)
        except BadInput as error:
            raise ValueError(f"key 'buses': {error}") from None
        return buses

    def with_anomaly_source(self, source: str) -> Self:
        """Return the same rover, noticing obstacles by other sensors, as ``anomaly_source`` names them."""
        return self.model_copy(update={"anomaly_source": source})


def _with_whole_names(parts: Mapping[str, Any], folder: Path | None = None) -> dict[str, Any]:
    """Return the tables of parts, in which a driver's file has its whole path: a worker may be in another folder."""
    found = dict(parts)
    for part, table in parts.items():
        if isinstance(table, dict) and isinstance(name := table.get("driver"), str):
            try:
                found[part] = table | {"driver": whole_name("driver", name, folder)}
            except BadInput as error:
                raise BadConfig(f"key 'parts.{part}.driver': {error}") from None
    return found


def part_settings(part: str, table: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return the driver class of a part and its settings, from the part's table in a rover file.

    Raises:
        ValueError: the text names the key and what is allowed.
    """
    key = f"parts.{part}"
    settings = dict(table)
    for setting, value in settings.items():
        path = setting == "driver" and isinstance(value, str) and names_file(value)
        if isinstance(value, str) and len(value.encode()) > _TEXT_MAX and not path:
            raise ValueError(
                f"key '{key}.{setting}' = {shown(value)}: {len(value.encode())} bytes; allowed are at most {_TEXT_MAX}"
            )
        if isinstance(value, str) and "\0" in value:
            raise ValueError(f"key '{key}.{setting}' = {shown(value)}: a NUL byte, which no name can have")
    name = settings.pop("driver", None)
    if not isinstance(name, str):
        found = "is missing" if name is None else f"= {shown(name)}: input should be a text"
        raise ValueError(f"key '{key}.driver' {found}; allowed are: {', '.join(driver_names())}")
    try:
        driver = find_driver(name)
    except BadInput as error:
        raise ValueError(f"key '{key}.driver': {error}") from None
    if (other := getattr(driver, "part", None)) != part:
        raise ValueError(
            f"key '{key}.driver': '{name}' is not a driver for {part}" + (f", but for {other}" if other else "")
        )
    try:
        return driver, validated(driver.Settings, settings, f"{key}.")
    except BadConfig as error:
        raise ValueError(str(error)) from None


def rover_names() -> list[str]:
    """Return the names of the shipped rovers."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def load_rover(name_or_path: str) -> RoverConfig:
    """Return a shipped rover by name, or one from a TOML file (anything with a slash or ending in ``.toml``).

    Raises:
        UnknownName: no shipped rover of that name.
        BadConfig: the file cannot be read or is not right; the text names file, key and what is allowed.

    >>> rover = load_rover("forestrover")
    >>> rover.vehicle.max_speed_m_s > 1.0, rover.parts["compass"]["driver"]
    (True, 'cmps14')
    """
    return parse_rover(name_or_path, rover_text(name_or_path))


def rover_text(name_or_path: str) -> str:
    """Return the text of a rover file.

    Raises:
        UnknownName: no shipped rover of that name.
        BadConfig: the file cannot be read; the text names it and says why.
    """
    if not is_rover_file(name_or_path) and name_or_path not in rover_names():
        raise UnknownName("rover", name_or_path, rover_names())
    try:
        return read_regular(rover_path(name_or_path), ROVER_FILE_BYTES).decode(_TEXT)
    except FileNotFoundError:
        raise BadConfig(f"{name_or_path}: no such file; shipped rovers are {', '.join(rover_names())}") from None
    except OSError as error:
        raise BadConfig(f"{name_or_path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # no UTF-8, or a name that no file can have
        raise BadConfig(one_line(f"{name_or_path}: cannot be read: {error}")) from None


def parse_rover(name_or_path: str, text: str) -> RoverConfig:
    """Return the rover that a text describes; the name is for errors.

    Raises:
        BadConfig: the text is not right; the error names key and what is allowed.
    """
    where = name_or_path if is_rover_file(name_or_path) else f"{name_or_path}.toml"
    forget_changed()
    try:
        # The end of line lets the parser name the line of an error that is at the very end.
        table = tomllib.loads(text + "\n")
        if isinstance(parts := table.get("parts"), dict):
            table["parts"] = _with_whole_names(parts, own_folder(name_or_path))
        return validated(RoverConfig, table)
    except BadConfig as error:
        raise BadConfig(located(where, str(error))) from None
    except (ValueError, RecursionError) as error:  # tomllib: syntax, endless numbers, brackets without end
        raise BadConfig(one_line(f"{where}: not valid TOML: {error}")) from None


def laid_over(config: RoverConfig, settings: Mapping[str, Any], prefix: str = "") -> RoverConfig:
    """Return a rover with some settings changed, as validated as a rover file; an error puts ``prefix`` before a key.

    Raises:
        BadConfig: the text names the key and what is allowed.
    """
    return validated(RoverConfig, _merged(config.model_dump(mode="json"), settings), prefix)


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return two tables as one, where the upper one counts; tables within them are merged too.

    A part that gets another driver begins with that driver's own defaults: what was set for the old one means something
    else to it, or nothing.
    """
    if above.get("driver", below.get("driver")) != below.get("driver"):
        return dict(above)
    merged = dict(below)
    for key, value in above.items():
        under = merged.get(key)
        merged[key] = _merged(under, value) if isinstance(under, Mapping) and isinstance(value, Mapping) else value
    return merged


def flat(value: Any, name: str = "") -> dict[str, Any]:
    """Return tables within tables by their dotted names, as ``detector.tilt_deg``."""
    if not isinstance(value, dict):
        return {name: value}
    return {key: leaf for k, v in value.items() for key, leaf in flat(v, f"{name}.{k}" if name else k).items()}
