"""``wayfarer demo``: a trial of ``wayfarer sim``, shown in a browser."""

from __future__ import annotations

import os
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.cli import options
from wayfarer.cli.options import examples
from wayfarer.cli.viewer_options import LivePort, live_page
from wayfarer.extras import require

if TYPE_CHECKING:
    from wayfarer.demo import DemoTrial

EXAMPLES = examples(
    "wayfarer demo",
    "wayfarer demo --algorithm levy-walk --speed 20",
    "wayfarer demo --seed 16 --no-browser",
    "wayfarer demo --seed 0 --trial 17",
)

# Nine episodes, and out after 104 s: 17 s to watch at the speed below.
SEED = 22
SPEED = 6.0


def _speed(value: float) -> float:
    from wayfarer.remote.live import checked_speed

    return checked_speed(value)


def demo(
    *,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Random seed: forest and noise.")] = SEED,
    trial: Annotated[
        int, typer.Option(min=0, metavar="N", help="Show this trial of wayfarer sim with the same --seed.")
    ] = 0,
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
    """Watch a simulated rover escape from a forest, in a browser, a few times faster than real time.

    The run is a trial: the same seed gives the same run, at any speed and on any computer.
    """
    require("simulating")
    require("the live page")
    import asyncio
    from tempfile import mkdtemp

    from wayfarer.config.registry import find_algorithm
    from wayfarer.demo import Demo

    find_algorithm(algorithm)  # before there is a page
    folder = log_dir or Path(mkdtemp(prefix="wayfarer-demo-"))
    shown = Demo(algorithm, seed, trial, speed, folder, lambda ended: print(_last_words(ended, seed), flush=True))
    page = live_page(None, live_port, shown)
    print(f"open this page; the rover starts when it is open: {page.url}", flush=True)
    if not no_browser:
        Thread(target=open_page, args=[page.url], daemon=True).start()  # some browsers do not return until they end
    asyncio.run(shown.run(page))


def open_page(url: str) -> None:
    """Open a page in the browser, as far as there is one with a window."""
    if any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")):
        import webbrowser  # without a window, one in the terminal would take that over

        webbrowser.open(url)


def _last_words(ended: DemoTrial, seed: int) -> str:
    from wayfarer.fieldlog.clock import duration_text

    state, again = ended.state, f"--seed {seed} --trial {ended.result.trial}"
    reason, text = (state.ended.reason, state.ended.text) if state.ended else (None, "the log has no end")
    if ended.result.algorithm != "forest-pledge":
        again += f" --algorithm {ended.result.algorithm}"
    stays = "" if reason == "signal" else "\nthe page stays until you close it or press Ctrl-C"
    return f"""
{text}: {state.driven_m or 0.0:.1f} m driven in {duration_text(state.elapsed_s)}{stays}
the field log: {ended.folder}

next: wayfarer report {ended.folder}
      wayfarer demo --seed 16              another forest, a harder one
      wayfarer demo --algorithm levy-walk  another algorithm in the same forest
      wayfarer sim --trials 1000           the same code in 1000 trials, with a table
      wayfarer sim {again:<23} this trial again, without the page
      wayfarer run --sim --live            the daemon as it runs on a rover, in real time: arm it yourself"""
