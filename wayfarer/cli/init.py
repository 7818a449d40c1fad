"""``wayfarer init``: writes a first rover file."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wayfarer.cli.options import examples, log_folder
from wayfarer.config.rover_path import ROVER_FILE_BYTES
from wayfarer.errors import BadConfig, BadInput, one_line
from wayfarer.files import read_regular, write_new
from wayfarer.views.text.colour import painted
from wayfarer.views.text.scripting import say_next

if TYPE_CHECKING:
    from wayfarer.commissioning.init import Inventory

NOTHING_WRITTEN = 1
YES, NO = {"yes", "y"}, {"no", "n"}
TONES = {"found": "good", "other": "warning", "skipped": "warning", "nothing": "quiet"}
EXAMPLES = examples(
    "wayfarer init",
    "wayfarer init ./my-rover.toml",
    "wayfarer init --yes --dry-run",
    "wayfarer init --answers ./answers.toml --yes /etc/wayfarer/rover.toml",
)
ASK_FIRST = (
    "To find parts, the registers that tell which part it is are read on the I2C and SPI buses, at the addresses\n"
    "of the parts that wayfarer knows. No part is changed, and nothing is sent to a serial port. Look now?"
)


class AtTerminal:
    """The person at the terminal; questions are on stderr, so that stdout can have the file alone."""

    patient = True

    def say(self, text: str) -> None:
        """Show a line."""
        print(text, file=sys.stderr)

    def agrees(self, question: str) -> bool:
        """Ask a question of yes or no, again after any other word; Enter alone is a yes."""
        while (answer := self.ask(f"{question} (yes, no)", "yes").lower()) not in YES | NO:
            self.say(f"'{answer}' is neither yes nor no")
        return answer in YES

    def ask(self, question: str, default: str) -> str:
        """Ask by a prompt.

        Raises:
            BadInput: the input has ended.
        """
        from rich.console import Console
        from rich.prompt import Prompt
        from rich.text import Text

        try:
            console = Console(stderr=True, highlight=False, soft_wrap=True)
            prompt = Text(f"\n{question}")
            return Prompt.ask(prompt, console=console, default=default, show_default=bool(default)).strip()
        except EOFError:
            raise BadInput("no answer: the input has ended; nothing was written (--yes takes every default)") from None


class Nobody:
    """Agrees, and takes every default."""

    patient = False

    def agrees(self, question: str) -> bool:  # noqa: ARG002 - as any Person
        """Agree."""
        return True

    def say(self, text: str) -> None:
        """Show a line."""
        print(text, file=sys.stderr)

    def ask(self, question: str, default: str) -> str:  # noqa: ARG002 - as any Person
        """Return the default."""
        return default


def init(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="The rover file to write; it must not exist yet.")
    ] = Path("rover.toml"),
    *,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Ask nothing: look, and take every default.")] = False,
    answers: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Take what this file says (tables as in a rover file) and ask for the rest."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the file and write nothing.")] = False,
) -> None:
    """Write a first rover file: look at what is connected, and ask for what cannot be seen."""
    from wayfarer.commissioning.init import Inventory, first_rover_file

    if not dry_run:
        _refuse_existing(file)
    given = _Answers(answers)
    person = Nobody() if yes else AtTerminal()
    inventory = _look() if person.agrees(ASK_FIRST) else Inventory()
    _print(inventory)
    if inventory.is_empty:
        person.say("Nothing was found that a rover can be made of.")
        if not person.agrees("Write a file with the defaults of ForestRover?"):
            person.say("nothing was written")
            raise typer.Exit(NOTHING_WRITTEN)
    try:
        text = first_rover_file(inventory, given.tables, person)
    except BadConfig as error:
        raise given.located(error) from None
    if dry_run:
        print(text, end="")
    else:
        _write(file, text)
        print(f"wrote {file}")
        say_next("wayfarer", "check", "--rover", file if file.is_absolute() else f"./{file}")


class _Answers:
    """What an answers file says; nothing without one.

    Raises:
        BadInput: it cannot be read, or is no TOML.
    """

    def __init__(self, path: Path | None) -> None:
        import tomllib

        self._path, self._text = path, ""
        if path is not None:
            try:
                self._text = read_regular(path, ROVER_FILE_BYTES).decode("utf-8-sig")
                self.tables: dict[str, Any] = tomllib.loads(self._text + "\n")
            except OSError as error:
                raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
            except (ValueError, RecursionError) as error:
                raise BadInput(one_line(f"{path}: not valid TOML: {error}")) from None
        else:
            self.tables = {}

    def located(self, error: BadConfig) -> BadConfig:
        """Return an error about a key with the line of the answers file where it is; without a file, as it is."""
        from wayfarer.config.messages import located

        return BadConfig(located(str(self._path), self._text, str(error))) if self._path else error


def _look() -> Inventory:
    """Look at the buses of this computer, which no daemon may use meanwhile."""
    import asyncio

    from wayfarer.commissioning.checks import HostEnvironment
    from wayfarer.commissioning.init import look, motor_devices
    from wayfarer.daemon.motors_lock import refuse_taken
    from wayfarer.daemon.socket.paths import daemon_socket, single_daemon
    from wayfarer.drivers.linux import LinuxBuses, connected_cameras

    host = HostEnvironment.here(log_folder(None))

    async def run() -> Inventory:
        buses = LinuxBuses()
        try:
            return await look(host, buses, connected_cameras)
        finally:
            await buses.close()

    for device in motor_devices(host):  # a daemon on another socket is found by its motors
        refuse_taken(device)
    with single_daemon(daemon_socket()):
        return asyncio.run(run())


def _print(inventory: Inventory) -> None:
    for verdict, text in inventory.sightings:
        print(f"{painted(f'{verdict.value:<8}', TONES[verdict.value], sys.stderr)}{text}", file=sys.stderr)


def _refuse_existing(file: Path) -> None:
    if os.path.lexists(file):
        raise BadInput(f"{file} exists and is left as it is: name another file, or print with --dry-run")
    if not file.parent.is_dir():
        raise BadInput(f"{file.parent}: no such folder; make it first")


def _write(file: Path, text: str) -> None:
    try:
        write_new(file, text)
    except FileExistsError:
        _refuse_existing(file)
    except OSError as error:
        raise BadInput(f"{file}: cannot be written: {error.strerror}") from None
