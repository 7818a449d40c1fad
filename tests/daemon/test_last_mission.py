"""The last mission: its metres and anomalies without those that a person drove, its file, and how its end is shown."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fieldlog.disks import power_cut_at
from tests.fieldlog.lines import standing
from tests.kit.workshop import own_details
from wayfarer.control.run_log import RunLog
from wayfarer.control.status_light import LastEnd
from wayfarer.control.tick import TickRecord
from wayfarer.daemon.last_mission import FILE_NAME, LastMission, MissionKeeper, read_last_mission
from wayfarer.errors import BadInput
from wayfarer.escape.api import Anomaly, Decision, Observation, Phase
from wayfarer.files import write_atomically
from wayfarer.hal import WheelCommand
from wayfarer.waiting_thread import OneCall

STUCK = (Anomaly.IMMOBILISED,)
RUN = "00017-20261121T061405Z"
CUT_OFF = LastMission(run=RUN, armed_t_wall=1.795e9)
OVER = replace(CUT_OFF, mission_s=754.0, mission_m=134.2, mission_anomalies=14, mission_ended="mission_radius")


class Site(RunLog):
    """A folder of logs in which a run keeps its missions, and what it has logged and told."""

    def __init__(self, logs: Path) -> None:
        self.logs = logs
        (logs / RUN).mkdir()
        self.events: list[tuple[str, dict[str, object]]] = []
        self.told: list[str] = []
        self.keeper = MissionKeeper(logs / RUN, self, self.told.append, lambda t_s: 1.795e9 + t_s)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take what is logged."""
        self.events.append((name, own_details(details)))

    @property
    def kept(self) -> LastMission | None:
        """What is in the file once everything is written."""
        self.keeper._writing.join()
        return read_last_mission(self.logs)


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path)


def at(t_s: float, mission_m: float, anomalies: tuple[Anomaly, ...] = (), *, by_hand: bool = False) -> TickRecord:
    """Return a tick of a mission that began at 1 s."""
    record = standing(t_s)
    record.observation = Observation(t_s, 0.0, 0.0, 0.0, anomalies, None, 0.0, 70.0)
    record.decision = Decision(WheelCommand(0.5, 0.5), Phase.MANUAL if by_hand else Phase.FOLLOW, "")
    record.mission_s, record.mission_m = t_s - 1.0, mission_m
    return record


def test_file_is_written_at_arming_and_at_the_end_with_metres_and_anomalies(site: Site) -> None:
    site.keeper.tick(at(0.0, 3.0, STUCK))
    assert site.kept is None
    site.keeper.event("armed", 1.0)
    assert site.kept == LastMission(run=RUN, armed_t_wall=1.795e9 + 1.0)
    for t_s, mission_m, anomalies in (
        (1.0, 0.0, ()),
        (2.0, 1.0, STUCK),
        (3.0, 2.5, STUCK),
        (4.0, 3.0, ()),
        (5.0, 4.0, STUCK),
    ):
        site.keeper.tick(at(t_s, mission_m, anomalies))
    site.keeper.event("disarmed", 5.5, reason="mission_time")
    site.keeper.tick(at(9.0, 70.0))
    totals = {"mission_s": 4.0, "mission_m": 4.0, "mission_anomalies": 2, "mission_ended": "mission_time"}
    assert site.events == [("mission_ended", totals)]
    assert site.kept == LastMission(run=RUN, armed_t_wall=1.795e9 + 1.0, **totals)  # type: ignore[arg-type]
    site.keeper.event("disarmed", 10.0, reason="requested by a person")
    site.keeper.close("requested", "requested by a person")
    assert len(site.events) == 1, "there was no mission any more"


def test_all_that_a_shell_finds_beside_the_file_are_runs(site: Site) -> None:
    """As in ``wayfarer logs check field_logs/*``."""
    site.keeper.event("armed", 1.0)
    assert site.kept is not None
    assert [path.name for path in site.logs.iterdir() if not path.name.startswith(".")] == [RUN]


def test_anomalies_that_a_person_drives_into_are_none_of_it(site: Site) -> None:
    site.keeper.event("armed", 1.0)
    for tick in (at(1.0, 0.0), at(2.0, 1.0), at(3.0, 1.0, STUCK, by_hand=True), at(4.0, 1.0), at(5.0, 2.0)):
        site.keeper.tick(tick)
    site.keeper.close("signal", "ended by SIGTERM")
    assert site.kept is not None
    assert (site.kept.mission_s, site.kept.mission_m, site.kept.mission_anomalies) == (4.0, 2.0, 0)
    assert site.kept.mission_ended == "signal"


def test_next_mission_replaces_the_last(site: Site) -> None:
    for began_s in (0.0, 100.0):
        site.keeper.event("armed", began_s)
        site.keeper.tick(at(began_s + 5.0, 2.0))
        site.keeper.event("disarmed", began_s + 5.0, reason="mission_distance")
    site.keeper.event("armed", 200.0)
    assert site.kept == LastMission(run=RUN, armed_t_wall=1.795e9 + 200.0)


@pytest.mark.parametrize(
    ("ended", "end"),
    [
        (None, LastEnd.UNFINISHED), ("mission_radius", LastEnd.OUT), ("escaped", LastEnd.OUT),
        ("left_bounds", LastEnd.OUT), ("mission_time", LastEnd.STOPPED), ("requested by a person", LastEnd.STOPPED),
        ("signal", LastEnd.STOPPED), ("fault: overturned", LastEnd.FAILED), ("failed", LastEnd.FAILED),
    ],
)  # fmt: skip
def test_light_tells_how_it_ended(ended: str | None, end: LastEnd) -> None:
    assert replace(OVER, mission_ended=ended).end is end


def test_text_tells_how_it_ended() -> None:
    assert OVER.text.endswith(f" (run {RUN}) is over after 754 s, 134 m, anomalies: 14: radius limit")
    assert OVER.text.startswith("The last mission of 2026-11-")
    assert CUT_OFF.text.endswith(f" (run {RUN}) was cut off: killed, or without power")


# -- the file --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", range(8))
def test_power_cut_at_any_moment_leaves_the_old_file_the_new_one_or_none(site: Site, call: int) -> None:
    """As it is written first, and as it is replaced. No other moment changes anything on the disk."""
    kept = []
    for mission in (CUT_OFF, OVER):
        content = MissionKeeper._line(mission)
        with power_cut_at(call):
            write_atomically(site.logs / FILE_NAME, content, mode=0o644)
        kept.append(read_last_mission(site.logs))
    assert kept[0] in (None, CUT_OFF)
    assert kept[1] in (kept[0], OVER)
    assert (call < 7) or kept == [CUT_OFF, OVER], "the last of these is after the last change"


@pytest.mark.parametrize("kind", ["symlink", "dead link", "folder", "pipe", "another user's", "long", "garbage"])
def test_file_that_is_none_of_this_user_s_is_not_read(
    site: Site, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    path, elsewhere = site.logs / FILE_NAME, tmp_path_factory.mktemp("elsewhere") / "file"
    elsewhere.write_bytes(MissionKeeper._line(OVER))
    match kind:
        case "symlink":
            path.symlink_to(elsewhere)
        case "dead link":
            path.symlink_to(elsewhere.parent / "nothing")
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "another user's":
            path.write_bytes(MissionKeeper._line(OVER))
            if os.geteuid() == 0:
                os.chown(path, 12345, -1)
            else:
                monkeypatch.setattr(os, "geteuid", lambda: 12345)
        case "long":
            path.write_bytes(b" " * 20_000)
        case "garbage":
            path.write_bytes(b'{"run": "x"}')
    with pytest.raises(BadInput, match=FILE_NAME):
        read_last_mission(site.logs)


def test_symlink_where_the_file_is_to_be_is_replaced_and_not_followed(
    site: Site, tmp_path_factory: pytest.TempPathFactory
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "file"
    elsewhere.write_text("mine", encoding="utf-8")
    (site.logs / FILE_NAME).symlink_to(elsewhere)
    site.keeper.event("armed", 0.0)
    assert site.kept is not None
    assert elsewhere.read_text(encoding="utf-8") == "mine"


def test_file_that_cannot_be_written_is_told_and_stops_nothing(site: Site) -> None:
    (site.logs / FILE_NAME).mkdir()
    site.keeper.event("armed", 0.0)
    site.keeper._writing.join()  # that of the end may be over before it
    site.keeper.close("requested", "enough")
    assert all("is not kept" in line and "\n" not in line for line in site.told)
    assert len(site.told) == 2


@given(st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_whatever_is_in_the_file_is_a_mission_or_refused(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    logs = tmp_path_factory.mktemp("logs")
    (logs / FILE_NAME).write_bytes(content)
    with pytest.raises(BadInput):
        read_last_mission(logs)


def test_thread_that_cannot_be_started_is_told_and_stops_nothing(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    """No log may raise: the run ended as its mission began, or a person's ``disarm`` failed."""

    def fails(_: OneCall) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(OneCall, "start", fails)
        site.keeper.event("armed", 0.0)
        site.keeper.event("disarmed", 1.0, reason="requested by a person")
        site.keeper.close("requested", "enough")
    assert site.told == ["this mission is not kept: can't start new thread"] * 2
    assert [name for name, _ in site.events] == ["mission_ended"]
