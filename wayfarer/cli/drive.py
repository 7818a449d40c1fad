"""``wayfarer drive``: a person drives the rover by hand, with keys or a gamepad."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wayfarer.cli.options import check_together, examples
from wayfarer.fieldlog.fields import escape_document
from wayfarer.views.text.colour import painted

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from wayfarer.cli.driving.wish import Source, Wish

EXPIRY_S = 0.3  # of a key: the deadman of the rover file as shipped; the daemon keeps its own
EXAMPLES = examples("wayfarer drive", "wayfarer drive --gamepad", "wayfarer drive --gamepad --device /dev/input/event3")


def drive(
    ctx: typer.Context,
    *,
    gamepad: Annotated[bool, typer.Option("--gamepad", help="Drive with a gamepad in place of the keys.")] = False,
    device: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="With --gamepad: its event device. (default: the first gamepad)"),
    ] = None,
) -> None:
    """Drive the rover by hand: its daemon must allow it, and the wheels turn only while something is pressed."""
    from wayfarer.cli.driving.gamepad import open_gamepad
    from wayfarer.cli.driving.keys import terminal_keys
    from wayfarer.cli.driving.loop import Driving
    from wayfarer.daemon.socket.client import Connection

    for number in (signal.SIGTERM, signal.SIGHUP):  # as Ctrl-C: the daemon is told, and the terminal is as before
        signal.signal(number, signal.default_int_handler)
    check_together(ctx, needs=(("device", "gamepad"),))
    opened: AbstractContextManager[Source] = open_gamepad(device) if gamepad else terminal_keys(EXPIRY_S)
    try:
        with opened as source, Connection() as daemon, _screen(source) as show:
            end = Driving(lambda request: escape_document(daemon.ask(request)), source, show).drive()
    except KeyboardInterrupt:
        print("stopped; wayfarer status shows whether a mission is held")
        raise
    print("stopped" if end["mode"] == "disarmed" else "stopped; the mission is held: wayfarer resume")


@contextmanager
def _screen(source: Source) -> Iterator[Callable[[Wish, str, Mapping[str, Any]], None]]:
    """Show how it goes, always at the same place of the terminal, until the end; without one, say only what changes."""
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    told = ""
    with Live(console=Console(), auto_refresh=False, transient=True) as live:

        def show(wish: Wish, why: str, status: Mapping[str, Any]) -> None:
            nonlocal told
            text = screen_text(source, wish, why, status) if live.console.is_terminal else why or "driving"
            if text == told:  # 20 times a second the same is too much for a slow connection
                return
            told = text
            if live.console.is_terminal:
                live.update(Text.from_ansi(text), refresh=True)
            else:
                print(text, flush=True)

        yield show


def screen_text(source: Source, wish: Wish, why: str, status: Mapping[str, Any]) -> str:
    """Return the lines that a person sees who drives."""
    from wayfarer.cli.status_text import battery_text, health_text

    left, right = status.get("wheels") or (0.0, 0.0)
    wheels = painted(f"they stand: {why}", "warning") if why else f"left {left:+.2f}, right {right:+.2f}"
    lines = {
        status["rover"]: f"driven by {source.driver}",
        "press": painted(source.help, "quiet"),
        "asked": f"ahead {wish.forward:+.2f}, turn {wish.turn:+.2f}",
        "wheels": wheels,
        "health": health_text(status),
        "battery": battery_text(status),
    }
    return "\n".join(f"{name:<9} {text}" for name, text in lines.items() if text)
