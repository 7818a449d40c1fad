"""Where an export is written, and what it never destroys; the layouts for other tools name only what it has."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.fieldlog.disks import files_no_longer_than
from tests.logview.records import HEADER, Json, drive, record, tick, write
from wayfarer.errors import BadInput
from wayfarer.export import ExportFormat, export
from wayfarer.export.mcap_plots import PLOTS
from wayfarer.export.tables import COLUMNS
from wayfarer.extras import NEEDS


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write(tmp_path / "run", [HEADER, fix(0.0), *drive(0.0, 1.0)])


def fix(t_s: float) -> Json:
    return record("position", t_s, latitude_deg=51.0, longitude_deg=0.0, error_m=3.0)


@pytest.mark.parametrize("form", ExportFormat)
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


@pytest.mark.parametrize("form", ExportFormat)
def test_output_that_is_refused_more_room_is_one_line_and_leaves_nothing_behind(
    run: Path, tmp_path: Path, form: ExportFormat, capfd: pytest.CaptureFixture[str]
) -> None:
    out, before = tmp_path / "out", b"the one before"
    out.write_bytes(before)
    refused = r"^[^\n]*out cannot be written: File too large; check the folder[^\n]*$"
    with files_no_longer_than(200), pytest.raises(BadInput, match=refused):
        export(run, form, out, overwrite=True)
    assert {path.name for path in tmp_path.iterdir()} == {"run", "out"}
    assert out.read_bytes() == before
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("place", "said"),
    [("nowhere/out.csv", "No such file or directory"), ("long" * 100, "File name too long"), ("", "exists already")],
)
def test_place_that_cannot_be_is_told_in_one_line(run: Path, tmp_path: Path, place: str, said: str) -> None:
    with pytest.raises(BadInput, match=rf"^[^\n]*{said}[^\n]*$"):
        export(run, ExportFormat.csv, tmp_path / place, overwrite=True)


@pytest.mark.parametrize("form", ExportFormat)
def test_what_a_format_needs_has_an_extra(form: ExportFormat) -> None:
    assert form.needs is None or form.needs in NEEDS


LAYOUTS = Path(__file__).parents[2] / "docs" / "layouts"


def test_foxgloves_panels_show_channels_and_fields_that_are_exported() -> None:
    text = (LAYOUTS / "foxglove.json").read_text(encoding="utf-8")
    for topic, field in re.findall(r'"value": "(/\w+)\.(\w+)(?:\.@derivative)?"', text):
        assert field in PLOTS[topic].fields
    layout = json.loads(text)
    assert len(re.findall(r'"value": "/', text)) == 15
    placed = re.findall(r'"(?:first|second)": "([^"]+)"', text)
    assert sorted(placed) == sorted(layout["configById"])


def test_foxgloves_scene_and_log_are_exported() -> None:
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    from foxglove import Context

    from wayfarer.export.mcap import Channels

    topics = Channels(Context()).by_topic.keys()
    panels = json.loads((LAYOUTS / "foxglove.json").read_text(encoding="utf-8"))["configById"]
    assert {*panels["3D!map"]["topics"], panels["RosOut!log"]["topicToRender"]} <= topics


def test_plotjugglers_curves_are_columns_of_the_csv_table() -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    curves = list(root.iter("curve"))
    timed = [each.attrib["name"] for each in curves if "curve_x" not in each.attrib]
    crossed = [each.attrib[axis] for each in curves for axis in ("curve_x", "curve_y") if axis in each.attrib]
    assert len(timed) == 10
    assert len(crossed) == 2
    assert {*timed, *crossed} <= set(COLUMNS)
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.attrib["count"]) == len(splitter) == len(splitter.attrib["sizes"].split(";"))
