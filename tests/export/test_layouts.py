"""The layouts for Foxglove and PlotJuggler name only what an export has."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from wayfarer.export.mcap_plots import PLOTS
from wayfarer.export.tables import COLUMNS

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
