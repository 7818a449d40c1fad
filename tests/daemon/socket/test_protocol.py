"""Requests are checked key by key, and a refusal says what would have been right; any other are the fuzzer's."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.daemon.socket.fake_daemon import FakeDaemon
from wayfarer.daemon.socket.protocol import (
    REPLY_BYTES,
    REQUEST_BYTES,
    RequestRefused,
    check,
    error_reply,
    ok_reply,
    perform,
    read_line,
)
from wayfarer.errors import BadInput, UnknownName


@pytest.mark.parametrize(
    ("request_", "told"),
    [
        ({"do": "status"}, ("status",)),
        ({"do": "arm", "asked_s": 1}, ("arm", None)),
        ({"do": "arm", "asked_s": 1.5, "heading_deg": None, "north": None}, ("arm", None)),
        ({"do": "arm", "asked_s": 1, "heading_deg": 0}, ("arm", 0)),
        ({"do": "arm", "asked_s": 1, "heading_deg": 12.5, "north": "magnetic"}, ("arm", 12.5)),
        ({"do": "disarm"}, ("disarm",)),
        ({"do": "resume", "asked_s": 1}, ("resume",)),
        ({"do": "goal", "heading_deg": 359.9}, ("goal", 359.9)),
        ({"do": "goal", "heading_deg": 2.0, "north": "true"}, ("goal", 358.5)),
        ({"do": "manual_begin", "asked_s": 1, "driver": "keys"}, ("manual_begin", "keys")),
        (
            {"do": "manual_drive", "lease": 2**53, "seq": 1, "forward": -1, "turn": 0.5, "sent_s": 12.5},
            ("manual_drive", 2**53, 1, -1, 0.5, 12.5),
        ),
        ({"do": "manual_end", "lease": 7}, ("manual_end", 7)),
        ({"do": "mark", "text": "hit log"}, ("mark", "hit log")),
        ({"do": "mark", "text": "ä" * 500}, ("mark", "ä" * 500)),
        ({"do": "stop"}, ("stop",)),
    ],
)
async def test_each_verb_is_its_method(
    request_: dict[str, object], told: tuple[object, ...], daemon: FakeDaemon
) -> None:
    await perform(check(request_), daemon, declination_deg=3.5, is_there=lambda: True)
    assert daemon.told == [told]


@given(heading_deg=st.floats(0, 360, exclude_max=True), declination_deg=st.floats(-180, 180))
@example(heading_deg=0.0, declination_deg=1e-20)
@example(heading_deg=10.0, declination_deg=10.0)
async def test_true_heading_is_the_magnetic_one_plus_the_declination(
    heading_deg: float, declination_deg: float
) -> None:
    daemon = FakeDaemon()
    request = check({"do": "arm", "asked_s": 1, "heading_deg": heading_deg, "north": "true"})
    await perform(request, daemon, declination_deg, lambda: True)
    ((_, magnetic_deg),) = daemon.told
    assert isinstance(magnetic_deg, float)
    assert 0 <= magnetic_deg < 360
    difference_deg = abs(magnetic_deg + declination_deg - heading_deg) % 360
    assert min(difference_deg, 360 - difference_deg) < 1e-9


async def test_true_north_without_a_declination_is_refused(daemon: FakeDaemon) -> None:
    request = check({"do": "goal", "heading_deg": 10.0, "north": "true"})
    with pytest.raises(RequestRefused, match="declination, which this rover's configuration does not give: set it"):
        await perform(request, daemon, declination_deg=None, is_there=lambda: True)
    assert daemon.told == []


HEADING = "heading_deg must be a number of degrees clockwise from north, 0 <= heading < 360, not "
TEXT = "text must be a text of 1 to 500 characters, not "
HEADINGS = [-0.1, 360, 360.0, 1e300, nan, inf, -inf, True, "12", [12], {}]


@pytest.mark.parametrize(
    ("do", "key", "value", "why"),
    [
        *((verb, "heading_deg", value, HEADING) for verb in ("arm", "goal") for value in HEADINGS),
        *(("mark", "text", value, TEXT) for value in ("", "  \n", "x" * 501, 7, ["x"])),
    ],
)
def test_impossible_value_is_refused_with_its_range(do: str, key: str, value: object, why: str) -> None:
    with pytest.raises(BadInput, match=why):
        check({"do": do, key: value} | ({"asked_s": 1} if do == "arm" else {}))


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({}, 'does not say what to "do": one of status, arm, disarm'),
        ({"do": 7}, 'does not say what to "do"'),
        ({"do": ["arm"]}, 'does not say what to "do"'),
        ({"do": "amr"}, "unknown verb 'amr': did you mean arm"),
        ({"do": "__class__"}, "unknown verb '__class__'"),
        ({"do": "arm", "headng": 1}, "unknown key of arm 'headng': did you mean heading_deg?"),
        ({"do": "stop", "text": "now"}, "unknown key of stop 'text': known: do"),
        ({"do": "goal"}, "goal needs heading_deg: a number of degrees"),
        ({"do": "goal", "heading_deg": None}, "goal needs heading_deg"),
        ({"do": "goal", "heading_deg": 1.0, "north": "grid"}, "north must be magnetic or true, not 'grid'"),
        ({"do": "goal", "heading_deg": 1.0, "north": ["true"]}, "north must be magnetic or true, not "),
        ({"do": "arm", "asked_s": 1, "north": "true"}, "north without heading_deg"),
        ({"do": "arm"}, "arm needs asked_s: a time in seconds of the rover's CLOCK_BOOTTIME, when the person asked"),
        ({"do": "resume", "asked_s": None}, "resume needs asked_s"),
        ({"do": "manual_begin", "driver": "keys"}, "manual_begin needs asked_s"),
        ({"do": "resume", "asked_s": -1.0}, "asked_s must be a time in seconds of the rover's CLOCK_BOOTTIME"),
        ({"do": "resume", "asked_s": nan}, "asked_s must be a time"),
        ({"do": "resume", "asked_s": "now"}, "asked_s must be a time"),
        ({"do": "resume", "asked_s": True}, "asked_s must be a time"),
        ({"do": "mark"}, "mark needs text: a text of 1 to 500 characters"),
    ],
)
def test_wrong_request_is_refused_with_what_is_right(fields: dict[str, object], why: str) -> None:
    with pytest.raises(BadInput) as refusal:
        check(fields)
    assert why in str(refusal.value)


@pytest.mark.parametrize("fields", [{"do": "x" * 60_000}, {"do": "arm", "y" * 60_000: 1}])
def test_name_of_any_length_gets_a_short_refusal(fields: dict[str, object]) -> None:
    with pytest.raises(UnknownName) as refusal:
        check(fields)
    assert len(str(refusal.value)) < 200


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"\n",
        b"arm",
        b"[]",
        b'"arm"',
        b"null",
        b'{"do": "arm"',
        b'{"do": NaN}',
        b"\xff\xfe",
        b"\0" * 9,
        b"[" * 60_000,
    ],
)
def test_line_without_an_object_is_refused_with_an_example(line: bytes) -> None:
    with pytest.raises(BadInput, match=r'not a JSON object: send one such as {"do": "status"}'):
        read_line(line)


@given(details=st.dictionaries(st.text().filter(lambda key: key != "ok"), st.text() | st.integers(-1000, 1000)))
def test_reply_is_one_line_that_gives_back_the_details(details: dict[str, Any]) -> None:
    line = ok_reply(details)
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 1
    assert msgspec.json.decode(line) == {"ok": True, **details}


def test_refusal_is_one_line_whatever_it_says() -> None:
    line = error_reply("first\nsecond \x1b[31m")
    assert line.count(b"\n") == 1
    assert msgspec.json.decode(line) == {"ok": False, "why": "first\nsecond \x1b[31m"}


def test_longest_request_there_is_fits_a_line() -> None:
    line = b'{"do": "mark", "text": "' + b"\\ud83e\\udd80" * 500 + b'"}'
    assert check(read_line(line)).keys == {"text": "\U0001f980" * 500}
    assert len(line) < REQUEST_BYTES


def test_answer_without_end_is_not_sent() -> None:
    with pytest.raises(RequestRefused, match="65536 is the limit"):
        ok_reply({"text": "x" * REPLY_BYTES})
