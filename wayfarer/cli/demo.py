"""``wayfarer demo``: one simulated escape, shown in a browser."""

from __future__ import annotations

import os
import signal
import tempfile
from functools import partial
from pathlib import Path
from threading import Thread
from time import monotonic  # noqa: TID251 - where a run's time begins
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.cli import options
from wayfarer.cli.options import examples
from wayfarer.cli.rover import simulated
from wayfarer.cli.viewer_options import LivePort, live_page
from wayfarer.extras import require

if TYPE_CHECKING:
    from wayfarer.daemon.daemon import Service
    from wayfarer.escape.catalogue import Algorithm
    from wayfarer.experiments.demo import Demo
    from wayfarer.safety.mission_limits import RunEnd

EXAMPLES = examples(
    "wayfarer demo",
    "wayfarer demo --algorithm levy-walk --speed 20",
    "wayfarer demo --seed 44 --no-browser",
)

# Six or seven episodes, and out after 110 to 185 s (5 runs; the noise differs in each): 18 to 31 s to watch at the
# speed below.
SEED = 22
SPEED = 6.0
ROVER = "sim"


def _speed(value: float) -> float:
    from wayfarer.views.live.demo_controls import checked_speed

    return checked_speed(value)


def demo(
    *,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Random seed: forest and noise.")] = SEED,
    algorithm: options.AlgorithmOption = "forest-pledge",
    speed: Annotated[
        float,
        typer.Option(
            callback=_speed,
            metavar="X",
            help="How many times faster than real time; limited by the speed of this computer.",
        ),
    ] = SPEED,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Do not open a browser; only print the page's address.")
    ] = False,
    live_port: LivePort = None,
    log_dir: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the run's log. (default: a temporary folder)")
    ] = None,
) -> None:
    """Watch a simulated rover escape from a forest, in a browser, a few times faster than real time."""
    from wayfarer.config.registry import find_algorithm
    from wayfarer.experiments.demo import Demo

    require("simulating")
    found = find_algorithm(algorithm)
    shown = Demo(seed, speed)
    page = live_page(None, live_port, shown)
    folder = log_dir or Path(tempfile.mkdtemp(prefix="wayfarer-demo-"))
    with tempfile.TemporaryDirectory(prefix="wayfarer-") as own, shown.serve_page(page):
        print(f"open this page; the rover starts when it is open: {page.url}", flush=True)
        if not no_browser:
            Thread(target=open_page, args=[page.url], daemon=True).start()  # some browsers do not return until they end
        _run_all(shown, found, folder, Path(own) / "control.sock")  # where no other daemon is disturbed


def _run_all(shown: Demo, algorithm: Algorithm, logs: Path, socket: Path) -> None:
    """Run one forest after the other, until no viewer has the page open or a signal ends a run."""
    from wayfarer.daemon.daemon import serve

    before = signal.getsignal(signal.SIGTERM)
    try:
        for forest in shown.seeds():
            end = serve(_service(shown, algorithm, forest, logs, socket))
            signal.signal(signal.SIGTERM, signal.default_int_handler)  # while a run is on, the daemon takes it
            if not shown.goes_on:
                print(_last_words(end, logs), flush=True)
            if end.reason == "signal":
                return
    except KeyboardInterrupt:
        pass  # between two runs
    finally:
        signal.signal(signal.SIGTERM, before)


def _service(shown: Demo, algorithm: Algorithm, forest: int, logs: Path, socket: Path) -> Service:
    from wayfarer.config.rover_file import load_rover
    from wayfarer.daemon.daemon import Service
    from wayfarer.experiments.demo import AutoArm
    from wayfarer.fieldlog.clock import wall_clock
    from wayfarer.simhal.clock.scaled_loop import ScaledLoop
    from wayfarer.views.text.console import Console

    config = load_rover(ROVER)
    zero_s = wall_clock(0.0) - monotonic()  # the run's time begins at this clock's
    return Service(
        config=config,
        algorithm=algorithm,
        seed=forest,
        make_rover=simulated(config, ROVER, "device", forest),
        logs=logs,
        socket=socket,
        simulated=True,
        dry_run=False,
        console=lambda write: Console("Starts when the page is opened", write).show,
        viewers=[AutoArm(shown, shown.watched)],
        loop_factory=partial(ScaledLoop, shown.time_scale),
        time_scale=shown.time_scale.speed,
        wall=lambda t_s: zero_s + t_s,  # with the run's time: else a pause would be a clock that was set
    )


def open_page(url: str) -> None:
    """Open a page in the browser, as far as there is one with a window."""
    if any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")):
        import webbrowser  # without a window, one in the terminal would take that over

        webbrowser.open(url)


def _last_words(end: RunEnd, logs: Path) -> str:
    from wayfarer.fieldlog.folders import newest_run

    run = newest_run(logs)
    stays = "" if end.reason == "signal" else "\nthe page and its buttons stay until you close the page or press Ctrl-C"
    return f"""
{end.text}{stays}
the field log: {run}

next: wayfarer report {run}
      wayfarer demo --seed 44              another forest, a harder one
      wayfarer demo --algorithm levy-walk  another algorithm in the same forest
      wayfarer sim --trials 1000           the same code in 1000 trials, with a table
      wayfarer run --sim --live            the daemon as it runs on a rover, in real time: arm it yourself"""
