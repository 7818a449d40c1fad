"""What a person sees of a run in the terminal of its daemon; colour stays away if nobody wants it."""

from __future__ import annotations

import time
from io import StringIO

import pytest

from tests.logview.records import (
    BEGAN_WALL_S,
    HEADER,
    Json,
    drive,
    event,
    narrated,
    numbered,
    outcome,
    read,
    record,
    tick,
)
from wayfarer.fieldlog.wording import Tone
from wayfarer.logview.narrator import Console, Verbosity
from wayfarer.logview.terminal import COLOURS, painted


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def test_terminal_gets_the_tones_colour_and_a_pipe_none() -> None:
    assert painted("fail", "fault", Terminal()) == "\x1b[1;31mfail\x1b[0m"
    assert painted("fail", "fault", StringIO()) == "fail"
    assert painted("fail", "plain", Terminal()) == "fail"


@pytest.mark.parametrize(("name", "value"), [("NO_COLOR", "1"), ("TERM", "dumb")])
def test_owner_of_the_terminal_may_want_none(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(name, value)
    assert painted("fail", "fault", Terminal()) == "fail"


def test_every_tone_of_a_line_but_the_plain_one_has_a_colour() -> None:
    assert {tone.value for tone in Tone} - COLOURS.keys() == {"plain"}


def said(*records: Json) -> list[str]:
    lines: list[str] = []
    console = Console("Say go", lines.append)
    for each in numbered(records):
        console.show(read(each))
    return lines


def clock(t_s: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(BEGAN_WALL_S + t_s))


def test_line_has_the_wall_time_and_the_words_of_the_log() -> None:
    records = [
        HEADER,
        event("armed", 2.0, "Armed: drives towards 123 degrees"),
        tick(3.0, phase="back_off", why="anomaly"),
    ]
    words = [line.text for line in narrated(records, Verbosity.CHANGES)]
    assert said(*records) == [f"{clock(t_s)}  {text}" for t_s, text in zip((0.0, 2.0, 3.0), words, strict=True)]
    assert said(*records)[1] == f"{clock(2.0)}  Armed: drives towards 123 degrees"


def test_rover_that_does_the_same_is_told_once() -> None:
    records = drive(0.0, 200.0)
    assert any(line.tone is Tone.QUIET for line in narrated(records, Verbosity.STATUS)), "a viewer shows more"
    assert len(said(*records)) == 1


def test_rover_that_is_ready_is_told_with_what_to_do() -> None:
    assert said(event("opened", 1.0, parts=[]))[-1] == f"{clock(1.0)}  disarmed. Say go"


@pytest.mark.parametrize(("reason", "lines"), [("mission_time", 1), ("failed", 0)])
def test_end_is_told_unless_the_command_tells_its_error(reason: str, lines: int) -> None:
    assert len(said(outcome(6.0) | {"reason": reason})) == lines


def test_end_says_which_command_comes_next() -> None:
    lines: list[str] = []
    console = Console("Say go", lines.append, then="wayfarer logs summary")
    for each in (HEADER | {"log": "/my logs/00001"}, outcome(6.0)):
        console.show(read(each))
    assert lines[-1] == "Next: wayfarer logs summary '/my logs/00001'"


def test_positions_are_not_shown() -> None:
    assert said(record("position", 1.0, latitude_deg=52.0, longitude_deg=13.0, error_m=3.0)) == []
