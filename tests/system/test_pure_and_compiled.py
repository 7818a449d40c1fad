"""A compiled core does what the same Python does, to the byte. It needs a compiled wayfarer: ``.ci/run`` makes one."""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(
        not [*ROOT.glob("wayfarer/control/controller.*.so")],
        reason="nothing is compiled here: .ci/run has a compiled copy",
    ),
]

RUN = "from wayfarer.cli import main; main()"
# Python's own finder takes a shared library before a source file; this one knows of source files only.
PURE = f"""
import sys
from importlib.machinery import SOURCE_SUFFIXES, FileFinder, SourceFileLoader

class SourcesOnly:
    def find_spec(self, name, path=None, target=None):
        folders = path if name.startswith("wayfarer.") else ()
        found = (FileFinder(folder, (SourceFileLoader, SOURCE_SUFFIXES)).find_spec(name) for folder in folders)
        return next((spec for spec in found if spec is not None), None)

sys.meta_path.insert(0, SourcesOnly())
import wayfarer.control.controller
assert wayfarer.control.controller.__file__.endswith(".py")
{RUN}
"""


def wayfarer(program: str, *arguments: str | Path) -> str:
    command = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def sums(folder: Path) -> dict[str, str]:
    """Of every result that says nothing of the day and the computer."""
    paths = [path for path in folder.rglob("*") if path.name in {"trials.csv", "run.00001.jsonl"}]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def test_the_two_are_what_their_names_say() -> None:
    assert "(pure Python)" in wayfarer(PURE, "--version")
    assert "(compiled)" in wayfarer(RUN, "--version")


def test_traceback_names_file_and_line_of_compiled_code() -> None:
    program = "from wayfarer.safety.gate import Gate; Gate(None, 20.0)"
    said = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False).stderr
    path, line = re.findall(r'File "(.*gate\.py)", line (\d+), in __init__', said)[-1]
    assert "settings." in (ROOT / path).read_text(encoding="utf-8").splitlines()[int(line) - 1]


@pytest.mark.parametrize(
    ("trials", "options"),
    [
        (6, ["--algorithm", "paper"]),
        (2, ["--algorithm", "paper", "--depth", "bus"]),
        (3, ["--ground", "mud"]),
        (3, ["--rover", "minirover", "--site", "dense-obstruction"]),
    ],
    ids=["ten algorithms", "bus depth", "on mud", "a site"],
)
def test_trials_are_the_same_to_the_byte(tmp_path: Path, trials: int, options: list[str]) -> None:
    for name, program in {"pure": PURE, "compiled": RUN}.items():
        wayfarer(program, "sim", *options, "--trials", str(trials), "--jobs", "1", "--out", tmp_path / name)
    pure = sums(tmp_path / "pure")
    assert pure
    assert sums(tmp_path / "compiled") == pure


def test_field_logs_are_the_same_to_the_byte_and_replay_in_both(tmp_path: Path) -> None:
    for name, program in {"pure": PURE, "compiled": RUN}.items():
        wayfarer(program, "sim", "--trials", "2", "--jobs", "1", "--log-dir", tmp_path / name)
    pure = sums(tmp_path / "pure")
    assert len(pure) == 2
    assert sums(tmp_path / "compiled") == pure
    for program in (PURE, RUN):
        for run in (tmp_path / "pure").iterdir():
            wayfarer(program, "replay", run)
        wayfarer(program, "replay", "--log-dir", ROOT / "field_logs")
