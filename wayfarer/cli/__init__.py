"""The ``wayfarer`` command.

A mistake of the user gives one line on stderr and exit code 2. A command whose output nobody reads any more, as before
``| head -1``, ends without a message and with exit code 141, like other Unix tools. ``wayfarer.errors`` lists all exit
codes. Each command imports what it needs when it runs, so that the light ones are quick on a rover's small computer.
"""

from __future__ import annotations

import os
import signal
import sys
from copy import copy
from functools import cache, partial
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any

import typer

from wayfarer import __version__
from wayfarer.cli import (
    commissioning,
    compare,
    completion,
    control,
    demo,
    init,
    listing,
    logs,
    new,
    replay,
    report,
    rover,
    sim,
    sweep,
)
from wayfarer.cli.help_texts import HELP_OPTIONS, HelpCommand, HelpGroup, error_text
from wayfarer.cli.options import examples
from wayfarer.cli.trial_options import with_settings
from wayfarer.control import is_compiled
from wayfarer.errors import WayfarerError
from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.logview.terminal import painted

VERSION = ("--version", "-V")
BAD_INPUT = 2
READER_GONE = 128 + signal.SIGPIPE  # what a shell reports of a program that SIGPIPE has ended

ROVER = "On the rover"
CONTROL = "To a running rover"
AFTERWARDS = "Logs and results"

EXAMPLES = examples(
    "wayfarer demo",
    "wayfarer sim --trials 1000",
    "wayfarer run --sim",
    "wayfarer sim --help",
)
app = typer.Typer(
    cls=HelpGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    suggest_commands=False,
    context_settings=HELP_OPTIONS,
)
command = partial(app.command, cls=HelpCommand)
command(epilog=demo.EXAMPLES)(demo.demo)
command("sim", epilog=sim.EXAMPLES)(with_settings(sim.sim))
command("sweep", epilog=sweep.EXAMPLES)(with_settings(sweep.sweep, trials=sweep.TRIALS))
command(rich_help_panel=ROVER, epilog=init.EXAMPLES)(init.init)
command(rich_help_panel=ROVER, epilog=rover.RUN_EXAMPLES)(rover.run)
for verb in control.COMMANDS:
    lenient = {"ignore_unknown_options": verb in control.ACCEPT_NEGATIVE}
    command(rich_help_panel=CONTROL, epilog=control.EXAMPLES.get(verb), context_settings=lenient)(verb)
command("stop-motors", rich_help_panel=ROVER)(rover.stop_motors)
command(rich_help_panel=ROVER, epilog=commissioning.CHECK_EXAMPLES)(commissioning.check)
command(rich_help_panel=ROVER, epilog=commissioning.CALIBRATE_EXAMPLES)(commissioning.calibrate)
app.add_typer(
    logs.app,
    name="logs",
    rich_help_panel=AFTERWARDS,
    help="Read field logs: list, follow, show, summarise, check, export.",
)
command(rich_help_panel=AFTERWARDS, epilog=report.EXAMPLES)(report.report)
command(rich_help_panel=AFTERWARDS, epilog=compare.EXAMPLES)(compare.compare)
command(rich_help_panel=AFTERWARDS, epilog=replay.EXAMPLES)(replay.replay)
command("install-service", rich_help_panel=ROVER, epilog=commissioning.INSTALL_EXAMPLES)(commissioning.install_service)
command("new", epilog=new.EXAMPLES)(new.new)
command("list")(listing.list_names)


def main() -> None:
    """Run the command line and exit."""
    if sys.stdout is None:  # it was closed
        sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a mark in a script that this terminal does not know
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code."""
    if os.environ.get("COLUMNS", "").strip("0") == "":
        os.environ.pop("COLUMNS", None)  # a width of 0, which rich takes for one; as unset it is the terminal's or 80
    try:
        return _run(arguments)
    except (BrokenPipeError, SystemExit) as gone:
        # Typer and rich make a SystemExit of it. Others are not about the pipe: a word was completed for the shell.
        if isinstance(gone, SystemExit) and not isinstance(gone.__context__, BrokenPipeError):
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the interpreter flushes once more
        return READER_GONE


def _run(arguments: list[str]) -> int:
    try:
        arguments = completion.with_shell(arguments)
        # ``obj`` reaches each command as its context's: it may have to say how it was called.
        asked = _command(arguments[0] if arguments else "")
        code = int(asked(arguments, prog_name="wayfarer", standalone_mode=False, obj=arguments) or 0)
        sys.stdout.flush()
        return code
    except WayfarerError as error:
        return _fail(str(error), error.exit_code)
    except typer.TyperException as error:
        return _fail(error_text(error), BAD_INPUT)
    except BrokenPipeError:
        raise
    except (OSError, UnicodeError) as error:  # a terminal or a disk that takes no output
        return _fail(f"the system refused: {error}", 1)


@cache
def _command(first: str) -> Any:
    """Return what ``app`` describes, as Typer runs it; if the first argument names a command, with no other one.

    To build all commands takes a quarter of a light one's time.
    """
    completion.register_shells()
    name_of = typer.main.get_command_name
    commands = {each.name or name_of(getattr(each.callback, "__name__", "")): each for each in app.registered_commands}
    groups = {each.name: each for each in app.registered_groups}
    asked = copy(app)
    if first in {*commands, *groups, *VERSION}:
        asked.registered_commands = [each for name, each in commands.items() if name == first]
        asked.registered_groups = [each for name, each in groups.items() if name == first]
    return typer.main.get_command(asked)


def _fail(text: str, exit_code: int) -> int:
    if text:  # there is none if the help was the answer
        line = escape_control_chars(" ".join(text.splitlines()))
        print(painted("wayfarer:", "fault", sys.stderr), line, file=sys.stderr)
    return exit_code


def version_text() -> str:
    """Return the version in words, such as ``wayfarer 0.1.0 (compiled)``."""
    return f"wayfarer {__version__} ({'compiled' if is_compiled() else 'pure Python'})"


def _print_version(asked: bool) -> None:
    if asked:
        print(version_text())
        raise typer.Exit


@app.callback(epilog=EXAMPLES)
def _root(
    *,
    version: Annotated[
        bool,
        typer.Option(*VERSION, callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
    install_completion: completion.Install = None,
    show_completion: completion.Show = None,
) -> None:
    """Drive a rover out of a forest without vision: compass, tilt and stall detection only."""
