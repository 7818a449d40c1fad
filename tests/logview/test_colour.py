"""Colour means something, and stays away where nobody wants it."""

from __future__ import annotations

from io import StringIO

import pytest

from wayfarer.fieldlog.wording import Tone
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
