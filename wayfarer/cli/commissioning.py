"""``wayfarer check``, ``calibrate`` and ``install-service``: commissioning of a rover."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from wayfarer.cli.options import LogDir, Rover, examples, log_folder
from wayfarer.cli.rover import chosen_rover
from wayfarer.logview.terminal import painted, print_json, say_next

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable

    from wayfarer import hal
    from wayfarer.commissioning.checks import Finding, HostEnvironment
    from wayfarer.config.calibration_file import Calibration
    from wayfarer.config.rover_file import RoverConfig

NOT_READY = 1
TONES = {"ok": "good", "warn": "warning", "fail": "fault", "skipped": "quiet"}
T = TypeVar("T")
CHECK_EXAMPLES = examples(
    "wayfarer check", "wayfarer check --rover ./rover.toml", "wayfarer check --rover minirover --json"
)
CALIBRATE_EXAMPLES = examples("wayfarer calibrate", "wayfarer calibrate compass motors --rover ./rover.toml")
INSTALL_EXAMPLES = examples("wayfarer install-service --print", "sudo wayfarer install-service")


class CalibrationStep(StrEnum):
    """What can be calibrated, as ``commissioning.calibrate.STEPS``; Typer takes no list of literals."""

    compass = "compass"
    flow = "flow"
    motors = "motors"


def check(
    *,
    rover: Rover = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print JSON for scripts. Asks no questions and turns no wheel."),
    ] = False,
    log_dir: LogDir = None,
) -> None:
    """Check every part. If you agree, also check that the wheels turn the right way and stop by themselves."""
    from wayfarer.cli import terminal
    from wayfarer.commissioning.checks import check as look
    from wayfarer.commissioning.checks import passed

    ask = terminal.Terminal().ask if terminal.is_interactive() and not as_json else None
    findings = _at_the_rover(rover, log_dir, partial(look, ask=ask), calibrated=True)
    if as_json:
        print_json({"passed": passed(findings), "findings": findings})
    else:
        _print(findings)
    raise typer.Exit(0 if passed(findings) else NOT_READY)


def calibrate(
    steps: Annotated[
        list[CalibrationStep] | None,
        typer.Argument(metavar="STEP", help="What to calibrate, in this order: compass, flow, motors. (default: all)"),
    ] = None,
    *,
    rover: Rover = None,
) -> None:
    """Calibrate compass and flow sensor; measure the motors' effect on the compass."""
    from wayfarer.cli import terminal
    from wayfarer.commissioning.calibrate import STEPS
    from wayfarer.commissioning.calibrate import calibrate as guide
    from wayfarer.errors import BadInput

    if not terminal.is_interactive():
        raise BadInput("calibration asks questions: run it in a terminal")
    person = terminal.Terminal()
    guided = partial(guide, operator=person, steps=[step.value for step in steps or ()] or STEPS)
    _at_the_rover(rover, None, guided, calibrated=False)
    say_next("wayfarer", "check", *(["--rover", rover] if rover else []))


def install_service(
    *,
    show: Annotated[bool, typer.Option("--print", help="Print the unit and change nothing.")] = False,
) -> None:
    """Write the unit of the systemd service, and say the two commands that start it; the Debian package brings both."""
    from wayfarer.daemon import install

    print(install.unit_text() if show else install.install(), end="" if show else "\n")


def _at_the_rover(
    rover: str | None,
    log_dir: Path | None,
    work: Callable[[RoverConfig, hal.Rover, HostEnvironment, Calibration], Awaitable[T]],
    *,
    calibrated: bool,
) -> T:
    """Work with a rover's parts, as the calibration says or without it; a person may be asked, no daemon may run."""
    from wayfarer.cli import terminal
    from wayfarer.commissioning.checks import HostEnvironment
    from wayfarer.commissioning.checks.system import device_files
    from wayfarer.config.calibration_file import load
    from wayfarer.config.factory import UNCALIBRATED, connect
    from wayfarer.config.rover_file import load_rover
    from wayfarer.daemon.driven import motors_device, motors_lock
    from wayfarer.daemon.socket.paths import without_daemon

    where = chosen_rover(rover)
    loaded = load_rover(where)
    host = HostEnvironment.here(log_folder(log_dir), device_files(loaded))
    known = load(host.calibration_file)

    async def run() -> T:
        buses, parts = connect(loaded, where, known if calibrated else UNCALIBRATED, checking=calibrated)
        try:
            return await work(loaded, parts, host, known)
        finally:
            await buses.close()

    # Two programs on one bus corrupt each other's answers; a daemon on another socket is found by its motors.
    with without_daemon(), motors_lock(motors_device(loaded)):
        return terminal.run_interactive(run)


def _print(findings: Iterable[Finding]) -> None:
    for finding in findings:
        verdict = finding.verdict.value
        print(f"{painted(f'{verdict:<8}', TONES[verdict])}{finding.name}: {finding.text}")
        if finding.remedy:
            print(f"{'':<8}  do: {finding.remedy}")
