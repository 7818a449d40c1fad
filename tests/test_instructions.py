"""The gate of instructions: what has grown is found, unless a commit says why, and what it is compared with."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from benchmarks.instructions import IMPORT, START, TICK, NotCompared, base_of, judge, reasons_since

BEFORE = {TICK: 100_000.0, IMPORT: 4e8, START: 3e9}


@pytest.mark.parametrize(
    ("now", "reasons", "grown"),
    [
        ({}, {}, []),
        ({TICK: 102_900.0, START: 2e9}, {}, []),
        ({TICK: 103_100.0}, {}, [TICK]),
        ({TICK: 103_100.0}, {IMPORT: "another figure's"}, [TICK]),
        ({TICK: 103_100.0}, {TICK: "it sees holes now"}, []),
        ({IMPORT: 5e8, START: 4e9}, {}, [IMPORT, START]),
    ],
)
def test_three_per_cent_need_a_reason(now: dict[str, float], reasons: dict[str, str], grown: list[str]) -> None:
    assert judge(BEFORE, {**BEFORE, **now}, reasons)[1] == grown


def test_table_has_the_reason_in_the_place_of_the_verdict() -> None:
    rows, _ = judge(BEFORE, {**BEFORE, TICK: 105_000.0, IMPORT: 5e8}, {TICK: "it sees holes now"})
    assert rows[0] == (TICK, "100,000", "105,000", "+5.00%", "it sees holes now")
    assert [row[-1] for row in rows[1:]] == ["**missed**", "met"]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    git(tmp_path, "init", "--quiet", "--initial-branch=main")
    return tmp_path


def git(root: Path, *arguments: str) -> str:
    who = ["-c", "user.name=A", "-c", "user.email=a@b"]
    return subprocess.run(
        ["git", *who, *arguments], cwd=root, capture_output=True, text=True, check=True
    ).stdout.strip()


def commit(root: Path, message: str) -> str:
    git(root, "commit", "--quiet", "--allow-empty", "-m", message)
    return git(root, "rev-parse", "HEAD")


@pytest.mark.process
def test_branch_is_compared_with_where_it_left_main_and_main_with_the_commit_before(checkout: Path) -> None:
    first, second = commit(checkout, "one"), commit(checkout, "two")
    assert base_of(checkout) == first
    git(checkout, "checkout", "--quiet", "-b", "work")
    commit(checkout, "three")
    commit(checkout, "four")
    assert base_of(checkout) == second


@pytest.mark.process
def test_clone_is_compared_with_what_its_origin_has(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    published = commit(checkout, "one")
    clone = tmp_path_factory.mktemp("clone")
    git(clone, "clone", "--quiet", str(checkout), ".")
    commit(clone, "two")
    commit(clone, "three")
    assert base_of(clone) == published


@pytest.mark.process
def test_without_history_nothing_is_compared(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    with pytest.raises(NotCompared, match="no git history"):
        base_of(tmp_path_factory.mktemp("unpacked"))
    commit(checkout, "one")
    with pytest.raises(NotCompared, match="the commit before"):
        base_of(checkout)


@pytest.mark.process
def test_reason_is_a_trailer_of_any_commit_since(checkout: Path) -> None:
    commit(checkout, "Before\n\nSlower-import: an older reason")
    base = git(checkout, "rev-parse", "HEAD")
    commit(checkout, "Holes\n\nThey are seen.\n\nSlower-tick: it sees holes now")
    commit(checkout, "Words that mention Slower-start: in a sentence")
    assert reasons_since(base, checkout) == {TICK: "it sees holes now"}
