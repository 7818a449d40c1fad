"""``wayfarer stop-motors``: stops the motors without the daemon; also systemd's ``ExecStopPost``.

Which motors a daemon drives is in its record (``daemon/driven.py``), and nowhere else: the rover file may have
changed since it began. The motors of the rover file are stopped as well. They may be other ones by now, which nobody
has recorded; a stop is harmless for both. The rover file is used as it is, and one that is broken is refused. If a
daemon still runs and would turn the wheels again, it is asked to stop; so it is if no board was stopped.

Both can name code to import and a device to open. Root trusts them only if nobody but root can have written the file.
The code of a rover file comes last, because it may hang or end this process.
"""

from __future__ import annotations

import asyncio
import os
import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import NamedTuple

from wayfarer.config.own_file import whole_name
from wayfarer.config.registry import find_driver, make_buses
from wayfarer.config.rover_path import ROVER_FILE_BYTES, rover_path
from wayfarer.daemon.driven import DrivenBoard, device_of, known_records, other_commander, read_record
from wayfarer.daemon.socket.paths import OTHERS_WRITE
from wayfarer.errors import BadConfig, BadInput, DriverError, NotResponding, WayfarerError, kind_and_text
from wayfarer.files import open_regular
from wayfarer.hal import STOP, DriveMotors

ASK_S = 1.0  # for a daemon's answer
AGAIN_S, AGAIN_EVERY_S = 0.5, 0.05  # a daemon that ends may have commands under way
OF_MOTORS = re.compile(r"/dev/(i2c-|spidev|gpiochip|tty\D)").match  # of terminals none with a number, a screen's
ENDS_S = 3.0  # for a daemon that agrees to give up its lock of the motors: it ends within 2 s
CLOSE_WAIT_S = 2.0  # for a bus that hangs to work again: then the posted stop is sent first


class BoardToStop(NamedTuple):
    """A board to stop: where it is written, whether a daemon recorded it, whether its code may be run."""

    where: str
    driven: DrivenBoard
    recorded: bool
    trusted: bool


def stop_motors(name_or_path: str) -> str:
    """Stop the wheels that a daemon drives or drove, and those of the rover file; report how certain each stop is.

    Args:
        name_or_path: a shipped rover, or a rover file. If it cannot be used and a daemon has recorded what it
            drives, the record suffices.

    Raises:
        BadInput: nothing was stopped, because neither rover file nor record can be used.
        WayfarerError: a board did not answer, a daemon still commands it, or a record cannot be used.
    """
    boards: list[BoardToStop] = []
    results: list[tuple[str, int]] = []  # exit code 0: stopped, 1: wheels may still turn, 2: the file cannot be used
    for record in known_records():
        try:
            if (found := read_record(record)) is not None:
                _add(boards, BoardToStop(f"the daemon's {record}", found[0], True, _is_trusted(*found)))
        except BadInput as error:
            results.append((str(error), 1))  # it may be for another board than that of the rover file
    path = rover_path(name_or_path)
    try:
        named = motors_of(path)
        _add(boards, BoardToStop(str(path), named[0], False, _is_trusted(*named)))
    except BadInput as error:
        results.append((f"{path}: {error}", error.exit_code))
    # What a daemon drives comes first, and code that a rover file names last: it may hang, or end this process.
    boards.sort(key=lambda board: not board.recorded and board.driven.names_code)
    results = [_stopped(board) for board in boards] + results
    text, codes = "; ".join(text for text, _ in results), {code for _, code in results}
    if codes == {2} or not any(board.trusted for board in boards):
        # A daemon may have begun with a file that was whole then, and its record may be lost, or not be readable.
        agreed = ", ".join(str(place) for place, agrees in ask_daemons().items() if agrees)
        says = f"the daemon at {agreed} says that it stops"
        text += f"; {says}" if agreed else "; no stop is certain: switch the motors' power off"
    if codes == {2}:
        raise BadInput(text)
    if 1 in codes:
        raise WayfarerError(text)
    return text


def _add(boards: list[BoardToStop], new: BoardToStop) -> None:
    """Add a board. One that two sources name is kept once, with both names; one of them suffices to trust it."""
    for index, board in enumerate(boards):
        if board.driven == new.driven:
            where, trusted = f"{board.where} and {new.where}", board.trusted or new.trusted
            boards[index] = board._replace(where=where, trusted=trusted)
            return
    boards.append(new)


def _is_trusted(driven: DrivenBoard, file: os.stat_result) -> bool:
    """Return whether what a file names may be used here; a person answers for it, but root may have been given one.

    What another user has written makes root run no code, and open no device but such as motors are on: opening
    ``/dev/watchdog`` resets the computer a minute later.
    """
    if os.geteuid() != 0 or (file.st_uid == 0 and not file.st_mode & OTHERS_WRITE):
        return True
    devices = [driven.motors[key] for key in ("bus", "port") if key in driven.motors]
    return not driven.names_code and all(OF_MOTORS(os.path.realpath(str(device))) for device in devices)


def motors_of(path: Path) -> tuple[DrivenBoard, os.stat_result]:
    """Return the motors of a rover file, and whose file it is.

    Only ``[parts.motors]`` and ``buses`` are looked at: no mistake elsewhere may prevent a stop.

    Raises:
        BadInput: the file cannot be read, or the driver's file is not there.
        BadConfig: it is not TOML, or there are no motors in it.
    """
    try:
        with open_regular(path) as file:  # of the file that is read: another one may be at its path a moment later
            about, content = os.fstat(file.fileno()), file.read(ROVER_FILE_BYTES) or b""
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror}; name one with --rover") from None
    try:
        rover = tomllib.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise BadConfig(f"not valid TOML: {kind_and_text(error)}") from None
    parts = rover.get("parts")
    table = parts.get("motors") if isinstance(parts, dict) else None
    if not isinstance(table, dict) or not isinstance(table.get("driver"), str):
        raise BadConfig("no [parts.motors] with a driver: this rover has no wheels to stop")
    table["driver"] = whole_name("driver", table["driver"], path.parent)  # as the daemon records it
    return DrivenBoard(table, str(rover.get("buses", "linux"))), about


# -- one board -------------------------------------------------------------------------------------------------------


def _stopped(board: BoardToStop) -> tuple[str, int]:
    """Stop a board, and return the result as a text and an exit code."""
    try:
        if not board.trusted:
            raise BadInput(
                "rejected: it names code, or a device that no motors are on, and another user can have written it: stop"
                " as that user (sudo -u), take the right to write it from the others (chown root, chmod go-w), or"
                " switch the motors' power off"
            )
        return f"{board.where}: {asyncio.run(_stop(board.driven))}", 0
    except WayfarerError as error:
        why, code = str(error), error.exit_code
    # A daemon has checked the settings that it recorded. Those of a rover file are used unchecked, because a stop must
    # not wait for pydantic to load, and the driver raises what is wrong. A third party's driver may raise anything.
    except Exception as error:
        text = "[parts.motors] cannot be used, nothing may have been stopped"
        why = f"{text}: {kind_and_text(error)}; switch the motors' power off, see wayfarer check"
        code = BadConfig.exit_code
    return f"{board.where}: {why}", 1 if board.recorded else code


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
        agreed = ask_daemons()
        other = other_commander(device := device_of(buses_name, settings))
        for count in range(round(ENDS_S / AGAIN_EVERY_S) if agreed or other else 0):
            if count * AGAIN_EVERY_S >= AGAIN_S and not (other and any(agreed.values())):
                break
            await asyncio.sleep(AGAIN_EVERY_S)
            await motors.stop()
            other = other_commander(device)  # it may be another one than that which agreed
        refusing = next((f"a wayfarer daemon at {place}" for place, agrees in agreed.items() if not agrees), None)
        if refusing or other:
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
            try:  # the reason why it could not: stop() never raises
                await motors.open()
            except DriverError as why:
                raise WayfarerError(f"no stop could be sent, switch the motors' power off: {why}") from None
        turning = await motors.read_back()
    except DriverError as error:
        raise WayfarerError(f"no stop was acknowledged: {error}; switch the motors' power off") from None
    if turning is None:
        return f"stop was sent to {motors.name}, which cannot confirm it"
    if turning != STOP:
        raise WayfarerError(f"{motors.name} was commanded to stop and still says {turning}: switch its power off")
    return f"{motors.name} says that the wheels are stopped"


def ask_daemons() -> dict[Path, bool]:
    """Ask every daemon that this user may reach to stop; return for each socket whether the daemon agreed.

    Not only the daemon of the record: one whose record was rejected may drive this board as well.
    """
    from wayfarer.daemon.socket.client import NoDaemon, ask
    from wayfarer.daemon.socket.paths import known_sockets

    agreed: dict[Path, bool] = {}
    for place in known_sockets():
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
