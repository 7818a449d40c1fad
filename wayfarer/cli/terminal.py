"""The person at the terminal, for checks and calibration. Questions are asked in a thread, not on the event loop."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, TypeVar

import typer

from wayfarer.drivers.threaded import Worker
from wayfarer.errors import BadInput, NotResponding

T = TypeVar("T")

PATIENCE_S = 3600.0  # a person who calibrates may walk around the rover between two questions
# Ctrl-C, kill, and the end of an ssh session.
ENDED_BY = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Terminal:
    """Asks and informs the person at the terminal; implements ``commissioning.manual_drive.Operator``."""

    def __init__(self) -> None:
        self._questions = Worker("the person at the terminal", PATIENCE_S)

    async def say(self, text: str) -> None:
        """Show a line."""
        print(text)

    async def ask(self, question: str) -> bool:
        """Return the answer to a question of yes or no; Enter alone is a no; so is the end of the input, or an hour."""
        try:
            return bool(await self._questions.call(lambda: typer.confirm(question)))
        except (typer.Abort, EOFError, NotResponding):
            return False

    async def number(self, question: str, default: float) -> float:
        """Return the answer to a question for a number.

        Raises:
            BadInput: the input has ended.
        """
        return float(await self._answer(lambda: typer.prompt(question, default=default, type=float)))

    async def wait(self, text: str) -> None:
        """Show what is to be done, and return when Enter is pressed.

        Raises:
            BadInput: the input has ended.
        """
        await self._answer(lambda: typer.prompt(f"{text} [Enter]", default="", show_default=False))

    async def _answer(self, question: Callable[[], Any]) -> Any:
        try:
            return await self._questions.call(question)
        except (typer.Abort, EOFError):
            raise BadInput("no answer: the input has ended (Ctrl-D); begin this step again") from None
        except NotResponding:
            raise BadInput("no answer within an hour; begin this step again") from None


def run_interactive(run: Callable[[], Coroutine[Any, Any, T]]) -> T:
    """Run a coroutine that may ask questions.

    A signal cancels it, so that the code that drives the wheels can stop them, and ends the process even while a
    question waits for its answer.
    """
    import asyncio

    ended_by: list[int] = []

    async def main() -> T:
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        assert task is not None

        def end(number: int) -> None:
            ended_by.append(number)
            task.cancel()

        for number in ENDED_BY:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                loop.add_signal_handler(number, end, number)
        return await run()

    try:
        result = asyncio.run(main())
    except BaseException:
        if not ended_by:
            raise
    if ended_by:
        with suppress(OSError):  # the terminal may be what has gone
            print("\nwayfarer: interrupted; a stop was sent", file=sys.stderr, flush=True)
        os._exit(128 + ended_by[0])  # a thread that reads the terminal would keep the interpreter from ending
    return result


def is_interactive() -> bool:
    """Return whether a person sits at the terminal."""
    return sys.stdin.isatty() and sys.stdout.isatty()
