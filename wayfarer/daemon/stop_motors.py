"""``wayfarer stop-motors``: stops the motors without the daemon; also systemd's ``ExecStopPost``.

It stops the motors that a daemon drives or drove, as recorded beside its socket (``daemon/socket/driven.py``), and
those of the rover file, which may be different ones by now. A stop is harmless for both.

Both can name code to import. Root runs it with the rights of the user who wrote it, and only if nobody else can have
written it. Code of a rover file comes last, because it may hang or end this process.
"""

from __future__ import annotations

import json
import os
import pwd
import subprocess
import sys
from collections.abc import Iterator
from stat import S_IMODE
from typing import NamedTuple

from wayfarer.config.rover_path import rover_path
from wayfarer.daemon.salvage import NamedBoard, motors_of
from wayfarer.daemon.socket.driven import DrivenBoard, known_records, read_record
from wayfarer.daemon.socket.paths import OTHERS_WRITE
from wayfarer.daemon.stop_board import stop_board
from wayfarer.errors import BadInput, WayfarerError, kind_and_text, one_line

RIGHTS_S = 15.0  # for a stop with another user's rights: TimeoutStopSec in the unit
MOST_SAID = 500  # characters of what another user's code has to say


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

    said: str
    exit_code: int


def stop_motors(name_or_path: str) -> str:
    """Stop the wheels that a daemon drives or drove, and those of the rover file; report how certain each stop is.

    Args:
        name_or_path: a shipped rover, or a rover file. Where it cannot be used and a daemon has recorded what it
            drives, the record suffices.

    Raises:
        BadInput: nothing was stopped, because neither rover file nor record can be used.
        WayfarerError: a board did not answer, or a daemon still commands it.
    """
    boards: list[BoardToStop] = []
    unusable: list[StopResult] = []
    for found in _sources(name_or_path):
        if isinstance(found, StopResult):
            unusable.append(found)
        else:
            _add(boards, found)
    stopped = [_stopped(board) for board in sorted(boards, key=lambda board: board.order)]
    said = "; ".join(result.said for result in stopped + unusable)
    codes = {result.exit_code for result in stopped}
    if 1 in codes | {result.exit_code for result in unusable}:
        raise WayfarerError(said)
    if 0 not in codes:
        raise BadInput(said)
    return said


# -- where boards are written ------------------------------------------------------------------------------------------


def _sources(name_or_path: str) -> Iterator[BoardToStop | StopResult]:
    """Give the boards of daemons, then that of the rover file; for a source that cannot be used, give a result."""
    for record in known_records():
        try:
            found = read_record(record)
        except BadInput as error:
            yield StopResult(str(error), 1)  # it may be for another board than that of the rover file
        else:
            if found is not None:
                yield BoardToStop(f"the daemon's {record}", *found, recorded=True)
    path = rover_path(name_or_path)
    try:
        named = motors_of(path)
        yield BoardToStop(str(path), named.driven, _chosen_by(named), recorded=False)
    except BadInput as error:
        yield StopResult(f"{path}: {error}", error.exit_code)


def _chosen_by(named: NamedBoard) -> int:
    """Return with which user's rights to stop the board of a rover file.

    A person answers for the file that they name, but root may have been given one that others wrote.

    Raises:
        BadInput: it names code that root must not run, because others can have written it.
    """
    if os.geteuid() != 0 or not named.driven.names_code:
        return os.geteuid()
    if named.file.st_mode & OTHERS_WRITE:
        raise BadInput(
            f"rejected: others may write to it (mode {S_IMODE(named.file.st_mode):04o}), and it names code for root to"
            " run: see what it names and take that right away (chmod go-w), or switch the motors' power off"
        )
    return named.file.st_uid


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


# -- stopping ----------------------------------------------------------------------------------------------------------


def _is_trusted(owner: int) -> bool:
    """Return whether code that this user chose may run with the rights of this process."""
    return owner in {0, os.geteuid()}


def _stopped(board: BoardToStop) -> StopResult:
    try:
        said = stop_board(board.driven) if _is_trusted(board.owner) else _stop_as(board.owner, board.driven)
    except WayfarerError as error:
        return StopResult(f"{board.where}: {error}", 1 if board.recorded else error.exit_code)
    return StopResult(f"{board.where}: {said}", 0)


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
            extra_groups=os.getgrouplist(account.pw_name, account.pw_gid),
            start_new_session=True,  # without this terminal, which takes what is typed into it for root's
            cwd="/",
            env=os.environ | {"XDG_RUNTIME_DIR": f"/run/user/{owner}"},  # where that user's daemon listens
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=RIGHTS_S,
            check=False,
        )
    except (OSError, KeyError, subprocess.SubprocessError) as error:
        why = f"no process of user {owner}, whose file this is, could stop them ({kind_and_text(error)})"
        raise WayfarerError(f"nothing may have been stopped: {why}; switch the motors' power off") from None
    said = "".join(each if each.isprintable() else " " for each in done.stdout + done.stderr)
    said = one_line(said)[-MOST_SAID:]
    if done.returncode != 0:
        raise WayfarerError(said or "nothing may have been stopped; switch the motors' power off")
    return f"{said} (stopped as user {owner}, whose file this is)"
