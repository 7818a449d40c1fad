"""The pages for people: their fences, the commands in them, and what is said of those that a page's test cannot run."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for glob in ("*.md", "benchmarks/*.md", "docs/*/*.md", "examples/**/README.md")
    for path in ROOT.glob(glob)
    if path.name != "CHANGELOG.md"
)
SHELL = {"bash", "console"}
_FENCE = re.compile(
    r"(?:`(?P<file>[\w.-]+)`:\n\n)?^(?:<!-- (?:not run|compared by (?P<by>\S+)): (?P<why>[^\n]+) -->\n)?"
    r"(?P<indent> *)```(?P<language>[^\n]*)\n(?P<body>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
_INLINE = re.compile(r"(?<!`)`(?:sudo (?:-u wayfarer )?)?wayfarer ([^`]+)`(?!`)")


class Fence(NamedTuple):
    """A block of code: its language, its text, why the test of its page does not run it, and what compares it then.

    A block right after `` `NAME`: `` is what the reader has in a file of that name.
    """

    language: str
    body: str
    why_not: str | None
    compared_by: str | None
    file: str | None


def fences(page: str) -> list[Fence]:
    text = (ROOT / page).read_text(encoding="utf-8")
    return [
        Fence(each["language"], each["body"], each["why"], each["by"], each["file"]) for each in _FENCE.finditer(text)
    ]


def shell_lines(fence: Fence) -> Iterator[str]:
    """Yield the commands of a fence as one types them; in a ``console`` fence those after a prompt."""
    body = fence.body.replace("\\\n", " ")
    prompt = "$ " if fence.language == "console" else ""
    for line in (line.removeprefix(prompt) for line in body.splitlines() if line.startswith(prompt)):
        if command := re.sub(r"(^|\s)#.*", "", line).strip():
            yield command


def wayfarer_words(line: str) -> Iterator[list[str]]:
    """Yield the arguments of each ``wayfarer`` command in a line of a shell."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    for joins, found in groupby(lexer, lambda word: word in {"&&", "||", "|", ";"}):
        words = [] if joins else list(found)
        while words[:1] in (["sudo"], ["-u"]):
            words = words[1:] if words[0] == "sudo" else words[2:]
        if words[:1] == ["wayfarer"]:
            yield words[1:]


def inline_commands(page: str) -> list[list[str]]:
    """Return the ``wayfarer`` commands that stand in sentences; words in capitals stand for something else."""
    text = _FENCE.sub("", (ROOT / page).read_text(encoding="utf-8"))
    return [found.split() for found in _INLINE.findall(text)]
