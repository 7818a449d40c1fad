"""``wayfarer stop-motors``: stops the motors without the daemon; also systemd's ``ExecStopPost``.

Which motors a daemon drives is in its record (``daemon/socket/driven.py``), and nowhere else: the rover file may have
changed since it began. The motors of the rover file are stopped as well. They may be other ones by now, which nobody
has recorded; a stop is harmless for both. The rover file is used as it is, and one that is broken is refused. If no
board was stopped, the daemons are asked.

Both can name code to import. Root runs it with the rights of the user who wrote it, and only if nobody else can have
written it. Code of a rover file comes last, because it may hang or end this process.
"""

from __future__ import annotations

import json
import os
import pwd
import subprocess
import sys
import tomllib
from pathlib import Path
from stat import S_IMODE
from typing import NamedTuple

from wayfarer.config.rover_path import ROVER_FILE_BYTES, rover_path
from wayfarer.daemon.socket.driven import DrivenBoard, known_records, read_record
from wayfarer.daemon.socket.paths import OTHERS_WRITE
from wayfarer.daemon.stop_board import ask_daemons, stop_board
from wayfarer.errors import BadConfig, BadInput, WayfarerError, kind_and_text, one_line
from wayfarer.files import open_regular

HELPER_TIMEOUT_S = 15.0  # for a process with another user's rights: TimeoutStopSec in the unit
MAX_OUTPUT = 500  # characters of what such a process writes that are shown; chosen by us


class BoardToStop(NamedTuple):
    """A board to stop: where it is written, the user who chose its driver, and whether a daemon recorded it."""

    where: str
    driven: DrivenBoard
    owner: int
    recorded: bool

    @property
    def order(self) -> tuple[bool, bool]:
        """When to stop it, the lowest first; a process of another user may take long."""
        return not self.recorded and self.driven.names_code, not _is_trusted(self.owner)


class StopResult(NamedTuple):
    """The result for one source; exit code 0: stopped, 1: wheels may still turn, 2: the rover file cannot be used."""

    text: str
    exit_code: int


def stop_motors(name_or_path: str) -> str:
    """Stop the wheels that a daemon drives or drove, and those of the rover file; report how certain each stop is.

    Args:
        name_or_path: a shipped rover, or a rover file. If it cannot be used and a daemon has recorded what it
            drives, the record suffices.

    Raises:
        BadInput: nothing was stopped, because neither rover file nor record can be used.
        WayfarerError: a board did not answer, a daemon still commands it, or a record cannot be trusted.
    """
    boards: list[BoardToStop] = []
    unusable: list[StopResult] = []
    for record in known_records():
        try:
            if found := read_record(record):
                _add(boards, BoardToStop(f"the daemon's {record}", *found, recorded=True))
        except BadInput as error:
            unusable.append(StopResult(str(error), 1))  # it may be for another board than that of the rover file
    path = rover_path(name_or_path)
    try:
        driven, file = motors_of(path)
        _add(boards, BoardToStop(str(path), driven, _chosen_by(driven, file), recorded=False))
    except BadInput as error:
        unusable.append(StopResult(f"{path}: {error}", error.exit_code))
    results = [_stopped(board) for board in sorted(boards, key=lambda board: board.order)] + unusable
    text = "; ".join(result.text for result in results)
    codes = {result.exit_code for result in results}
    if not boards or codes == {2}:
        text += f"; {_asked()}"
    if 1 in codes:
        raise WayfarerError(text)
    if 0 not in codes:
        raise BadInput(text)
    return text


def _asked() -> str:
    """Ask the daemons that this user may reach to stop, where no board was stopped; say what came of it.

    A daemon may have begun with a file that was whole then, and its record may be lost, or not be readable.
    """
    agreed = ", ".join(str(place) for place, agrees in ask_daemons().items() if agrees)
    return (
        f"the daemon at {agreed} says that it stops" if agreed else "no stop is certain: switch the motors' power off"
    )


def _add(boards: list[BoardToStop], new: BoardToStop) -> None:
    """Add a board. One that two sources name is kept once, with both names.

    The caller's own rights are used if either source is the caller's own.
    """
    for index, board in enumerate(boards):
        if board.driven == new.driven:
            owner = new.owner if board.owner != os.geteuid() else board.owner
            boards[index] = board._replace(where=f"{board.where} and {new.where}", owner=owner)
            return
    boards.append(new)


# -- the rover file ----------------------------------------------------------------------------------------------------


def motors_of(path: Path) -> tuple[DrivenBoard, os.stat_result]:
    """Return the motors of a rover file, and whose file it is.

    Only ``[parts.motors]`` and ``buses`` are looked at: no mistake elsewhere may prevent a stop.

    Raises:
        BadInput: the file cannot be read.
        BadConfig: it is no TOML, or there are no motors in it.
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
    return DrivenBoard(table, str(rover.get("buses", "linux"))), about


def _chosen_by(driven: DrivenBoard, file: os.stat_result) -> int:
    """Return with which user's rights to stop the board of a rover file.

    A person answers for the file that they name, but root may have been given one that others wrote.

    Raises:
        BadInput: it names code that root must not run, because others can have written it.
    """
    if os.geteuid() != 0 or not driven.names_code:
        return os.geteuid()
    if file.st_mode & OTHERS_WRITE:
        raise BadInput(
            f"rejected: others may write to it (mode {S_IMODE(file.st_mode):04o}), and it names code for root to run:"
            " see what it names and take that right away (chmod go-w), or switch the motors' power off"
        )
    return file.st_uid


# -- stopping ----------------------------------------------------------------------------------------------------------


def _is_trusted(owner: int) -> bool:
    """Return whether code that this user chose may run with the rights of this process."""
    return owner in {0, os.geteuid()}


def _stopped(board: BoardToStop) -> StopResult:
    try:
        text = stop_board(board.driven) if _is_trusted(board.owner) else _stop_as(board.owner, board.driven)
    except WayfarerError as error:
        return StopResult(f"{board.where}: {error}", 1 if board.recorded else error.exit_code)
    return StopResult(f"{board.where}: {text}", 0)


def _stop_as(owner: int, driven: DrivenBoard) -> str:
    """Stop a board in a process of the user who chose its driver: to import that as root would make them root.

    Raises:
        WayfarerError: it was not stopped; in the words of that process, or why there is none.
    """
    try:
        account = pwd.getpwuid(owner)
        done = subprocess.run(
            [sys.executable, "-P", "-m", "wayfarer.daemon.stop_board"],
            input=json.dumps(driven._asdict()),
            user=owner,
            group=account.pw_gid,
            extra_groups=os.getgrouplist(account.pw_name, account.pw_gid),  # those that may open the device files
            start_new_session=True,  # without this terminal, which takes what is typed into it for root's
            cwd="/",
            env=os.environ | {"XDG_RUNTIME_DIR": f"/run/user/{owner}"},  # where that user's daemon listens
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=HELPER_TIMEOUT_S,
            check=False,
        )
    except (OSError, KeyError, subprocess.SubprocessError) as error:
        why = f"no process of user {owner}, whose file this is, could stop them ({kind_and_text(error)})"
        raise WayfarerError(f"nothing may have been stopped: {why}; switch the motors' power off") from None
    # Control characters of another user's program would be commands to root's terminal.
    printed = "".join(each if each.isprintable() else " " for each in done.stdout + done.stderr)
    text = one_line(printed)[-MAX_OUTPUT:]
    if done.returncode != 0:
        raise WayfarerError(text or "nothing may have been stopped; switch the motors' power off")
    return f"{text} (stopped as user {owner}, whose file this is)"
