"""Stopping the wheels without the daemon: what is left when it has died, and the last line of its systemd unit.

Only the motors' own table of the rover file is read, and not checked further than its driver needs: a mistake
elsewhere in the file must not keep the wheels turning.
"""

from __future__ import annotations

import asyncio
import tomllib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from wayfarer.errors import BadConfig, BadInput, DriverError, WayfarerError
from wayfarer.hal import STOP, DriveMotors
from wayfarer.registry import find_driver, make_buses

SHIPPED = Path(__file__).parent / "rovers"


def stop_motors(name_or_path: str) -> str:
    """Stop the wheels of a rover and return a sentence that says how far that is certain.

    Raises:
        BadInput: the rover file, or its motors' table, cannot be used.
        WayfarerError: the board did not answer.
    """
    rover = _read(name_or_path)
    parts = rover.get("parts")
    table = parts.get("motors") if isinstance(parts, dict) else None
    if not isinstance(table, dict) or not isinstance(table.get("driver"), str):
        raise BadConfig(f"{name_or_path}: no [parts.motors] with a driver: this rover has no wheels to stop")
    driver = find_driver(table["driver"])
    if getattr(driver, "part", None) != "motors":
        raise BadConfig(f"{name_or_path}: driver '{table['driver']}' in [parts.motors] drives no motors")
    return asyncio.run(_stop(driver, _settings(name_or_path, driver, table), str(rover.get("buses", "linux"))))


def _settings(where: str, driver: Any, table: Mapping[str, Any]) -> Any:
    """Return a driver's settings; a mistyped key is left out, for it must not keep the wheels turning."""
    known = {field.name for field in fields(driver.Settings)}
    try:
        return driver.Settings(**{key: value for key, value in table.items() if key in known})
    except (TypeError, ValueError) as error:
        raise BadConfig(f"{where}: [parts.motors]: {error}") from None


async def _stop(driver: Any, settings: Any, buses_name: str) -> str:
    buses = make_buses(buses_name)
    try:
        motors: DriveMotors = driver(settings, buses)
    except (TypeError, ValueError, AttributeError) as error:  # a value of the wrong kind, which nobody has checked
        raise BadConfig(f"[parts.motors] cannot be used: {error}") from None
    try:
        await motors.stop()
        await motors.drive(STOP)  # unlike stop(), it says whether the board was there
        turning = await motors.read_back()
    except DriverError as error:
        raise WayfarerError(f"stop was sent, but not acknowledged: {error}; switch the motors' power off") from None
    finally:
        await motors.close()
        await buses.close()
    if turning is None:
        return f"stop was sent to {motors.name}, which cannot confirm it"
    if turning != STOP:
        raise WayfarerError(f"{motors.name} was told to stop and still says {turning}: switch its power off")
    return f"{motors.name} says that the wheels stand still"


def _read(name_or_path: str) -> dict[str, Any]:
    is_file = "/" in name_or_path or name_or_path.endswith(".toml")
    path = Path(name_or_path) if is_file else SHIPPED / f"{name_or_path}.toml"
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise BadConfig(f"{path}: not valid TOML: {error}") from None
