"""``wayfarer init``: writes a first rover file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.cli.options import examples, log_folder
from wayfarer.errors import BadInput
from wayfarer.files import write_new
from wayfarer.logview.terminal import painted, say_next

if TYPE_CHECKING:
    from wayfarer.commissioning.first_rover import Inventory

TONES = {"found": "good", "other": "warning", "skipped": "warning", "nothing": "quiet"}
EXAMPLES = examples("wayfarer init", "wayfarer init minirover", "wayfarer init /etc/wayfarer/rover.toml")


def init(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME|FILE",
            help="The rover's name, or the rover file to write: otter and ./otter.toml write the same file. It must "
            "not exist yet.",
        ),
    ] = "my-rover",
) -> None:
    """Write a first rover file: look at what is connected, and copy the built-in rover that is nearest to it.

    The nearest is NAME, if it is forestrover or minirover, else the one most of whose parts answer.
    """
    from wayfarer.commissioning.first_rover import MODELS, first_rover_file, nearest

    file = Path(name if name.endswith(".toml") else f"{name.rstrip('/')}.toml")
    _refuse_existing(file)
    found = _look()
    model = next((each for each in MODELS if each == name), nearest(found))
    for verdict, text in found.seen:
        print(f"{painted(f'{verdict:<8}', TONES[verdict])}{text}")
    text = first_rover_file(file.stem, model, found)
    try:
        write_new(file, text)
    except FileExistsError:
        _refuse_existing(file)
    except OSError as error:
        raise BadInput(f"{file}: cannot be written: {error.strerror}") from None
    print(f"wrote {file}, from {model}.toml: fill in what FILL IN marks in it")
    say_next("wayfarer", "check", "--rover", file if file.is_absolute() else f"./{file}")


def _refuse_existing(file: Path) -> None:
    if os.path.lexists(file):
        raise BadInput(f"{file} exists and is left as it is: name another file, or move it away")
    if not file.name.removesuffix(".toml").strip("."):
        raise BadInput("the rover has no name: give it one, or leave it out for my-rover.toml")
    if not file.parent.is_dir():
        raise BadInput(f"{file.parent}: no such folder; make it first")


def _look() -> Inventory:
    """Look at the buses of this computer, which no daemon may use meanwhile."""
    import asyncio

    from wayfarer.commissioning.checks import HostEnvironment
    from wayfarer.commissioning.first_rover import look, motor_devices
    from wayfarer.daemon.driven import refuse_taken
    from wayfarer.daemon.socket.paths import without_daemon
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
    with without_daemon():
        return asyncio.run(run())
