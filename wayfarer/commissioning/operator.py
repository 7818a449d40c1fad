"""The interface to the operator, the person beside the rover, for calibration and checks."""

from __future__ import annotations

from typing import Protocol


class Operator(Protocol):
    """Reads, answers, and moves the rover about. While one is waited for, the event loop runs on."""

    async def say(self, text: str) -> None:
        """Show a line."""

    async def ask(self, question: str) -> bool:
        """Return the answer to a question of yes or no."""

    async def number(self, question: str, default: float) -> float:
        """Return the answer to a question for a number."""

    async def note(self, question: str) -> str:
        """Return what the person wants to be noted, in a few words; nothing where they leave it out."""

    async def wait(self, text: str) -> None:
        """Show what is to be done, and return when the person says that it is."""
