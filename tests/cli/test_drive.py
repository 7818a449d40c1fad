"""``wayfarer drive``: what keys and a gamepad ask for, and the loop that tells the daemon."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import nullcontext
from typing import Any, NamedTuple

import pytest

from wayfarer import cli
from wayfarer.cli.drive import screen_text
from wayfarer.cli.driving import loop
from wayfarer.cli.driving.gamepad import (
    ABS_X,
    ABS_Y,
    BTN_START,
    BTN_TL,
    EV_ABS,
    EV_KEY,
    EV_SYN,
    SYN_DROPPED,
    Gamepad,
    GamepadState,
    is_gamepad,
    open_gamepad,
)
from wayfarer.cli.driving.keys import IDLE_S, Keys
from wayfarer.cli.driving.loop import GIVE_UP_S, Driving
from wayfarer.cli.driving.wish import Source, Wish
from wayfarer.daemon.socket.protocol import Refused
from wayfarer.errors import BadInput, WayfarerError

EXPIRY_S = 0.3


# -- keys ------------------------------------------------------------------------------------------------------------


def pressed(*texts: str) -> tuple[float, float]:
    """What a terminal's characters ask for, read one after the other."""
    keys = Keys(EXPIRY_S)
    for text in texts:
        keys.take(text, 1.0)
    wish = keys.wish(1.0)
    assert wish is not None
    return wish.forward, wish.turn


@pytest.mark.parametrize(
    ("texts", "asked"),
    [
        (("w",), (0.5, 0.0)), (("s",), (-0.5, 0.0)), (("a",), (0.0, -0.5)), (("d",), (0.0, 0.5)),
        (("\x1b[A",), (0.5, 0.0)), (("\x1bOB",), (-0.5, 0.0)), (("\x1b[C",), (0.0, 0.5)), (("\x1b[D",), (0.0, -0.5)),
        (("\x1b", "[", "D"), (0.0, -0.5)),  # a slow connection cuts a sequence anywhere
        (("9w",), (0.9, 0.0)), (("0", "w"), (1.0, 0.0)), (("wwd",), (0.0, 0.5)),
        (("w", " "), (0.0, 0.0)), (("www www",), (0.0, 0.0)), (("wq",), (0.0, 0.0)),
        (("A",), (0.0, 0.0)), (("D\x1b[Zx\t\x00é",), (0.0, 0.0)),
    ],
)  # fmt: skip
def test_each_key_drives_its_way_and_a_stop_comes_before_all(
    texts: tuple[str, ...], asked: tuple[float, float]
) -> None:
    assert pressed(*texts) == pytest.approx(asked)


def test_key_counts_once_and_is_taken_back_when_it_was_not_repeated() -> None:
    keys = Keys(EXPIRY_S)
    keys.take("w", 10.0)
    assert keys.wish(10.0) == Wish(0.5, 0.0, 10.0)
    assert all(keys.wish(10.0 + age_s) is None for age_s in (0.05, 0.1, 0.2, 0.29)), "nothing is made up"
    assert keys.wish(10.31) == Wish(0.0, 0.0, 10.31)
    assert keys.wish(10.31 + IDLE_S / 2) is None
    assert keys.wish(10.32 + IDLE_S) is not None, "the lease is kept"


def test_keys_that_waited_for_the_daemons_answer_drive_nothing_but_a_stop_counts() -> None:
    keys = Keys(EXPIRY_S)
    keys.take("www", 12.0, since_s=10.0)
    assert keys.wish(12.0) == Wish(0.0, 0.0, 12.0)
    keys.take("w", 12.05, since_s=12.0)
    assert keys.wish(12.05) == Wish(0.5, 0.0, 12.05)
    keys.take("w ", 15.0, since_s=12.05)
    assert keys.wish(15.0) == Wish(0.0, 0.0, 15.0)
    keys.take("q", 19.0, since_s=15.0)
    assert keys.is_over


def test_speed_is_shown_before_it_drives() -> None:
    keys = Keys(EXPIRY_S)
    assert "speed, now 50 %" in keys.help
    keys.take("0", 1.0)
    assert "speed, now 100 %" in keys.help


@pytest.mark.parametrize("key", ["q", "\x04", "wwq"])
def test_keys_end_it(key: str) -> None:
    keys = Keys(EXPIRY_S)
    keys.take(key, 0.0)
    assert keys.is_over


# -- a gamepad: evdev's own classes, and what a pad of the kernel tells ----------------------------------------------

evdev = pytest.importorskip("evdev", reason="evdev is not installed")


class Pad:
    """A pad as evdev's ``InputDevice``, of which the test has the other end; ``path`` is that of an event device."""

    path = "/dev/input/event7"

    def __init__(self) -> None:
        self.axes = {code: evdev.AbsInfo(127, 0, 255, 0, 0, 0) for code in (ABS_X, ABS_Y)}
        self.keys: list[int] = []
        self.gone = False

    def absinfo(self, code: int) -> Any:
        return self.axes[code]

    def active_keys(self) -> list[int]:
        return self.keys


def event(type_: int, code: int, value: int) -> Any:
    return evdev.InputEvent(0, 0, type_, code, value)


def state(*events: Any, held: bool = True) -> GamepadState:
    pad = Pad()
    found = GamepadState(pad.axes, [BTN_TL] if held else [])
    for each in events:
        found.take(each)
    return found


@pytest.mark.parametrize(
    ("x", "y", "asked"),
    [
        (127, 127, (0.0, 0.0)), (127, 0, (1.0, 0.0)), (127, 255, (-1.0, 0.0)), (255, 127, (0.0, 1.0)),
        (0, 127, (0.0, -1.0)), (127, 122, (0.0, 0.0)), (133, 128, (0.0, 0.0)), (127, 64, (0.472, 0.0)),
        (127, -900, (1.0, 0.0)),
    ],
)  # fmt: skip
def test_stick_is_scaled_and_has_a_dead_zone(x: int, y: int, asked: tuple[float, float]) -> None:
    wish = state(event(EV_ABS, ABS_X, x), event(EV_ABS, ABS_Y, y)).wish(1.0)
    assert (wish.forward, wish.turn) == pytest.approx(asked, abs=0.001)


def test_nothing_drives_without_the_shoulder_button() -> None:
    pad = state(event(EV_ABS, ABS_Y, 0), held=False)
    assert pad.wish(1.0) == Wish(0.0, 0.0, 1.0)
    pad.take(event(EV_KEY, BTN_TL, 1))
    assert pad.wish(2.0) == Wish(1.0, 0.0, 2.0)
    pad.take(event(EV_KEY, BTN_TL, 0))
    assert pad.wish(3.0) == Wish(0.0, 0.0, 3.0)
    pad.take(event(EV_KEY, BTN_START, 1))
    assert pad.is_over


def test_pad_whose_events_were_lost_is_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = Pad()
    pad.fd = 0  # type: ignore[attr-defined]
    monkeypatch.setattr("select.select", lambda *_: ([0], [], []))
    pad.keys = [BTN_TL]
    driving = Gamepad(pad)
    pad.read = lambda: [event(EV_ABS, ABS_Y, 0)]  # type: ignore[attr-defined]
    driving.wait(0.0)
    assert driving.wish(1.0) == Wish(1.0, 0.0, 1.0)
    assert driving.wish(1.01) is None
    pad.keys = []  # its button was let go, in what was lost
    pad.read = lambda: [event(EV_SYN, SYN_DROPPED, 0)]  # type: ignore[attr-defined]
    driving.wait(0.0)
    assert driving.wish(2.0) == Wish(0.0, 0.0, 2.0)


def test_pad_that_is_unplugged_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = Pad()
    pad.fd = 0  # type: ignore[attr-defined]

    def read() -> None:
        raise OSError(19, "No such device")

    pad.read = read  # type: ignore[attr-defined]
    monkeypatch.setattr("select.select", lambda *_: ([0], [], []))
    with pytest.raises(WayfarerError, match="event7: the gamepad has gone"):
        Gamepad(pad).wait(0.0)


def test_gamepad_is_known_from_a_keyboard_by_what_it_has() -> None:
    codes = evdev.ecodes
    pad = {codes.EV_KEY: [codes.BTN_SOUTH, codes.BTN_TL], codes.EV_ABS: [codes.ABS_X, codes.ABS_Y]}
    assert is_gamepad(pad)
    assert not is_gamepad({codes.EV_KEY: [codes.KEY_A]})
    assert not is_gamepad({codes.EV_KEY: [codes.BTN_LEFT], codes.EV_ABS: [codes.ABS_X, codes.ABS_Y]})  # a touchpad


def test_where_there_is_no_gamepad_is_said(tmp_path: Any) -> None:
    with pytest.raises(BadInput, match="cannot be opened"), open_gamepad(str(tmp_path / "event0")):
        pass


# -- the loop ----------------------------------------------------------------------------------------------------------


class Asked(NamedTuple):
    at_s: float
    request: Mapping[str, object]


class Daemon:
    """A daemon that takes or refuses samples, and a clock that goes on with each wait."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 100.0
        self.asked: list[Asked] = []
        self.refuses: str | None = None
        self.dies = False
        monkeypatch.setattr(loop, "now_s", lambda: self.now_s)

    def __call__(self, request: Mapping[str, object]) -> dict[str, Any]:
        self.asked.append(Asked(self.now_s, request))
        if self.dies:
            raise WayfarerError("the daemon closed the connection")
        match request["do"]:
            case "manual_begin":
                return {"lease": 7, "deadman_s": 0.3, "mode": "manual"}
            case "manual_drive" if self.refuses:
                raise Refused(self.refuses)
            case "manual_drive":
                return {"wheels": [0.4, 0.4], "why_not": ""}
            case "status":
                return {"rover": "sim", "battery_v": 12.34, "conditions": ["compass_stale"], "motor_faults": []}
        return {"mode": "armed"}

    def samples(self) -> list[Mapping[str, object]]:
        return [request for _, request in self.asked if request["do"] == "manual_drive"]


class Played(Keys):
    """Keys that are pressed at their times, after so many waits the person ends."""

    def __init__(self, daemon: Daemon, waits: int, **keys: str) -> None:
        super().__init__(EXPIRY_S)
        self.daemon, self.waits, self.keys = daemon, waits, keys

    def wait(self, for_s: float) -> None:
        self.daemon.now_s += for_s
        self.waits -= 1
        self.take(self.keys.get(f"at{self.waits}", ""), self.daemon.now_s)
        self.is_over |= self.waits == 0


def test_loop_numbers_its_samples_and_ends_what_it_began(monkeypatch: pytest.MonkeyPatch) -> None:
    daemon = Daemon(monkeypatch)
    source: Source = Played(daemon, 40, at20="w", at19="w", at10="d")
    shown: list[str] = []
    end = Driving(
        daemon, source, lambda wish, why, status: shown.append(screen_text(source, wish, why, status))
    ).drive()
    assert end == {"mode": "armed"}
    samples = daemon.samples()
    assert [sample["seq"] for sample in samples] == list(range(1, len(samples) + 1))
    assert samples[0]["forward"] == 0.0, "first that everything was let go"
    assert sum(sample["forward"] == 0.5 for sample in samples) == 2
    assert daemon.asked[0].request == {"do": "manual_begin", "driver": "keys"}
    assert daemon.asked[-1].request == {"do": "manual_end", "lease": 7}
    assert any("asked     ahead +0.50, turn +0.00" in text for text in shown)
    assert "left +0.40, right +0.40" in shown[-1]
    assert "12.3 V" in shown[-1]
    assert "the compass is silent" in shown[-1]


def test_loop_gives_up_where_every_sample_is_refused_and_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    daemon = Daemon(monkeypatch)
    daemon.refuses = "this client does not drive any more"
    with pytest.raises(Refused, match="does not drive any more"):
        Driving(daemon, Played(daemon, 1000), lambda *_: None).drive()
    assert daemon.now_s - 100.0 == pytest.approx(GIVE_UP_S, abs=0.3)
    assert daemon.asked[-1].request["do"] == "manual_end"


def test_loop_whose_daemon_or_pad_has_gone_ends_with_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    daemon = Daemon(monkeypatch)

    class Unplugged(Played):
        def wait(self, for_s: float) -> None:
            super().wait(for_s)
            daemon.dies = self.waits < 5
            if self.waits == 1:
                raise WayfarerError("the gamepad has gone")

    with pytest.raises(WayfarerError, match="closed the connection"):
        Driving(daemon, Unplugged(daemon, 10), lambda *_: None).drive()


def test_ctrl_c_says_that_it_stopped(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(_: Driving) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("wayfarer.cli.driving.keys.terminal_keys", lambda _: nullcontext(Keys(EXPIRY_S)))
    monkeypatch.setattr("wayfarer.daemon.socket.client.Connection", nullcontext)
    monkeypatch.setattr(Driving, "drive", interrupted)
    assert cli.run(["drive"]) == 130
    assert "stopped; wayfarer status shows whether a mission is held" in capsys.readouterr().out


def test_keys_without_a_terminal_are_refused_in_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stdin, "isatty", lambda: False, raising=False)
    assert cli.run(["drive"]) == 2
    assert "driving by keys needs a terminal; without one, use a gamepad" in capsys.readouterr().err
    assert cli.run(["drive", "--device", "x"]) == 2
