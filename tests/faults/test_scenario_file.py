"""Scenario files: what is right is read, what is wrong is told in one line with file, scenario and key."""

from __future__ import annotations

from functools import partial
from math import inf
from pathlib import Path

import pytest

from tests.config import rover_texts
from wayfarer.errors import BadInput
from wayfarer.simhal.faults.bus import Nack
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.physics import Depth
from wayfarer.testing.scenario import (
    FILE_BYTES,
    Command,
    Expectation,
    ResponseLevel,
    Scenario,
    read_scenarios,
    rover_of,
)

GOOD = """\
[[scenario]]
name = "loose-plug"
rover = "forestrover"
depth = "bus"
algorithm = "forest-pledge"
for_s = 30.0
seed = 3
[scenario.settings.safety]
start_delay_s = 1.0
[scenario.expect]
level = "S3"
within_s = 5.3
causes = ["compass_lost"]
[[scenario.fault]]
at_s = 15.0
target = "compass"
kind = "nack"
chance = 0.5
[[scenario.fault]]
at_s = 16.0
for_s = 2.0
target = "motion"
kind = "dark"
[[scenario.command]]
at_s = 0.0
do = "arm"
heading_deg = 90.0
"""
LEAST = """\
[[scenario]]
name = "least"
fault = [{ at_s = 1.0, target = "world", kind = "slip" }]
expect = { level = "-" }
"""


def read(folder: Path, text: str | bytes) -> tuple[Scenario, ...]:
    path = folder / "faults.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_scenarios(path)


complaint = partial(rover_texts.complaint, name="faults.toml", read=read, error=BadInput)


def test_scenario_is_read_with_all_that_it_says(tmp_path: Path) -> None:
    (scenario,) = read(tmp_path, GOOD)
    assert (scenario.name, scenario.depth, scenario.for_s, scenario.seed) == ("loose-plug", Depth.BUS, 30.0, 3)
    assert scenario.expect == Expectation(ResponseLevel.FAULT, 5.3, ("compass_lost",))
    assert scenario.faults == (
        Fault(15.0, inf, "compass", "nack", Nack(0.5)),
        Fault(16.0, 2.0, "motion", "dark"),
    )
    assert scenario.commands == (Command(0.0, "arm", 90.0),)
    assert rover_of(scenario).safety.start_delay_s == 1.0


def test_least_scenario_has_defaults_for_the_rest(tmp_path: Path) -> None:
    (scenario,) = read(tmp_path, LEAST)
    assert scenario.about == "world slip from 1 s on"
    assert scenario.row is None
    assert [command.do for command in scenario.commands] == ["arm"]


def test_rover_file_is_looked_for_beside_the_scenario(tmp_path: Path) -> None:
    body = "length_m = 0.4\nwidth_m = 0.4\ntrack_m = 0.5\nmax_speed_m_s = 1.4\n"
    (tmp_path / "mine.toml").write_text(f'name = "mine"\n[vehicle]\n{body}', encoding="utf-8")
    text = LEAST.replace('name = "least"', 'name = "least"\nrover = "mine.toml"\ndepth = "device"')
    (scenario,) = read(tmp_path, text)
    assert rover_of(scenario).name == "mine"


BAD = {
    "mistyped key of a fault": (
        'kind = "nack"',
        'knd = "nack"',
        "unknown key 'fault.knd'; did you mean 'kind'?",
    ),
    "mistyped kind": ('"nack"', '"nak"', "key 'fault.kind': unknown kind of fault 'nak': did you mean nack"),
    "no kind": ('kind = "nack"\n', "", "key 'fault.kind' is missing"),
    "kind that is no text": ('"nack"', "3", "unknown kind of fault '3'"),
    "wrong target": (
        '"compass"\nkind',
        '"contact"\nkind',
        "key 'fault.target' = 'contact': 'nack' applies to compass, motion or motors",
    ),
    "parameter out of range": ("chance = 0.5", "chance = 2.0", "allowed is 0 to 1"),
    "mistyped parameter": ("chance", "chanse", "unknown key 'fault.chanse'; did you mean 'chance'?"),
    "parameter of another kind": (
        'kind = "dark"',
        'kind = "dark"\nchance = 1.0',
        "unknown key 'fault.chance'",
    ),
    "second fault": ("for_s = 2.0", "for_s = 4e3", "allowed is above 0 to 3600"),
    "fault after the end": ("at_s = 16.0", "at_s = 30.0", "the scenario is over at for_s = 30"),
    "command after the end": ("at_s = 0.0", "at_s = 31.0", "the scenario is over at for_s = 30"),
    "time that is no number": ("at_s = 15.0", "at_s = nan", "allowed is 0 to 3600"),
    "setting that is not there": ("start_delay_s", "start_delay", "unknown key 'settings.safety.start_delay'"),
    "setting that the rover refuses": ("start_delay_s = 1.0", "tick_late_s = 0.03", "key 'control_hz' = 20: too slow"),
    "level": ('"S3"', '"S7"', "key 'expect.level' = 'S7': input should be '-', 'S0'"),
    "no bound": ("within_s = 5.3\n", "", "key 'expect.within_s' is missing"),
    "mistyped key of what is expected": (
        "causes",
        "cause",
        "unknown key 'expect.cause'; did you mean 'causes'?",
    ),
    "cause that is a number": (
        'causes = ["',
        'causes = [1, "',
        "key 'expect.causes.0' = 1: input should be a valid string",
    ),
    "rover": ('"forestrover"', '"forestrovr"', "key 'rover': unknown rover 'forestrovr': did you mean forestrover"),
    "rover file": ('"forestrover"', '"./no.toml"', "no.toml: no such file"),
    "algorithm": ('"forest-pledge"', '"pledg"', "unknown algorithm 'pledg'"),
    "command": ('"arm"', '"go"', "key 'command.do' = 'go': input should be 'arm', 'disarm'"),
    "wires without drivers": ('"bus"', '"device"', "kind 'nack' happens on a bus: it needs depth \"bus\""),
    "name that is no folder": ('"loose-plug"', '"../up"', "key 'name' = '../up': string should match"),
    "one pair of brackets": ("[[scenario]]", "[scenario]", "write [[scenario]], in double brackets"),
    "mistyped table": ("[[scenario]]", "[[scenari]]", "unknown key 'scenari'; did you mean 'scenario'?"),
    "fault that is no list": ("[[scenario.fault]]\nat_s = 15", "[scenario.fault]\nat_s = 15", "not valid TOML"),
}


@pytest.mark.parametrize(("old", "new", "says"), BAD.values(), ids=BAD)
def test_what_is_wrong_is_one_line_with_key_and_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in GOOD
    assert says in complaint(tmp_path, GOOD.replace(old, new, 1))


def test_number_that_a_part_does_not_measure_is_refused(tmp_path: Path) -> None:
    text = GOOD.replace('"nack"\nchance = 0.5', '"offset"\nof = "quality"')
    assert "a compass measures t_s, heading_deg, pitch_deg or roll_deg" in complaint(tmp_path, text)


def test_part_that_the_rover_has_not_is_refused(tmp_path: Path) -> None:
    text = GOOD.replace('"compass"\nkind = "nack"\nchance = 0.5', '"contact"\nkind = "silent"')
    assert "rover 'forestrover' has no [parts.contact]" in complaint(tmp_path, text)


WHOLE = {
    "empty": ("", "no [[scenario]] in the file; allowed are 1 to 100"),
    "too many": (LEAST * 101, "101 [[scenario]] in the file"),
    "same name": (LEAST + LEAST, "key 'name' = 'least': there is another of that name"),
    "another key": ("a = 1", "unknown key 'a'; a file has [[scenario]] tables only"),
    "no UTF-8": (b"\xff", "cannot be read: 'utf-8' codec"),
    "no TOML": ("[[scenario", "not valid TOML"),
    "huge": ("#" * (FILE_BYTES + 1), "it has more than 1,000,000 bytes"),
    "no name": ("[[scenario]]", "key 'name' is missing"),
    "no fault": (LEAST.replace('{ at_s = 1.0, target = "world", kind = "slip" }', ""), "key 'fault' = []"),
    "fault that is a text": (
        LEAST.replace('{ at_s = 1.0, target = "world", kind = "slip" }', '"slip"'),
        "key 'fault.0' = 'slip': input should be a table",
    ),
    "list of numbers": ("scenario = [1]", "write [[scenario]], in double brackets"),
}


@pytest.mark.parametrize(("text", "says"), WHOLE.values(), ids=WHOLE)
def test_file_that_is_no_scenario_file_is_refused(tmp_path: Path, text: str | bytes, says: str) -> None:
    assert says in complaint(tmp_path, text)


@pytest.mark.parametrize("name", ["", "no.toml", "\0"], ids=["folder", "nothing", "no name"])
def test_file_that_cannot_be_read_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadInput):
        read_scenarios(tmp_path / name)
