"""Logs of a rover whose sensors all speak, and the pages made of them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import unescape
from pathlib import Path
from typing import Any

from tests.logview import records
from tests.logview.records import Json, event, numbered, outcome, record, write
from tests.reports.outline import Outline
from wayfarer.reports.data import Line, RunData, read_run
from wayfarer.reports.panels import PANELS
from wayfarer.reports.run import write_run_report

HEADER: Json = records.HEADER | {
    "config": {
        "control_hz": 20.0, "vehicle": {"max_speed_m_s": 1.0}, "rates": {"compass_hz": 20.0, "motion_hz": 20.0},
        "detector": {"tilt_deg": 20.0, "quality_min": 0.2}, "safety": {"tick_late_s": 0.2},
        "board": {"battery_low_v": 11.0},
    },
}  # fmt: skip
OUTCOME = outcome(4.0)
ARMED = event("armed", 0.0, goal_heading_deg=0.0)
WORLD: Json = {
    "forest": 1, "noise": 0, "start_m": [25.0, 12.5], "heading_deg": 0.0, "goal_y_m": 50.0, "trunk_diameter_m": 0.3,
    "tree_radius_m": 0.25, "trunks_m": [[20.0, 20.0, 30.0, 22.0, "across"]], "trees_m": [[5.0, 30.0]],
}  # fmt: skip


def tick(at_s: float, **changes: Any) -> Json:
    """A tick of a rover that drives north at 1 m/s."""
    t_s = 100.0 + at_s
    usual: dict[str, Any] = {
        "compass": {"t_s": t_s, "heading_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0, "calibration": 3},
        "motion": {"t_s": t_s, "forward_m": 0.05, "right_m": 0.0, "quality": 0.9, "signed": True},
        "pitch_deg": 1.0, "roll_deg": -1.0, "side": 1, "applied_left": 1.0, "applied_right": 1.0,
        "north_m": at_s, "path_m": at_s, "mission_m": at_s,
    }  # fmt: skip
    return records.tick(at_s, **usual | changes)


def fix(at_s: float, north_m: float, error_m: float | None = 3.0) -> Json:
    return record("position", at_s, latitude_deg=47.0 + north_m / 111_320.0, longitude_deg=8.0, error_m=error_m)


def drive(ends_s: float = 4.0, begins_s: float = 0.0) -> list[Json]:
    return [tick(0.05 * step) for step in range(round(20 * begins_s), round(20 * ends_s))]


def episode() -> list[Json]:
    """Two seconds of following, a bump, a turn, a probe, and following again."""
    phases = [("follow", 40), ("back_off", 8), ("turn_away", 8), ("probe", 16), ("follow", 20)]
    names = [phase for phase, count in phases for _ in range(count)]
    ticks = [tick(0.05 * step, phase=phase) for step, phase in enumerate(names)]
    ticks[40]["anomalies"] = ["immobilised", "nose_up"]
    ticks[72]["why"] = "probe.realigned"
    return ticks


def by_time(*all_records: Json) -> list[Json]:
    return sorted(all_records, key=lambda each: float(each["t_s"]))


def simulated_drive() -> list[Json]:
    """A drive in a simulated forest, and where the rover truly was: a metre and a half a second to the north."""
    truth = [record("truth", 0.2 * step, x_m=25.0, y_m=12.5 + 0.3 * step, driven_m=0.3 * step) for step in range(20)]
    return [{**HEADER, "simulated": True, "world": WORLD}, *by_time(*drive(), *truth)]


def without(all_records: Iterable[Json], first: int, end: int) -> list[Json]:
    """Records with their numbers, and a part of them lost."""
    found = numbered(all_records)
    return found[:first] + found[end:]


def write_log(folder: Path, all_records: Iterable[Json], tail: bytes = b"") -> Path:
    """A log as the daemon writes it, which may end within a line."""
    given = list(all_records)
    write(folder, [{**each, **old} for each, old in zip(numbered(given), given, strict=True)])
    with (folder / "run.00001.jsonl").open("ab") as file:
        file.write(tail)
    return folder


def page_of(tmp_path: Path, *all_records: Json, tail: bytes = b"") -> str:
    return write_run_report(write_log(tmp_path / "00001-run", all_records, tail)).read_text(encoding="utf-8")


def data_of(tmp_path: Path, *all_records: Json) -> RunData:
    """What the page is made of, not drawn."""
    return read_run(write_log(tmp_path / "00001-run", all_records))


def check_page(page: str) -> None:
    """A page is whole, and asks no network for anything."""
    assert all(re.match(r"geo:|https://www\.openstreetmap\.org/", link) for link in Outline(page).links)
    assert "@import" not in bare(page)
    assert "url(" not in bare(page)


def line_of(name: str, data: RunData) -> Line | None:
    """A line of the time panels; None if the log does not have it."""
    (quantity,) = (each for panel in PANELS for each in panel.quantities if each.name == name)
    return quantity.line(data)


def bare(page: str) -> str:
    """The page without its scripts."""
    return re.sub(r"<script\b.*?</script>", " ", page, flags=re.DOTALL)


def drawn(page: str) -> str:
    """What the page gives to Bokeh."""
    found = re.search(r'<script type="application/json" id="plots">(.*?)</script>', page, flags=re.DOTALL)
    assert found
    return found[1]


def titles(page: str) -> list[str]:
    """The titles of the plots."""
    return [unescape(title) for title in re.findall(r'<p class="key"><b>(.*?)</b>', page)]


def text_of(page: str) -> str:
    """What a reader sees, without figures."""
    text = re.sub(r"<style\b.*?</style>", " ", bare(page), flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", text)).split())
