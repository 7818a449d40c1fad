"""The help of every command, on a terminal of 80 columns."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer

from tests.conftest import Run
from wayfarer import cli
from wayfarer.cli.help_texts import error_text


def commands(group: Any = None, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every command and group by its words."""
    command = group or typer.main.get_command(cli.app)
    yield path
    for name, each in getattr(command, "commands", {}).items():
        yield from commands(each, (*path, name))


@pytest.mark.parametrize("command", list(commands()), ids=lambda words: " ".join(words) or "wayfarer")
def test_help_fits_80_columns_and_has_none_of_the_librarys_notation(
    run: Run, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = run(*command, "--help")
    assert (code, err) == (0, "")
    assert run(*command, "-h")[1] == out
    assert f"Usage: {' '.join(('wayfarer', *command))} " in out
    assert not re.search(r"<\w|\w>(?!=)|\[\[|[{}…]", out)
    assert max(map(len, out.splitlines())) <= 80


def test_help_still_says_what_a_value_is_and_what_it_may_be(run: Run) -> None:
    _, out, _ = run("sim", "--help")
    assert re.search(r"--physics +light\|mujoco ", out)
    assert re.search(r"--seed +N ", out)
    assert re.search(r"--spl +Compute", out), "a switch has no value"


def test_examples_are_lines_without_gaps(run: Run) -> None:
    lines = [line.strip() for line in run("replay", "--help")[1].splitlines()]
    first = lines.index("Examples:") + 1
    assert all(line.startswith("wayfarer replay") for line in lines[first : first + 3])


@pytest.mark.parametrize(
    ("epilog", "example"),
    [
        (None, ""),
        ("Exit code: 0 if all is well.", ""),
        ("Exit code: 0 if all is well.\nExamples:\nwayfarer try 1", ", for example: wayfarer try 1"),
        ("Examples:\nwayfarer try 1\nwayfarer try 2", ", for example: wayfarer try 1"),
    ],
)
def test_what_is_missing_is_told_with_the_first_example_if_there_is_one(epilog: str | None, example: str) -> None:
    app = typer.Typer()

    @app.command(epilog=epilog)
    def _needs(number: int) -> None: ...

    with pytest.raises(typer.TyperException) as missing:
        typer.main.get_command(app)([], standalone_mode=False)
    assert error_text(missing.value) == f"Missing argument 'number'{example or '.'}"
