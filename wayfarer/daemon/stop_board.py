"""Stops one motor board, given its table of settings.

If a daemon still runs and would turn the wheels again, it is asked to stop. As a program (``python -m
wayfarer.daemon.stop_board``) this module takes the board as JSON: ``stop_motors`` starts it with the rights of another
user.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from dataclasses import fields
from pathlib import Path

from wayfarer.config.registry import find_driver, make_buses
from wayfarer.daemon.motors_lock import device_of, other_commander
from wayfarer.daemon.socket.driven import DrivenBoard
from wayfarer.errors import BadConfig, BadInput, DriverError, NotResponding, WayfarerError, kind_and_text
from wayfarer.hal import STOP, DriveMotors

ASK_S = 1.0  # for a daemon's answer
AGAIN_S, AGAIN_EVERY_S = 0.5, 0.05  # a daemon that ends may have commands under way
CLOSE_WAIT_S = 2.0  # for a bus that hangs to work again: then the posted stop is sent first


def stop_board(driven: DrivenBoard) -> str:
    """Stop the wheels of a board and return a sentence that says how far that is certain.

    Raises:
        BadInput: the motors' table cannot be used.
        WayfarerError: the board did not answer, or a daemon still commands it.
    """
    try:
        return asyncio.run(_stop(driven))
    except WayfarerError:
        raise
    # A daemon has checked the settings that it recorded. Those of a rover file are used unchecked, because a stop must
    # not wait for pydantic to load, and the driver raises what is wrong. A third party's driver may raise anything.
    except Exception as error:
        raise BadConfig(
            f"[parts.motors] cannot be used, nothing may have been stopped: {kind_and_text(error)}; switch the motors'"
            " power off, see wayfarer check"
        ) from None


async def _stop(driven: DrivenBoard) -> str:
    """Stop the wheels first; then see whether a daemon would turn them again; then ask the board."""
    table, buses_name = driven
    driver = find_driver(table["driver"])
    if getattr(driver, "part", None) != "motors":
        raise BadConfig(f"driver '{table['driver']}' in [parts.motors] drives no motors")
    known = {field.name for field in fields(driver.Settings)}
    settings = driver.Settings(**{key: value for key, value in table.items() if key in known})
    buses = make_buses(buses_name)
    motors: DriveMotors = driver(settings, buses)
    try:
        await motors.stop()
        agreed = await asyncio.to_thread(ask_daemons)
        other = other_commander(device_of(buses_name, settings))
        if agreed or other:
            for _ in range(round(AGAIN_S / AGAIN_EVERY_S)):
                await asyncio.sleep(AGAIN_EVERY_S)
                await motors.stop()
        refusing = next((f"a wayfarer daemon at {place}" for place, agrees in agreed.items() if not agrees), None)
        if refusing or (other and not agreed):
            raise WayfarerError(
                f"stop was sent, but {other or refusing} still commands these wheels: end it with 'wayfarer stop' or"
                " 'systemctl stop wayfarer', or switch the motors' power off"
            )
        return await _confirmed(motors)
    finally:
        await motors.close()
        await buses.close(CLOSE_WAIT_S)


async def _confirmed(motors: DriveMotors) -> str:
    """Return a sentence with the board's report about its wheels."""
    try:
        try:
            await motors.drive(STOP)  # unlike stop(), it says whether the board was there
        except NotResponding as error:
            if not str(error).endswith("not open"):
                raise
            await _why_not_open(motors)
        turning = await motors.read_back()
    except DriverError as error:
        raise WayfarerError(f"no stop was acknowledged: {error}; switch the motors' power off") from None
    if turning is None:
        return f"stop was sent to {motors.name}, which cannot confirm it"
    if turning != STOP:
        raise WayfarerError(f"{motors.name} was commanded to stop and still says {turning}: switch its power off")
    return f"{motors.name} says that the wheels are stopped"


async def _why_not_open(motors: DriveMotors) -> None:
    """Open the motors, to get the reason why ``stop`` could not: ``stop`` never raises."""
    try:
        await motors.open()
    except DriverError as error:
        raise WayfarerError(f"no stop could be sent, switch the motors' power off: {error}") from None


def ask_daemons() -> dict[Path, bool]:
    """Ask every daemon that this user may reach to stop; return for each socket whether the daemon agreed.

    Not only the daemon of the record: one whose record was rejected may drive this board as well.
    """
    from wayfarer.daemon.socket.client import NoDaemon, ask
    from wayfarer.daemon.socket.paths import known_sockets

    agreed: dict[Path, bool] = {}
    for place in dict.fromkeys(known_sockets()):
        if not os.access(place, os.W_OK):
            continue  # another user's daemon cannot be asked; the lock of the motors shows whether it drives them
        try:
            ask({"do": "stop"}, place, ASK_S)
        except (NoDaemon, BadInput):
            continue
        except WayfarerError:
            agreed[place] = False
        else:
            agreed[place] = True
    return agreed


def main() -> None:
    """Stop the board that is given as JSON on stdin; print the result, and exit with its exit code."""
    try:
        print(stop_board(DrivenBoard(**json.load(sys.stdin))))
    except WayfarerError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
