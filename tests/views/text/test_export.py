"""Where an export is written, and what it never destroys."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.views.text.records import HEADER, drive, write
from wayfarer.errors import BadInput
from wayfarer.views.text.export import export

FORMS = ["csv", "tsv", "mcap"]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write(tmp_path / "run", [HEADER, *drive(0.0, 1.0)])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("through", ["itself", "a symlink"])
def test_pipe_is_refused_even_by_force_and_stays(run: Path, tmp_path: Path, form: str, through: str) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    with pytest.raises(BadInput, match=r"^[^\n]* is no ordinary file [^\n]*$"):
        export(run, form, pipe if through == "itself" else link, overwrite=True)
    assert pipe.is_fifo()
    assert link.is_symlink()
    assert {path.name for path in tmp_path.iterdir()} == {"run", "pipe", "link"}


@pytest.mark.parametrize("form", FORMS)
def test_symlink_is_written_through(run: Path, tmp_path: Path, form: str) -> None:
    link, target = tmp_path / "link", tmp_path / "target"
    target.write_text("old", encoding="utf-8")
    link.symlink_to(target)
    export(run, form, link, overwrite=True)
    assert link.is_symlink()
    assert target.stat().st_size > 100
    assert {path.name for path in tmp_path.iterdir()} == {"run", "link", "target"}


def test_path_that_cannot_be_looked_at_is_told_in_one_line(run: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"cannot be written: File name too long; check the folder"):
        export(run, "csv", tmp_path / ("long" * 100), overwrite=False)
