"""``wayfarer run`` (the daemon) and ``wayfarer stop-motors`` (stops the motors without a daemon)."""

from __future__ import annotations

from pathlib import Path
from random import SystemRandom
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wayfarer.cli.options import AlgorithmOption, Faults, LogDir, Rover, check_together, examples, log_folder
from wayfarer.cli.viewer_options import (
    NEEDS,
    Live,
    LiveHost,
    LivePort,
    Mavlink,
    ground_station,
    live_page,
)
from wayfarer.config.rover_path import ROVER_FILE, own_folder
from wayfarer.errors import BadInput
from wayfarer.extras import import_structlog, require

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from wayfarer.config.rover_file import RoverConfig
    from wayfarer.daemon.daemon import RoverSetup, Viewer

HINT = "In another terminal: wayfarer arm, wayfarer status, wayfarer stop"
RUN_EXAMPLES = examples(
    "wayfarer run --sim",
    "wayfarer run --sim --live",
    "wayfarer run --sim --fault silent:compass@20+10",
    "wayfarer run --sim --mavlink udpout:127.0.0.1:14550",
    "wayfarer run --rover minirover --dry-run",
    "wayfarer run --rover /etc/wayfarer/rover.toml --log-dir /var/lib/wayfarer/field_logs",
    "then, from another terminal: wayfarer arm",
)


def run(
    ctx: typer.Context,
    *,
    rover: Rover = None,
    sim: Annotated[bool, typer.Option("--sim", help="Run on the simulated rover, in real time.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Run everything, but do not drive the motors.")] = False,
    manual: Annotated[
        bool, typer.Option("--manual", help="Allow driving by hand, as [manual] allowed = true in the rover file does.")
    ] = False,
    algorithm: AlgorithmOption = "forest-pledge",
    log_dir: LogDir = None,
    depth: Annotated[
        str | None,
        typer.Option(
            metavar="device|bus",
            help="With --sim: device: simulated parts; bus: the real drivers over simulated chips. (default: device)",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="With --sim: random seed, for forest and noise. (default: 0)")
    ] = None,
    fault: Faults = None,
    live: Live = False,
    live_host: LiveHost = None,
    live_port: LivePort = None,
    mavlink: Mavlink = None,
) -> None:
    """Run the daemon: it starts disarmed, and drives once it is armed from another terminal."""
    import_structlog()
    from wayfarer.config.registry import find_algorithm
    from wayfarer.config.rover_file import laid_over, load_rover
    from wayfarer.daemon.daemon import Service, serve
    from wayfarer.daemon.socket.paths import daemon_socket
    from wayfarer.logview.narrator import Console

    check_together(ctx, needs=(("depth", "sim"), ("seed", "sim"), ("fault", "sim"), *NEEDS))
    name = chosen_rover(rover, default="sim" if sim else None)
    loaded = load_rover(name)
    chosen, folder = find_algorithm(algorithm, own_folder(name)), log_folder(log_dir)
    if seed is None:  # a real run draws its seed; the log's first record has it
        seed = 0 if sim else SystemRandom().randrange(2**31)
    make_rover = simulated(loaded, name, depth or "device", seed, fault or ()) if sim else _real(loaded, name, folder)
    if manual:
        loaded = laid_over(loaded, {"manual": {"allowed": True}})
    viewers: list[Viewer] = []
    addresses = {}  # by the keys of wayfarer status
    if live:
        page = live_page(live_host, live_port)
        print(f"live page: {page.url}", flush=True)
        viewers.append(page)
        addresses["live_page"] = page.url
    if mavlink is not None:
        viewers.append(ground_station(mavlink, loaded))
        addresses["mavlink"] = mavlink
    service = Service(
        config=loaded,
        algorithm=chosen,
        seed=seed,
        make_rover=make_rover,
        logs=folder,
        socket=daemon_socket(),
        simulated=sim,
        dry_run=dry_run,
        console=lambda write: Console(HINT, write, then="wayfarer logs summary").show,
        viewers=viewers,
        addresses=addresses,
    )
    serve(service)


def stop_motors(*, rover: Rover = None) -> None:
    """Stop the motors directly, if the daemon does not: those that it drove last, and those of the rover file."""
    from wayfarer.daemon.stop_motors import stop_motors as stop

    print(stop(str(ROVER_FILE) if rover is None else rover))


def chosen_rover(rover: str | None, default: str | None = None) -> str:
    """Return the rover file to use: the one that was named, or else the system's own.

    Raises:
        BadInput: there is none.
    """
    if rover is not None:
        return rover
    if default is not None:
        return default
    if ROVER_FILE.exists():
        return str(ROVER_FILE)
    raise BadInput(
        f"no rover file {ROVER_FILE}; name a rover with --rover (see wayfarer list), or try wayfarer run --sim"
    )


def _real(config: RoverConfig, where: str, logs: Path) -> Callable[[Any], RoverSetup]:
    """Return what makes the rover with its calibration."""
    from wayfarer.commissioning.checks import HostEnvironment
    from wayfarer.commissioning.checks.system import device_files, refuse_missing_ports
    from wayfarer.config.calibration_file import load
    from wayfarer.config.factory import connect
    from wayfarer.daemon.daemon import RoverSetup

    host = HostEnvironment.here(logs)
    calibration = load(host.calibration_file)
    buses, rover = connect(config, where, calibration)
    refuse_missing_ports(config, where, host)
    setup = RoverSetup(rover, calibration, devices=device_files(config), close_buses=buses.close)
    return lambda _: setup


def simulated(
    config: RoverConfig, where: str, depth: str, seed: int, faults: Sequence[str] = ()
) -> Callable[[Any], RoverSetup]:
    """Return what makes a simulated rover, as ``daemon.daemon.Service`` wants it.

    ``where`` is the rover's file, or the name of a shipped one.

    Raises:
        BadConfig: the rover cannot be built at that depth; the text names file and key.
        BadInput: a fault cannot happen to it.
        MissingPackage: a package is not installed.
    """
    require("simulating")
    from wayfarer.experiments.checks import check_rover, checked_faults
    from wayfarer.experiments.settings import checked_plain, option_of
    from wayfarer.run_sim import simulated_rover_setup

    in_depth = checked_plain({"depth": depth}, option_of)["depth"]
    check_rover(config, in_depth, where)
    parsed = checked_faults(faults, config, in_depth)
    for each in parsed:
        from wayfarer.simhal.faults.process import PROCESS  # a rover without faults need not know them

        if each.target == PROCESS:
            raise BadInput(f"--fault {each.kind} happens to the process, in virtual time only: use wayfarer sim")
    return lambda finish: simulated_rover_setup(config, in_depth, seed, finish, parsed)
