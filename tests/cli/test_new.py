"""``wayfarer new``: what it writes works as it is, and it overwrites nothing."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from tests.simhal.commands import succeed


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    return tmp_path


@pytest.mark.process
@pytest.mark.parametrize("kind", ["algorithm", "driver"])
def test_skeleton_passes_its_own_test_with_plain_pytest(kind: str, run: Run, tmp_path: Path) -> None:
    out = succeed(run, "new", kind, "left_needle")
    assert out.startswith(
        "wrote left_needle.py and test_left_needle.py; next:\n  pytest test_left_needle.py\n  wayfarer "
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_left_needle.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    for path in tmp_path.glob("*.py"):
        assert "LeftNeedle" in path.read_text()
        assert not re.search("my_algorithm|my_compass|MyCompass", path.read_text())


def test_algorithm_drives_as_it_is(run: Run) -> None:
    succeed(run, "new", "algorithm", "spiral_of_mine")
    out = succeed(run, "sim", "--algorithm", "spiral_of_mine.py", "--trials", "3", "--jobs", "1")
    assert "spiral_of_mine.py 100.0" in " ".join(out.split())


def test_driver_drives_at_bus_depth_as_it_is(run: Run) -> None:
    command = succeed(run, "new", "driver", "needle_of_mine").splitlines()[-1].split()
    out = succeed(run, *command[1:], "--trials", "1", "--jobs", "1")
    assert "forest-pledge 100.0" in " ".join(out.split())


@pytest.mark.parametrize("there", ["spiral_of_mine.py", "test_spiral_of_mine.py"])
def test_nothing_is_overwritten(run: Run, tmp_path: Path, there: str) -> None:
    (tmp_path / there).write_text("mine")
    assert f"{there} is there already; take another name" in refusal(run, "new", "algorithm", "spiral_of_mine")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("a-b", "'a-b' cannot be the name of a Python module"),
        ("../up", "'../up' cannot be"),
        ("class", "'class' cannot be"),
        ("9", "'9' cannot be"),
        ("_", "'_' cannot be"),
        ("random", "Python has a module random already"),
        ("wayfarer", "Python has a module wayfarer already"),
    ],
)
def test_name_that_no_file_can_have_is_refused(run: Run, tmp_path: Path, name: str, says: str) -> None:
    assert says in refusal(run, "new", "algorithm", name)
    assert not list(tmp_path.iterdir())
