"""The report of one run, from whole logs and from what a power cut leaves of one."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import orjson
import pytest

from wayfarer.cli import report as command
from wayfarer.errors import BadInput
from wayfarer.views.run_report import drawing, words
from wayfarer.views.run_report.run import write_run_report

Record = dict[str, Any]


@pytest.fixture(autouse=True)
def _coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are not looked at here, and take long."""
    monkeypatch.setattr(drawing, "PNG_DPI", 20)


HEADER: Record = {
    "record": "run", "t_s": 100.0, "t_wall": 1_800_000_000.0, "schema": 2, "part": 1, "version": "0.1.0",
    "algorithm": "forest-pledge", "rover": "minirover", "seed": 7, "simulated": False, "dry_run": False,
    "config": {
        "control_hz": 20.0, "vehicle": {"max_speed_m_s": 1.0}, "rates": {"compass_hz": 20.0, "motion_hz": 20.0},
        "detector": {"tilt_deg": 20.0}, "safety": {"tick_late_s": 0.2}, "board": {"battery_low_v": 11.0},
    },
}  # fmt: skip
OUTCOME: Record = {
    "record": "outcome",
    "t_s": 104.0,
    "reason": "requested",
    "text": "somebody stopped it",
    "dropped": 0,
}
WORLD: Record = {
    "forest": 1, "noise": 0, "start_m": [25.0, 12.5], "heading_deg": 0.0, "goal_y_m": 50.0, "trunk_diameter_m": 0.3,
    "tree_radius_m": 0.25, "trunks_m": [[20.0, 20.0, 30.0, 22.0, "across"]], "trees_m": [[5.0, 30.0]],
}  # fmt: skip


def tick(at_s: float, **changes: Any) -> Record:
    """A tick of a rover that drives north at 1 m/s."""
    t_s = 100.0 + at_s
    return {
        "record": "tick", "t_s": t_s,
        "compass": {"t_s": t_s, "heading_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0, "calibration": 3},
        "motion": {"t_s": t_s, "forward_m": 0.05, "right_m": 0.0, "quality": 0.9, "signed": True}, "contact": None,
        "decision_t_s": t_s, "heading_deg": 0.0, "pitch_deg": 1.0, "roll_deg": -1.0, "anomalies": [],
        "goal_heading_deg": 0.0, "travelled_m": at_s, "phase": "follow", "why": "follow", "wanted_left": 1.0,
        "wanted_right": 1.0, "applied_left": 1.0, "applied_right": 1.0, "level": "well", "cause": None,
        "counter_deg": 0.0, "side": 1, "turn_deg": 0.0, "episodes": 0, "blocked_turns": 0,
    } | changes  # fmt: skip


def event(at_s: float, name: str, **details: Any) -> Record:
    return {"record": "event", "t_s": 100.0 + at_s, "name": name, **details}


ARMED = event(0.0, "armed", goal_heading_deg=0.0)


def fix(at_s: float, north_m: float, error_m: float | None = 3.0) -> Record:
    latitude_deg = 47.0 + north_m / 111_320.0
    return {
        "record": "position",
        "t_s": 100.0 + at_s,
        "latitude_deg": latitude_deg,
        "longitude_deg": 8.0,
        "error_m": error_m,
    }


def drive(seconds: float = 4.0) -> list[Record]:
    return [tick(0.05 * step) for step in range(round(20 * seconds))]


def episode() -> list[Record]:
    """Two seconds of following, a bump, a turn, a probe, and following again."""
    phases = [("follow", 40), ("back_off", 8), ("turn_away", 8), ("probe", 16), ("follow", 20)]
    names = [phase for phase, count in phases for _ in range(count)]
    ticks = [tick(0.05 * step, phase=phase) for step, phase in enumerate(names)]
    ticks[40]["anomalies"] = ["immobilised", "nose_up"]
    ticks[72]["why"] = "probe.realigned"
    return ticks


def without(records: Iterable[Record], first: int, end: int) -> list[Record]:
    """Records with their numbers, and a part of them lost."""
    numbered = [{**record, "n": number} for number, record in enumerate(records, start=1)]
    return numbered[:first] + numbered[end:]


def write_log(folder: Path, records: Iterable[Record], tail: bytes = b"") -> Path:
    """A log as the daemon writes it: numbered, with a wall clock."""
    numbered = (
        {
            "t_wall": record["t_s"] + 1_800_000_000.0 - 100.0,
            **({} if record["record"] == "run" else {"n": number}),
            **record,
        }
        for number, record in enumerate(records)
    )
    folder.mkdir(parents=True)
    (folder / "run.jsonl").write_bytes(b"".join(orjson.dumps(record) + b"\n" for record in numbered) + tail)
    return folder


def page_of(tmp_path: Path, *records: Record, tail: bytes = b"") -> str:
    return write_run_report(write_log(tmp_path / "00001-run", records, tail)).read_text(encoding="utf-8")


def text_of(page: str) -> str:
    """What a reader sees, without figures."""
    without = re.sub(r"<(style|svg)\b.*?</\1>", " ", page, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", without)).split())


class Outline(HTMLParser):
    """Every element that is opened is closed, in its order."""

    VOID = frozenset({"meta", "br"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.references += [value for name, value in attrs if name in ("src", "href", "xlink:href") and value]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def check_page(page: str) -> None:
    outline = Outline()
    outline.feed(page)
    assert outline.open == []
    assert all(re.match(r"#|figures/[\w-]+\.(png|svg)$", reference) for reference in outline.references)
    assert "@import" not in page
    assert not re.search(r"url\((?!#)", page)
    for svg in re.findall(r"<svg\b.*?</svg>", page, flags=re.DOTALL):
        ET.fromstring(svg)
        assert re.search(r'role="img" aria-label="[^"]{40,}"', svg)


def test_page_tells_what_ran_when_how_far_and_how_it_ended(tmp_path: Path) -> None:
    text = text_of(page_of(tmp_path, HEADER, ARMED, *drive(), OUTCOME))
    for told in (
        "requested: somebody stopped it", "rover minirover", "algorithm forest-pledge", "on the rover itself",
        "2027-01-15 08:00:00 UTC", "4.0 m by dead reckoning", "4 m from the start at bearing 0°", "00001-run: complete",
        "wayfarer 0.1.0", "seed 7",
    ):  # fmt: skip
        assert told in text, told


def test_page_is_whole_and_needs_nothing_else(tmp_path: Path) -> None:
    page = page_of(
        tmp_path, HEADER, *episode(), event(1.0, "mark", text="<script>alert('&')</script>"), fix(2.0, 1.0), OUTCOME
    )
    check_page(page)
    assert "<script" not in page


def test_figures_stand_beside_the_page_as_png_and_svg(tmp_path: Path) -> None:
    run = write_log(tmp_path / "1-run", [HEADER, *drive(), OUTCOME])
    out = tmp_path / "elsewhere" / "page.html"
    assert write_run_report(run, out) == out
    assert sorted(path.name for path in (tmp_path / "elsewhere" / "figures").iterdir()) == [
        "time-lines.png", "time-lines.svg", "track.png", "track.svg",
    ]  # fmt: skip
    assert sorted(path.name for path in run.iterdir()) == ["run.jsonl"]


def test_same_log_gives_the_same_bytes(tmp_path: Path) -> None:
    run = write_log(tmp_path / "1-run", [HEADER, *episode(), event(1.0, "hold"), fix(2.0, 1.0), OUTCOME])
    write_run_report(run, tmp_path / "a" / "page.html")
    write_run_report(run, tmp_path / "b" / "page.html")
    first, second = ({path.name: path.read_bytes() for path in (tmp_path / each).rglob("*.*")} for each in "ab")
    assert first == second
    assert len(first) == 5


def test_anomalies_and_episodes_are_counted_by_cause(tmp_path: Path) -> None:
    text = text_of(page_of(tmp_path, HEADER, *episode(), OUTCOME))
    assert "immobilised 1 50%" in text
    assert "nose up 1 50%" in text
    assert "1 0:00:02.0 right 1 1.6 1.6 probe.realigned" in text


def test_a_hold_interrupts_an_episode_and_arming_ends_it(tmp_path: Path) -> None:
    ticks = episode()
    for held in ticks[50:60]:
        held["phase"] = "halt"
    assert text_of(page_of(tmp_path / "held", HEADER, *ticks)).count("probe.realigned") == 1
    armed = [*ticks[:50], event(2.49, "armed", goal_heading_deg=0.0), *ticks[50:]]
    assert "1 0:00:02.0 right 1 0.5 0.4 armed 2 0:00:03.0" in text_of(page_of(tmp_path / "armed", HEADER, *armed))


def test_marks_are_numbered_in_list_map_and_time_lines(tmp_path: Path) -> None:
    marks = [event(1.0, "mark", text="hit log"), event(2.0, "mark", text="mud")]
    page = page_of(tmp_path, HEADER, *drive(1.0), marks[0], *drive()[20:40], marks[1], *drive()[40:], OUTCOME)
    assert "mark 1: hit log 0:00:02.0 mark 2: mud" in text_of(page)
    track, lines = re.findall(r"<svg\b.*?</svg>", page, flags=re.DOTALL)
    assert {">1</text>", ">2</text>"} <= set(re.findall(r">[12]</text>", track))
    assert ">2 mud</text>" in lines


def test_trouble_stands_out_and_an_operators_hold_does_not(tmp_path: Path) -> None:
    hold = event(1.0, "health", level="hold", cause="operator_hold")
    stale = event(2.0, "health", level="hold", cause="compass_stale")
    page = page_of(tmp_path, HEADER, *drive(), hold, stale, OUTCOME)
    assert re.findall(r"<strong>(.*?)</strong>", page) == ["health: hold, compass_stale"]


def test_sensors_are_told_by_rate_gap_and_failures(tmp_path: Path) -> None:
    ticks = drive()
    for deaf in ticks[20:40]:
        deaf["compass"] = ticks[19]["compass"]
    for blind in ticks[:8]:
        blind["motion"] = {**blind["motion"], "quality": 0.1}
    failed = event(1.5, "sensor_failed", sensor="compass", error="no answer", retry_in_s=0.1)
    text = text_of(page_of(tmp_path, HEADER, *ticks, failed, OUTCOME))
    assert "compass 60 14.9 20 1.05 1" in text
    assert "motion 80 20.0 20 0.05 10.0% 0" in text


def test_a_sensor_that_fell_silent_for_good_has_a_gap_up_to_the_end(tmp_path: Path) -> None:
    ticks = drive()
    for deaf in ticks[20:]:
        deaf["compass"] = ticks[19]["compass"]
    assert "compass 20 20.0 20 3.05 0" in text_of(page_of(tmp_path, HEADER, *ticks, OUTCOME))


def test_receiver_is_drawn_beside_dead_reckoning_and_told_apart(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, *drive(1.0), fix(1.0, 0.0), *drive()[20:], fix(3.0, 30.0, None), OUTCOME)
    assert "the receiver's fixes with their error" in text_of(page)
    assert "receiver's fixes</text>" in unescape(page)


def test_simulated_run_shows_the_forest_and_how_far_dead_reckoning_drifted(tmp_path: Path) -> None:
    truth = [
        {"record": "truth", "t_s": 100.0 + 0.2 * step, "x_m": 25.0, "y_m": 12.5 + 0.3 * step, "heading_deg": 0.0}
        for step in range(20)
    ]
    records = sorted([*drive(), *truth], key=lambda record: float(record["t_s"]))
    page = page_of(tmp_path, {**HEADER, "simulated": True, "world": WORLD}, *records, OUTCOME)
    check_page(page)
    assert "At the end they are 1.8 m apart" in text_of(page)
    assert "fallen trunk</text>" in page


@pytest.mark.parametrize("world", [None, [], {}, {**WORLD, "trunks_m": [[1, None]]}, {**WORLD, "start_m": "here"}])
def test_simulated_run_without_a_forest_says_so(tmp_path: Path, world: object) -> None:
    truth = {"record": "truth", "t_s": 100.0, "x_m": 25.0, "y_m": 12.5}
    page = page_of(tmp_path, {**HEADER, "simulated": True, "world": world}, truth, *drive(), OUTCOME)
    assert words.NO_FOREST in text_of(page)


def test_dry_run_is_told(tmp_path: Path) -> None:
    assert "dry run: the wheels were never driven" in text_of(page_of(tmp_path, {**HEADER, "dry_run": True}, *drive()))


# -- what a log may lack -----------------------------------------------------------------------------------------


def test_log_that_was_cut_off_says_so(tmp_path: Path) -> None:
    text = text_of(page_of(tmp_path, HEADER, *drive(), tail=b'{"record":"tick","n":81,"t_s":104.0,"comp'))
    assert "the log was cut off" in text
    assert "00001-run: 1 line is torn" in text


def test_log_without_ticks_says_so(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, event(0.1, "opened", parts=["compass"]), OUTCOME)
    check_page(page)
    assert words.NO_TICKS in text_of(page)
    assert words.NO_WAY in text_of(page)


def test_log_without_a_heading_still_has_time_lines(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, *(tick(0.05 * step, heading_deg=None) for step in range(40)), OUTCOME)
    assert words.NO_WAY in text_of(page)
    assert "speed, m/s</text>" in page
    assert "heading, °</text>" not in page


def test_log_without_anything_but_its_header_makes_a_page(tmp_path: Path) -> None:
    check_page(page_of(tmp_path, HEADER))


@pytest.mark.parametrize("content", [b"", b"hello\n", b"\0" * 500])
def test_log_of_which_nothing_can_be_read_is_refused(tmp_path: Path, content: bytes) -> None:
    run = write_log(tmp_path / "1-run", [], content)
    with pytest.raises(BadInput, match="nothing in this log can be read"):
        write_run_report(run)
    assert [path.name for path in run.iterdir()] == ["run.jsonl"]


def test_log_without_its_header_says_so(tmp_path: Path) -> None:
    assert "unknown: the log does not begin with what ran" in text_of(page_of(tmp_path, *drive()))


def test_missing_records_are_told_where_it_ended(tmp_path: Path) -> None:
    ended = "from the start at bearing 0°, by dead reckoning"
    assert "path is only partly known" not in text_of(page_of(tmp_path / "whole", HEADER, ARMED, *drive(), OUTCOME))
    one = text_of(page_of(tmp_path / "one", HEADER, *without([ARMED, *drive()], 30, 31)))
    assert f"{ended}; 1 record is missing, so the path is only partly known" in one
    many = text_of(page_of(tmp_path / "many", HEADER, *without([ARMED, *drive()], 20, 60)))
    assert f"{ended}; 40 records are missing, so the path is only partly known" in many
    assert "White diamonds: records are missing there." in many


def test_lost_beginning_is_no_start(tmp_path: Path) -> None:
    part = {**HEADER, "part": 2}
    late = page_of(tmp_path / "late", part, *without(drive(), 0, 40))
    assert "2 m from where the log begins at bearing 0°" in text_of(late)
    assert ">log begins</text>" in late
    assert ">start</text>" not in late
    assert "White diamonds" not in text_of(late)
    assert "from where the log begins at" in text_of(page_of(tmp_path / "headless", *without(drive(), 0, 40)))
    whole = page_of(tmp_path / "whole", HEADER, ARMED, *drive())
    assert ">start</text>" in whole
    assert ">log begins</text>" not in whole


def test_log_with_one_tick_makes_a_page(tmp_path: Path) -> None:
    check_page(page_of(tmp_path, HEADER, tick(0.0)))


def test_ticks_that_say_nothing_make_a_page(tmp_path: Path) -> None:
    bare = [{"record": "tick", "t_s": 100.0 + step} for step in range(3)]
    header = {"record": "run", "t_s": 100.0, "schema": 2}
    assert words.NO_TICKS in text_of(page_of(tmp_path / "even", header, *bare))
    check_page(page_of(tmp_path / "uneven", header, *bare, tick(3.01)))


def test_time_without_ticks_is_labelled_and_not_bridged(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, *drive(1.0), *(tick(31.0 + 0.05 * step) for step in range(20)), OUTCOME)
    assert "no ticks for 0:00:30.1</text>" in page


def test_lost_records_are_no_late_tick(tmp_path: Path) -> None:
    late = [*drive(1.0), tick(1.5), *(tick(1.55 + 0.05 * step) for step in range(20))]
    assert ">late</text>" in page_of(tmp_path / "late", HEADER, *late)
    numbered = [{**record, "n": number + (6 if number > 19 else 1)} for number, record in enumerate(late)]
    page = page_of(tmp_path / "lost", HEADER, *numbered)
    assert ">late</text>" not in page
    assert "5 records are missing" in text_of(page)


ODD: list[Record] = [
    {"heading_deg": "north", "phase": 7, "why": None, "anomalies": "touched", "level": ["hold"], "side": "left"},
    {"heading_deg": 1e300, "applied_left": None, "applied_right": "full", "counter_deg": {}, "travelled_m": None},
    {"compass": 5, "motion": [], "contact": {"t_s": None}, "anomalies": [None, "eaten", 3]},
    {"motion": {"forward_m": None}, "compass": {"t_s": "now"}, "pitch_deg": None, "roll_deg": -1e15, "phase": "dance"},
    {"motion": {"t_s": 1e12, "forward_m": 1e12, "right_m": 0.0, "quality": 1.0}, "mood": "cheerful", "cause": 4},
    {"motion": {"t_s": 101.0, "forward_m": 5e9, "right_m": 0.0, "quality": 1.0}}, {"t_s": 1e300}, {"t_s": -1e15},
]  # fmt: skip


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: next(iter(odd)) + "-" + str(len(odd)))
def test_odd_values_in_a_tick_never_break_the_page(tmp_path: Path, odd: Record) -> None:
    check_page(page_of(tmp_path, HEADER, *drive(1.0), {**tick(1.0), **odd}, *drive(3.0)[21:], OUTCOME))


@pytest.mark.parametrize(
    "header",
    [
        {"config": None}, {"config": {"control_hz": 0.0}},
        {"config": {"vehicle": None, "safety": [], "board": 3, "control_hz": "fast"}},
        {"rover": None, "algorithm": 3, "version": [], "seed": {}, "simulated": "yes"},
        {"t_wall": None}, {"t_wall": 1e300},
        {"rover": "\x1b[31m\x00\uffff<b>", "seed": "\x07"},
    ],
    ids=str,
)  # fmt: skip
def test_odd_values_in_the_header_never_break_the_page(tmp_path: Path, header: Record) -> None:
    check_page(page_of(tmp_path, HEADER | header, *drive(1.0), {**OUTCOME, "reason": None, "text": 4}))


def test_odd_records_of_every_kind_never_break_the_page(tmp_path: Path) -> None:
    odd = [
        event(0.2, ""), event(0.3, "mark"), event(0.4, "mark", text="\x1b[2J\n林 $x$ " + "long " * 100),
        event(0.5, "goal", goal_heading_deg=None), event(0.6, "sensor_failed"), event(0.7, "clock_step", by_s="much"),
        event(0.8, "armed", goal_heading_deg="home"), {**event(0.9, "x"), "name": None},
        {**fix(1.0, 0.0), "latitude_deg": None}, {**fix(1.1, 0.0), "latitude_deg": 99.0}, fix(1.2, 0.0, None),
        {"record": "board", "t_s": 101.0, "battery_v": None, "faults": None},
        {"record": "truth", "t_s": 101.0, "x_m": None}, {"record": "computer", "t_s": 101.0},
    ]  # fmt: skip
    check_page(page_of(tmp_path, HEADER, *drive(1.0), *odd, *drive()[20:], OUTCOME))


def test_folder_without_a_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"run\.jsonl"):
        write_run_report(tmp_path)


def test_report_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    run = write_log(tmp_path / "1-run", [HEADER, *drive(0.5)])
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match=r"cannot be written there: .*; name another file with --out"):
        write_run_report(run, tmp_path / "file" / "report.html")


# -- the command -------------------------------------------------------------------------------------------------


@pytest.fixture
def logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two runs; whoever asks stands beside folders that are named as they are called."""
    for number in (16, 17):
        write_log(tmp_path / "logs" / f"000{number}-20261121T061405Z", [HEADER, *drive(0.5), OUTCOME])
    for name in ("last", "17", "18"):
        (tmp_path / "here" / name).mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "logs"


@pytest.mark.parametrize(("what", "number"), [("16", 16), ("17", 17), ("last", 17)])
def test_runs_number_goes_before_a_folder_of_that_name(logs: Path, what: str, number: int) -> None:
    command.report(what, logs=logs)
    assert [page.parent.name[:5] for page in logs.rglob("report.html")] == [f"000{number}"]


@pytest.mark.parametrize("what", ["18", "./17"])
def test_folder_is_a_campaign_where_no_run_has_its_name(logs: Path, what: str) -> None:
    with pytest.raises(BadInput, match="campaign"):
        command.report(what, logs=logs)
    assert not list(logs.rglob("report.html"))


def test_what_is_neither_run_nor_folder_is_refused_with_the_runs_there_are(logs: Path) -> None:
    with pytest.raises(BadInput, match="00016-20261121T061405Z to 00017-20261121T061405Z"):
        command.report("19", logs=logs)


def test_command_writes_the_page_where_it_is_told(
    logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine" / "page.html"
    command.report("17", out=out, logs=logs)
    assert capsys.readouterr().out == f"the report is {out}\n"
    assert {path.name for path in out.parent.iterdir()} == {"page.html", "figures"}
    assert {path.name for path in logs.rglob("*") if path.is_file()} == {"run.jsonl"}
