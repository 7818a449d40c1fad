"""How the results in a folder were made: ``runs.json`` has when, by which command, version and computer.

There is an entry for each time that a campaign or sweep was begun or continued. It explains results and decides none:
the same settings give the same ``trials.csv`` on any computer. Nobody's name and no computer's is in it, and the home
folder in a command is written as ``~``.
"""

from __future__ import annotations

import os
import platform
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from wayfarer import __version__
from wayfarer.config.messages import key_and_problem
from wayfarer.control import is_compiled
from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import wall_clock
from wayfarer.files import read_regular, write_atomically

RUNS = "runs.json"
MOST_BYTES = 1_000_000  # thousands of entries
MODEL_NAME = re.compile(r"^(?:model name|Model)\s*:\s*(.+)$", re.MULTILINE)  # of a PC, of a Raspberry Pi


class Machine(BaseModel):
    """A computer: its processor, how many cores this process may use, its operating system and its Python."""

    model_config = ConfigDict(extra="forbid")

    cpu: str
    cores: int = Field(ge=1)
    system: str
    python: str


class RecordedRun(BaseModel):
    """When a campaign or sweep was begun or continued, and how; ``command`` is None if no command did it."""

    model_config = ConfigDict(extra="forbid")

    began: AwareDatetime = Field(ge=datetime(1970, 1, 1, tzinfo=UTC), lt=datetime(9000, 1, 1, tzinfo=UTC))
    command: str | None
    version: str
    compiled: bool
    machine: Machine


_RUNS = TypeAdapter(list[RecordedRun])


def read_runs(folder: Path) -> list[RecordedRun]:
    """Return the runs that made the results in a folder, the first one first; none if an older version made them.

    Raises:
        BadInput: the file is damaged, or cannot be read.
    """
    path = folder / RUNS
    try:
        return _RUNS.validate_json(read_regular(path, MOST_BYTES))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise BadInput(f"{path} is damaged: {key_and_problem(error)}; remove it: results do not depend on it") from None


def record_run(folder: Path, command: Sequence[str] | None) -> None:
    """Add this run to those that made the results in a folder.

    Args:
        folder: of the results.
        command: the program's name and its arguments; None if no command line asked for the run.

    Raises:
        BadInput: the file that is there is damaged.
        OSError: it cannot be written.
    """
    began = datetime.fromtimestamp(wall_clock(0.0), UTC).replace(microsecond=0)
    text = None if command is None else _without_home(shlex.join(command))
    this = RecordedRun(began=began, command=text, version=__version__, compiled=is_compiled(), machine=this_machine())
    write_atomically(folder / RUNS, _RUNS.dump_json([*read_runs(folder), this], indent=2) + b"\n")


def this_machine() -> Machine:
    """Return what this computer is."""
    return Machine(
        cpu=_cpu(),
        cores=len(os.sched_getaffinity(0)),
        system=f"{_system()}, {platform.machine()}",
        python=f"{platform.python_implementation()} {platform.python_version()}",
    )


def facts_of(runs: Sequence[RecordedRun]) -> Iterator[tuple[str, str]]:
    """Yield a name and a text for each thing that is known, a line for each different value; nothing without runs."""
    tell: dict[str, Callable[[RecordedRun], str]] = {
        "run": lambda run: f"{run.began.astimezone(UTC):%Y-%m-%d %H:%M} UTC",
        "command": lambda run: run.command or "none: run from Python",
        "software": lambda run: f"wayfarer {run.version} ({'compiled' if run.compiled else 'pure Python'})",
        "computer": lambda run: "{cpu}, {cores} cores, {system}, {python}".format(**run.machine.model_dump()),
    }
    for name, text in tell.items():
        if runs:
            yield name, "\n".join(dict.fromkeys(map(text, runs)))


def _without_home(command: str) -> str:
    command = command.encode("utf-8", "backslashreplace").decode()  # a file's name may not be text
    home = os.environ.get("HOME", "").rstrip("/")
    return re.sub(rf"{re.escape(home)}(?=[/\s]|$)", "~", command) if home else command


def _cpu() -> str:
    try:
        found = MODEL_NAME.search(Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace"))
    except OSError:
        found = None
    return found[1].strip() if found else "unknown processor"


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return platform.system()
