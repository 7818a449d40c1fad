"""The person at the terminal, for checks and calibration: questions are asked beside the event loop, not on it."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

import typer

from wayfarer.drivers.worker import Worker

T = TypeVar("T")

PATIENCE_S = 3600.0  # a person who calibrates may walk around the rover between two questions
INTERRUPTED = 130  # as a shell reports a command that SIGINT ended


class Terminal:
    """Implements ``calibrate.Person``."""

    def __init__(self) -> None:
        self._questions = Worker("the person at the terminal", PATIENCE_S)

    async def say(self, text: str) -> None:
        """Show a line."""
        print(text)

    async def ask(self, question: str) -> bool:
        """Return the answer to a question of yes or no; Enter alone is a no."""
        return await self._questions.call(lambda: typer.confirm(question))

    async def number(self, question: str, default: float) -> float:
        """Return the answer to a question for a number."""
        return await self._questions.call(lambda: float(typer.prompt(question, default=default, type=float)))

    async def wait(self, text: str) -> None:
        """Show what is to be done, and return when Enter is pressed."""
        await self._questions.call(lambda: typer.prompt(f"{text} [Enter]", default="", show_default=False))


def with_a_person(run: Callable[[], Coroutine[Any, Any, T]]) -> T:
    """Run a coroutine that may ask questions; Ctrl-C ends it and the process, even while a question waits."""
    import asyncio

    try:
        return asyncio.run(run())
    except KeyboardInterrupt:
        print("\nwayfarer: interrupted; the wheels are stopped", file=sys.stderr, flush=True)
        os._exit(INTERRUPTED)  # a thread that reads the terminal would keep the interpreter from ending


def is_there() -> bool:
    """Tell whether a person sits at the terminal."""
    return sys.stdin.isatty() and sys.stdout.isatty()
