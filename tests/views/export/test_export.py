"""Where an export is written, and what it never destroys."""

from __future__ import annotations

import os
import resource
from pathlib import Path
from pkgutil import resolve_name

import pytest

from tests.views.text.records import HEADER, drive, record, tick, write
from wayfarer.cli.extras import NEEDS
from wayfarer.cli.logs import FORMATS_HELP
from wayfarer.errors import BadInput
from wayfarer.fieldlog.reader import Record
from wayfarer.views.export.export import export
from wayfarer.views.export.formats import ExportFormat, Output

FILES = [form for form in ExportFormat if form.output is not Output.FOLDER]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write(tmp_path / "run", [HEADER, fix(0.0), *drive(0.0, 1.0)])


def fix(t_s: float) -> Record:
    return record("position", t_s, latitude_deg=51.0, longitude_deg=0.0, error_m=3.0)


@pytest.mark.parametrize("form", FILES)
@pytest.mark.parametrize("through", ["itself", "a symlink"])
def test_pipe_is_refused_even_by_force_and_stays(run: Path, tmp_path: Path, form: ExportFormat, through: str) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    with pytest.raises(BadInput, match=r"^[^\n]* is no ordinary file [^\n]*$"):
        export(run, form, pipe if through == "itself" else link, overwrite=True)
    assert pipe.is_fifo()
    assert link.is_symlink()
    assert {path.name for path in tmp_path.iterdir()} == {"run", "pipe", "link"}


@pytest.mark.parametrize("form", FILES)
def test_symlink_is_written_through(run: Path, tmp_path: Path, form: ExportFormat) -> None:
    link, target = tmp_path / "link", tmp_path / "target"
    target.write_text("old", encoding="utf-8")
    link.symlink_to(target)
    export(run, form, link, overwrite=True)
    assert link.is_symlink()
    assert target.stat().st_size > 100
    assert {path.name for path in tmp_path.iterdir()} == {"run", "link", "target"}


@pytest.mark.parametrize("form", FILES)
def test_file_is_there_whole_and_never_replaced_unasked(run: Path, tmp_path: Path, form: ExportFormat) -> None:
    out = tmp_path / "out"
    export(run, form, out, overwrite=False)
    content = out.read_bytes()
    write(run, [tick(1.0), fix(1.0)])
    with pytest.raises(BadInput, match="--force"):
        export(run, form, out, overwrite=False)
    assert out.read_bytes() == content
    export(run, form, out, overwrite=True)
    assert len(out.read_bytes()) > len(content)
    assert {path.name for path in tmp_path.iterdir()} == {"run", "out"}


@pytest.mark.parametrize("form", ExportFormat)
@pytest.mark.parametrize("lines", [[], [b"\0" * 100], [b'{"record": "tick"']])
def test_log_of_which_nothing_can_be_read_gives_no_file(tmp_path: Path, form: ExportFormat, lines: list[bytes]) -> None:
    run = write(tmp_path / "run", lines)
    with pytest.raises(BadInput, match="nothing in this log can be read"):
        export(run, form, tmp_path / "out", overwrite=False)
    assert {path.name for path in tmp_path.iterdir()} == {"run"}


@pytest.mark.parametrize("form", FILES)
def test_file_that_is_refused_more_room_is_one_line_and_leaves_nothing_behind(
    run: Path, tmp_path: Path, form: ExportFormat, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.write_bytes(b"the one before")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, limits[1]))
    try:
        with pytest.raises(BadInput, match=r"^[^\n]*out cannot be written: File too large; check the folder[^\n]*$"):
            export(run, form, out, overwrite=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert out.read_bytes() == b"the one before"
    assert {path.name for path in tmp_path.iterdir()} == {"run", "out"}
    assert capfd.readouterr() == ("", "")


def test_folder_that_is_refused_more_room_is_one_line_and_leaves_nothing_behind(run: Path, tmp_path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, limits[1]))
    try:
        with pytest.raises(BadInput, match=r"^[^\n]*out cannot be written: File too large; check the folder[^\n]*$"):
            export(run, ExportFormat.rosbag2, tmp_path / "out", overwrite=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert {path.name for path in tmp_path.iterdir()} == {"run"}


@pytest.mark.parametrize(
    ("place", "said"),
    [("nowhere/out.csv", "No such file or directory"), ("long" * 100, "File name too long"), ("", "is there already")],
)
def test_place_that_cannot_be_is_told_in_one_line(run: Path, tmp_path: Path, place: str, said: str) -> None:
    for form in (ExportFormat.csv, ExportFormat.rosbag2):
        with pytest.raises(BadInput, match=rf"^[^\n]*{said}[^\n]*$"):
            export(run, form, tmp_path / place, overwrite=True)


@pytest.mark.parametrize("form", ExportFormat)
def test_every_format_has_its_writer_and_what_it_needs(form: ExportFormat) -> None:
    assert callable(resolve_name(f"wayfarer.views.{form.writer}"))
    assert form.needs is None or form.needs in NEEDS
    assert form.meaning in FORMATS_HELP
