"""The calibration file of one rover, as JSON: results of calibration and checks.

::

    {"schema": 1, "compass": {...}, "flow": {...}, "motors": {...}, "deadman": {...}}

Each entry says when it was made and with which part: numbers of another part are worse than none. The file is replaced
as a whole, so a power cut leaves the old one or the new one.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import msgspec
from annotated_types import Interval
from pydantic import ConfigDict, TypeAdapter, ValidationError

from wayfarer.config.messages import key_and_problem
from wayfarer.config.rover_path import STATE_FOLDER
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.files import read_regular, write_atomically
from wayfarer.setting_ranges import DegreesOrZero

FILE_NAME = "calibration.json"
CALIBRATION_BYTES = 65_536  # chosen by us: a hundred times what there is to say
USER_FOLDER = Path(".local/state/wayfarer")

# Half a year: field, screws and cables of a rover change within a season.
STALE_S = 180 * 86_400.0

SCALE_MIN, SCALE_MAX = 0.1, 10.0  # of the motion sensor's metres
_STRICT = ConfigDict(extra="forbid", strict=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """When something was calibrated, and with which part (its driver's ``name``).

    ``t_wall`` is in seconds since 1970; ``date`` says the same (UTC) to a person who opens the file.
    """

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    t_wall: Annotated[float, Interval(ge=0, le=1e11)]
    date: str
    part: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CompassEntry(Entry):
    """``level`` is the part's own, 0 to 3; ``residual_deg`` the mean error of four quarter turns."""

    level: Annotated[int, Interval(ge=0, le=3)]
    residual_deg: DegreesOrZero


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowEntry(Entry):
    """``scale`` is what the metres of the motion sensor must be multiplied by."""

    scale: Annotated[float, Interval(ge=SCALE_MIN, le=SCALE_MAX)]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorsEntry(Entry):
    """How far the heading shifts while the wheels turn at half and at full duty, and whether that is little enough."""

    shift_half_deg: DegreesOrZero
    shift_full_deg: DegreesOrZero
    passed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadmanEntry(Entry):
    """A person has seen the motor board stop the wheels by itself, with these settings of the rover file."""

    settings: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Everything in the file; None is what was never calibrated."""

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    schema: Literal[1] = 1
    compass: CompassEntry | None = None
    flow: FlowEntry | None = None
    motors: MotorsEntry | None = None
    deadman: DeadmanEntry | None = None


def stamp(part: str, t_wall: float) -> dict[str, Any]:
    """Return the fields that all entries share."""
    return {"part": part, "t_wall": round(t_wall, 3), "date": datetime.fromtimestamp(t_wall, UTC).date().isoformat()}


def calibration_file(environment: Mapping[str, str], home: Path, system: Path = STATE_FOLDER) -> Path:
    """Return where the file is.

    In systemd's ``STATE_DIRECTORY`` if it is set, else in ``/var/lib/wayfarer`` if that may be written, else in a
    folder of the user's own.
    """
    if given := environment.get("STATE_DIRECTORY", "").partition(":")[0]:
        return Path(given) / FILE_NAME
    folder = system if os.access(system, os.W_OK) else home / USER_FOLDER
    return folder / FILE_NAME


def load(path: Path) -> Calibration:
    """Return what is in the file; an empty calibration if there is none.

    Raises:
        BadInput: the file cannot be read or is not right; the text names it and the reason.
    """
    try:
        return _adapter().validate_json(read_regular(path, CALIBRATION_BYTES))
    except FileNotFoundError:
        return Calibration()
    except ValidationError as error:
        wrong = f"{path}: not a calibration: {key_and_problem(error)}"
        raise BadInput(f"{wrong}; move it away, and calibrate again (wayfarer calibrate, wayfarer check)") from None
    except OSError as error:
        raise BadInput(f"{path}: the calibration cannot be read: {error.strerror}") from None


@cache
def _adapter() -> TypeAdapter[Calibration]:
    """Return what checks a file; building it takes longer than checking, and arming waits on the event loop."""
    return TypeAdapter(Calibration)


def save(path: Path, calibration: Calibration) -> None:
    """Replace the file at once, and be sure that it is on the disk.

    Raises:
        WayfarerError: it cannot be written.
    """
    content = msgspec.json.format(msgspec.json.encode(calibration), indent=2) + b"\n"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, content)
    except OSError as error:
        raise WayfarerError(
            f"{path}: the calibration cannot be written: {error.strerror}; check the folder's owner and the disk"
        ) from None
