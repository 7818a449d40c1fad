"""What the pages say that wayfarer says is compared with it, and the comparison finds what is different."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from tests.docs.pages import PAGES, ROOT, Fence, fences
from tests.docs.transcripts import HOME, Shown, difference, printed, shown

# Neither a command nor what it prints: pictures in letters, and a line of /etc/fstab. The help is generated.
NO_TRANSCRIPTS = {"ARCHITECTURE.md", "docs/how-to/unattended.md"}
HELP = "docs/reference/command-line"
COMPARING = {  # which pages each one plays
    ".ci/run": {"README.md"},
    "tests/docs/test_drives.py": {"docs/tutorial/first-drive.md", "docs/tutorial/my-own-rover.md"},
}
MESSAGES = re.compile(r"^\| it says \|.*\n\|[-|]+\n((?:\|.*\n)+)", re.MULTILINE)


def test_what_commands_print_is_shown_in_console_blocks_only() -> None:
    pages = {page for page in PAGES if any(fence.language == "text" for fence in fences(page))}
    assert {page for page in pages if not page.startswith(HELP)} == NO_TRANSCRIPTS


@pytest.mark.parametrize("page", PAGES)
def test_each_console_block_is_compared(page: str) -> None:
    for fence in fences(page):
        assert fence.compared_by is None or page in COMPARING[fence.compared_by]
        if fence.language == "console":
            assert fence.compared_by or fence.why_not is None, f"not compared: {fence.body}"


@cache
def texts_of_the_program() -> set[str]:
    """Return all strings in its source but docstrings; of one with values in it, each part between them."""
    modules = (ast.parse(path.read_text(encoding="utf-8")) for path in (ROOT / "wayfarer").rglob("*.py"))
    nodes = [node for module in modules for node in ast.walk(module)]
    alone = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    constants = (node.value for node in nodes if isinstance(node, ast.Constant) and id(node) not in alone)
    return {value for value in constants if isinstance(value, str)}


def test_what_a_table_says_that_the_program_says_is_in_it() -> None:
    tables = [table for page in PAGES for table in MESSAGES.findall((ROOT / page).read_text(encoding="utf-8"))]
    said = re.findall(r"\*([^*]+)\*", "".join(re.sub(r"^\| (.*?) \|.*", r"\1", table, flags=re.M) for table in tables))
    assert len(said) > 15
    parts = {part for text in said for part in re.split(r"[ (]*\.\.\.[ )]*", text) if part}
    assert {part for part in parts if not any(part in text for text in texts_of_the_program())} == set()


# -- the comparison ----------------------------------------------------------------------------------------------------


def test_block_is_read_as_commands_with_what_they_print() -> None:
    fence = Fence("console", "still running\n$ wayfarer arm\narming\n$ wayfarer stop\n", None, None, None)
    assert shown(fence) == [
        Shown("", "still running\n"),
        Shown("wayfarer arm", "arming\n"),
        Shown("wayfarer stop", ""),
    ]


@pytest.mark.process
def test_commands_share_a_shell_and_errors_stand_where_the_terminal_shows_them(tmp_path: Path) -> None:
    assert printed(["a=1", "echo $a; echo 2 >&2; echo 3", "false"], tmp_path, {}) == ["", "1\n2\n3\n", ""]


@pytest.mark.parametrize(
    ("page", "terminal"),
    [
        ("path 76.1 m\n", "path 76.1 m  \n"),
        ("a\n...\nd\n", "a\nb\nc\nd\n"),
        ("...\nd\n...\n", "d\n"),
        (f"log {HOME}/field_logs/00002-20261129T070520Z\n", "log {}/field_logs/00002-20270101T000000Z\n"),
        ("07:05:20  run of sim, wayfarer 0.1.0\n", "23:59:59  run of sim, wayfarer 1.2.3+dev\n"),
        ("this run took 7.1 s, 22.4 us of CPU\n", "1 of 2 trials\n2 of 2 trials\nthis run took 9.9 s, 8.0 us of CPU\n"),
    ],
)  # fmt: skip
def test_what_differs_from_day_to_day_is_no_difference(tmp_path: Path, page: str, terminal: str) -> None:
    assert difference(page, terminal.format(tmp_path), tmp_path) == ""


@pytest.mark.parametrize(
    ("page", "terminal"),
    [
        ("path 76.1 m\n", "path 76.2 m\n"),
        ("a\n...\nd\n", "a\nb\nc\nd\ne\n"),
        ("a\n", "a\nb\n"),
        ("lasted 0:00:14\n", "lasted 0:00:15\n"),
        ("00002-20261129T070520Z\n", "00003-20261129T070520Z\n"),
    ],
)
def test_all_else_is(tmp_path: Path, page: str, terminal: str) -> None:
    assert f"+{terminal.splitlines()[-1]}" in re.sub("TIME", "20261129T070520Z", difference(page, terminal, tmp_path))


def test_in_real_time_numbers_may_differ_and_words_may_not(tmp_path: Path) -> None:
    page = "heading   2, pitch -1\ndoing     Probing (forest-pledge)\n"
    assert not difference(
        page, "heading   357, pitch +0\ndoing     Backing off (x), stalled\n", tmp_path, in_real_time=True
    )
    assert difference(page, page.replace("pitch", "tilt"), tmp_path, in_real_time=True)
