"""Every command of the documentation runs, and prints what the page shows.

Those that cannot run here are checked against the command line.
"""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import click
import pytest
import typer

from tests.conftest import Run
from tests.docs import transcripts
from tests.docs.pages import PAGES, ROOT, SHELL, Fence, fences, inline_commands, shell_lines, wayfarer_words
from wayfarer import cli

LANGUAGES = {*SHELL, "python", "pycon", "toml", "ini", "json", "text"}
# Instead of what a page says: what comes out is the business of other tests.
FEW = {"sim": ["--trials", "2"], "sweep": ["--trials", "1"]}
SHORT = ["--budget-m", "5"]  # metres: some tenths of a trial
PLAIN = {"cp"}  # what else a page may do in a test


@pytest.mark.parametrize("page", PAGES)
def test_module_that_a_page_runs_is_there(page: str) -> None:
    named = re.findall(r"\bpython3? -m ((?:benchmarks|docs|tests)[\w.]*)", (ROOT / page).read_text(encoding="utf-8"))
    paths = {name: ROOT / name.rstrip(".").replace(".", "/") for name in named}
    runs = {name for name, path in paths.items() if path.with_suffix(".py").exists() or (path / "__main__.py").exists()}
    assert {*paths} == runs


@pytest.mark.parametrize("page", PAGES)
def test_every_block_names_its_language(page: str) -> None:
    assert {fence.language for fence in fences(page)} <= LANGUAGES


@pytest.mark.parametrize("page", PAGES)
def test_data_and_python_in_a_page_are_valid(page: str) -> None:
    for fence in fences(page):
        if fence.language == "toml":
            tomllib.loads(fence.body)
        if fence.language == "python":
            ast.parse(fence.body)


def test_driver_of_a_part_on_a_serial_line_runs_as_the_page_shows_it() -> None:
    (shown,) = (fence.body for fence in fences("docs/how-to/your-own.md") if fence.language == "python")
    exec(shown, {"__name__": "shown"})


# -- those that run ----------------------------------------------------------------------------------------------------


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own_folders: Path) -> Path:
    """What a reader has in front of him: a checkout, without the results of others."""
    for name in ("examples", "wayfarer"):
        (tmp_path / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / "field_logs", tmp_path / "field_logs")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0})  # no processes: trials run in this one
    return tmp_path


def quick(words: list[str]) -> list[str]:
    """Return a command with few trials that end soon."""
    if words[0] not in FEW:
        return words
    if "--trials" in words:
        at = words.index("--trials")
        words = [*words[:at], *words[at + 2 :]]
    return [*words, *(() if "--trial" in words else FEW[words[0]]), *(() if "--budget-m" in words else SHORT)]


def blocks_that_run(page: str) -> list[Fence]:
    return [fence for fence in fences(page) if fence.language in SHELL and fence.why_not is None]


def write_files(page: str, folder: Path) -> None:
    """Write the files that a page shows."""
    for fence in fences(page):
        if fence.file:
            (folder / fence.file).write_text(fence.body, encoding="utf-8")


@pytest.mark.process
@pytest.mark.parametrize("page", [page for page in PAGES if blocks_that_run(page)])
def test_commands_of_a_page_run_one_after_the_other_and_print_what_it_shows(
    page: str, run: Run, checkout: Path
) -> None:
    write_files(page, checkout)
    for fence in blocks_that_run(page):
        if fence.language == "console":
            stale = transcripts.stale(fence, checkout, transcripts.environment(checkout))
            assert not stale, f"{page} shows what is not printed any more:\n{stale}"
        else:
            for line in shell_lines(fence):
                run_quickly(line, run)


def run_quickly(line: str, run: Run) -> None:
    if "--spl" in line:
        pytest.importorskip("skfmm", reason="scikit-fmm is not installed: pip install '.[hardware]'")
    commands = list(wayfarer_words(line))
    if not commands:
        assert line.partition(" ")[0] in PLAIN, f"{line}: say why it is not run, or let it run"
        subprocess.run(["bash", "-c", line], check=True)
    for words in commands:
        code, _, errors = run(*quick(words))
        assert code == 0, f"{line}: {errors}"


# -- those that do not -------------------------------------------------------------------------------------------------


@cache
def program() -> Any:
    return typer.main.get_command(cli.app)


def command_of(words: list[str]) -> tuple[Any, list[str]]:
    """Return a command by its words, and the words that are its arguments."""
    command = program()
    while words and (inner := hasattr(command, "commands") and command.get_command(None, words[0])):
        command, words = inner, words[1:]
    return command, words


@pytest.mark.parametrize("page", PAGES)
def test_commands_that_no_test_runs_are_understood(page: str) -> None:
    """Arguments of the right kind, none missing, none too many."""
    marked = [fence for fence in fences(page) if fence.language in SHELL and fence.why_not is not None]
    for line in (line for fence in marked for line in shell_lines(fence)):
        for words in wayfarer_words(line):
            command, arguments = command_of(words)
            if hasattr(command, "commands"):  # an option of the program, which acts when it is read
                assert arguments[0].startswith("-"), f"{line}: no such command"
                continue
            try:
                command.make_context(command.name, list(arguments))
            except click.exceptions.Exit:  # --help, --version
                pass
            except click.UsageError as error:
                pytest.fail(f"{line}: {error.format_message()}")


@pytest.mark.parametrize("page", PAGES)
def test_commands_in_sentences_have_the_options_that_they_name(page: str) -> None:
    """Of commands in blocks too: a short name or a hidden one is shown to nobody."""
    lines = [line for fence in fences(page) if fence.language in SHELL for line in shell_lines(fence)]
    in_blocks = [words for line in lines for words in wayfarer_words(line)]
    for words in (*inline_commands(page), *in_blocks):
        command, arguments = command_of(words)
        assert words[0].startswith("-") or len(arguments) < len(words), f"wayfarer {' '.join(words)}"
        shown = {name for each in command.params if not each.hidden for name in (*each.opts, *each.secondary_opts)}
        named = {word.partition("=")[0] for word in arguments if word.startswith("--")}
        assert named <= {*shown, "--help"}, f"wayfarer {' '.join(words)}"
