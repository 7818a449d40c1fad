"""Options that several commands share, their help and refusals, and what a shell offers for their values.

``--install-completion`` sets up the shell. What begins with no value that is offered is completed as a file, by the
shell itself. No ``complete_`` function may fail or print: it would stand in the line that a person is typing.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from wayfarer.config.rover_path import ROVER_FILE
from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import OWN_LOGS, SYSTEM_LOGS, default_log_folder


def log_folder(log_dir: Path | None) -> Path:
    """Return where runs are logged: in ``--log-dir``, else where they are by default."""
    return default_log_folder() if log_dir is None else log_dir


def complete_runs(ctx: typer.Context) -> list[str]:
    """Return the numbers of the runs in the folder that ``--log-dir`` names so far; a run without one has its name."""
    from wayfarer.fieldlog.folders import run_folders, short_name

    try:
        found = run_folders(log_folder(ctx.params.get("log_dir")))
    except BadInput:
        return []
    return [short_name(run) for run in found]


def complete_rovers() -> list[str]:
    """Return the built-in rovers."""
    from wayfarer.config.rover_file import rover_names

    return rover_names()


def complete_algorithm() -> list[str]:
    """Return all algorithms, also those of installed packages."""
    from wayfarer.config.registry import algorithm_names

    return algorithm_names()


def complete_algorithms(incomplete: str) -> list[str]:
    """Return the lists of algorithms that go on from the one typed so far; ``paper`` is all ten of the paper."""
    before, comma, _ = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in [*complete_algorithm(), "paper"]]


def complete_faults() -> list[str]:
    """Return the kinds of faults."""
    try:
        from wayfarer.simhal.faults.kinds import KINDS
    except ImportError:  # without the extra that simulates
        return []
    return list(KINDS)


def complete_sites() -> list[str]:
    """Return the sites."""
    try:
        from wayfarer.simhal.world.sites import SITES
    except ImportError:  # without the extra that simulates
        return []
    return list(SITES)


def complete_settings(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the keys of ``--set`` and ``wayfarer sweep`` for its ``--rover`` and ``--physics``."""
    from wayfarer.config.rover_file import load_rover
    from wayfarer.experiments.campaign import Campaign
    from wayfarer.experiments.keys import current
    from wayfarer.simhal.world.physics import PhysicsName

    if "=" in incomplete:
        return []
    try:
        rover = load_rover(ctx.params.get("rover") or "sim")
        physics = PhysicsName(ctx.params.get("physics") or "light")
    except (BadInput, ValueError):
        return []
    return [f"{key}=" for key in current(Campaign(rover=rover, physics=physics))]


def rover_option(help_text: str) -> Any:
    """Return an option that takes the name of a built-in rover, or a rover file."""
    return typer.Option(metavar="NAME|FILE", autocompletion=complete_rovers, help=help_text)


def run_argument(help_text: str) -> Any:
    """Return an argument that takes a run."""
    return typer.Argument(metavar="RUN", autocompletion=complete_runs, help=help_text)


LogDir = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help=f"Folder of all runs' logs. (default: {SYSTEM_LOGS} if you may write there, else ./{OWN_LOGS})",
    ),
]
Rover = Annotated[
    str | None,
    rover_option(f"Name of a built-in rover, or a rover file (TOML). (default: {ROVER_FILE})"),
]
AlgorithmOption = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        autocompletion=complete_algorithm,
        help="Escape algorithm; see wayfarer list. Or your own, as FILE.py or FILE.py:NAME.",
    ),
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KIND[:PART][@S[+S]]",
        autocompletion=complete_faults,
        help="A fault on purpose, S seconds after arming (default: 5) and for S seconds (default: to the end), such as "
        "silent:compass@20+5; may be given again. See wayfarer list --faults.",
    ),
]
AllowCode = Annotated[
    bool,
    typer.Option(
        "--allow-code",
        help="Run code that a log or results name, 'FILE.py' or 'module:attribute': only if you trust the writer.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")]


def examples(*commands: str) -> str:
    """Return the end of a help text."""
    return "\n".join(["Examples:", *commands])


Pairs = Iterable[tuple[str, str]]


def command_line(ctx: typer.Context) -> list[str]:
    """Return the program's name and the arguments that it was called with."""
    return ["wayfarer", *ctx.obj]


def check_together(ctx: typer.Context, *, needs: Pairs = (), excludes: Pairs = ()) -> None:
    """Refuse options that do not go together.

    Args:
        ctx: of the command. An option is given if its value is none of None, False and ().
        needs: of each pair, the first option has no effect without the second. An option is named as its parameter,
            such as ``live_port``, or with one of its values, such as ``physics mujoco``.
        excludes: of each pair, only one option may be given.

    Raises:
        BadInput: two of them do not go together; the text names the first such pair.
    """
    given = {name for name, value in ctx.params.items() if not (value is None or value is False or value == ())}
    given |= {f"{name} {value}" for name, value in ctx.params.items() if isinstance(value, str)}
    for name, needed in needs:
        if name in given and needed not in given:
            raise BadInput(f"{_option(name)} has no effect without {_option(needed)}: add that, or leave it out")
    for name, other in excludes:
        if name in given and other in given:
            raise BadInput(f"{_option(name)} and {_option(other)} do not go together: leave one of them out")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"
