"""Damaged copies of one log: no command ends by an error, and each view has the same losses and the same distance."""

from __future__ import annotations

import csv
import gzip
import io
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from random import Random

import pytest

from tests.export.readers import read
from tests.logview.records import RUN, SAMPLE_LOGS, Json, line, numbered
from wayfarer import cli
from wayfarer.export.mcap import write_mcap
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import Outcome
from wayfarer.logview.summary import summarise
from wayfarer.remote.live.model import PageModel
from wayfarer.reports.data import read_run

(SAMPLE,) = SAMPLE_LOGS.glob("00001-*")
HEADER, *DRIVEN = [
    record
    for each in (SAMPLE / "run.00001.jsonl").read_bytes().splitlines()
    if (record := json.loads(each))["record"] != "truth"
]
END_S = DRIVEN[220]["t_s"]  # after two episodes
RECORDS = [*DRIVEN[:220], DRIVEN[-1] | {key: DRIVEN[220][key] for key in ("t_s", "elapsed_s", "t_wall")}]
REAL: Json = HEADER | {"simulated": False, "world": None}  # so that a page draws dead reckoning
LINES = [line(each) for each in numbered([REAL, *RECORDS])]
TICKS = [index for index, each in enumerate(LINES) if b'"record":"tick"' in each]
MIDDLE = TICKS[len(TICKS) // 2]


def tick_with(**values: object) -> list[bytes]:
    """The log with other values in one tick, after it was written."""
    return [*LINES[:MIDDLE], line(json.loads(LINES[MIDDLE]) | values), *LINES[MIDDLE + 1 :]]


def later(by_s: float) -> list[bytes]:
    return tick_with(t_s=json.loads(LINES[MIDDLE])["t_s"] + by_s)


def flipped(count: int) -> list[bytes]:
    """The log with some bits flipped, behind its header."""
    content, rng = bytearray(b"".join(LINES)), Random(1)
    for _ in range(count):
        content[rng.randrange(len(LINES[0]), len(content))] ^= 1 << rng.randrange(8)
    return [bytes(content)]


def overwritten(with_: bytes) -> list[bytes]:
    """The log in which a block of the disk holds something else."""
    content, begin = b"".join(LINES), sum(map(len, LINES[:MIDDLE])) + 100
    return [content[:begin], with_, content[begin + len(with_) :]]


def put(*lines: bytes) -> list[bytes]:
    """The log with further lines in its middle."""
    return [*LINES[:MIDDLE], *lines, *LINES[MIDDLE:]]


COPIES: dict[str, Callable[[], list[bytes]]] = {
    "whole": lambda: LINES,
    "cut in the last line": lambda: [*LINES[:-1], LINES[-1][:-9]],
    "cut in the middle": lambda: [*LINES[:MIDDLE], LINES[MIDDLE][:200]],
    "one flipped bit": lambda: flipped(1),
    "flipped bits": lambda: flipped(30),
    "a block of NULs": lambda: overwritten(b"\0" * 4096),
    "NULs at the end": lambda: [*LINES, b"\0" * 4096],
    "a block of another file": lambda: overwritten(Random(2).randbytes(4096)),
    "a line twice": lambda: put(LINES[MIDDLE - 1]),
    "fifty lines twice": lambda: put(*LINES[MIDDLE - 50 : MIDDLE]),
    "two lines swapped": lambda: [*LINES[:MIDDLE], LINES[MIDDLE + 1], LINES[MIDDLE], *LINES[MIDDLE + 2 :]],
    "two blocks swapped": lambda: [
        *LINES[: MIDDLE - 30], *LINES[MIDDLE : MIDDLE + 30], *LINES[MIDDLE - 30 : MIDDLE], *LINES[MIDDLE + 30 :],
    ],
    "ten lines lost": lambda: [*LINES[:MIDDLE], *LINES[MIDDLE + 10 :]],
    "lines of other programs": lambda: put(b"what?\n", b'{"level":"info"}\n', b"[1,2]\n", b'{"record":"tick"}\n'),
    "a line of 10 MB": lambda: put(b'{"record":"event","text":"' + b"x" * 10_000_000 + b'"}\n'),
    "a text for a number": lambda: tick_with(heading_deg="north"),
    "a number that cannot be": lambda: tick_with(travelled_m=1e308),
    "a time far too late": lambda: later(1e6),
    "a time too early": lambda: later(-30.0),
    "a time that stands still": lambda: [line(json.loads(each) | {"t_s": END_S}) for each in LINES],
    "header of another form": lambda: put(line(REAL | {"part": 7, "schema": 3})),
    "carriage returns and a byte-order mark": lambda: [b"\xef\xbb\xbf", *(each[:-1] + b"\r\n" for each in LINES)],
    "packed": lambda: [gzip.compress(b"".join(LINES))],
    "header lost": lambda: LINES[1:],
    "header lost, and there again in the next part": lambda: [
        *LINES[1:MIDDLE], line(REAL | {"part": 2}), *LINES[MIDDLE:],
    ],
}  # fmt: skip


@pytest.fixture(params=COPIES)
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    folder = tmp_path / "logs" / RUN
    folder.mkdir(parents=True)
    (folder / "run.00001.jsonl").write_bytes(b"".join(COPIES[request.param]()))
    return folder


def test_every_view_has_the_same_losses_and_the_same_distance(run: Path, tmp_path: Path) -> None:
    reader = RunReader(run)
    found, damage, report, model = summarise(reader), reader.damage, read_run(run), PageModel()
    with (tmp_path / "run.mcap").open("wb") as file:
        assert write_mcap(run, file) == damage
    for record in RunReader(run):
        model.add(record)
    exported = read(tmp_path / "run.mcap").messages
    assert (report.damage, report.summary) == (damage, found)
    assert exported["/motion"][-1].value["path_m"] == found.reckoned_m
    north_m, east_m = report.ticks["north_m"][-1], report.ticks["east_m"][-1]
    assert exported["/pose"][-1].value["translation"] == {"x": east_m, "y": north_m, "z": 0.0}
    seen = [message for message in exported["/log"] if message.value["name"] == "anomaly"]
    counted = sum(count for _, count in model.state()["counts"])
    assert len(report.onsets) == len(seen) == counted == sum(found.anomalies.values())
    assert model.state()["place"][:2] == (round(east_m, 3), round(north_m, 3))


def test_no_command_ends_by_an_error_of_its_own_and_each_says_the_same_of_what_is_lost(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def use(*arguments: str, codes: tuple[int, ...] = (0,)) -> tuple[str, str]:
        assert cli.run([*arguments, "--log-dir", str(run.parent)]) in codes
        said = capsys.readouterr()
        assert "Traceback" not in said.out + said.err
        return said.out, said.err

    reader = RunReader(run)
    records, damage = list(reader), reader.damage
    told = str(damage)
    whole = told == "complete"
    for command in (["logs", "show"], ["logs", "show", "--ticks"]):
        assert (told in use(*command)[0]) is not whole
    assert told in use("logs", "summary")[0]
    summary = json.loads(use("logs", "summary", "--json")[0])
    assert summary["damage"] == asdict(damage)
    assert told in use("logs", "check", codes=(0, 3))[0]
    if isinstance(records[-1], Outcome):  # else it waits for more
        assert (told in use("logs", "follow", str(run))[1]) is not whole
    assert (told in use("logs", "export", "--out", str(tmp_path / "run.csv"))[1]) is not whole  # mcap is above
    rows = list(csv.DictReader(io.StringIO((tmp_path / "run.csv").read_text(encoding="utf-8"))))
    assert sum(row["phase"] != "" for row in rows) == summary["ticks"]
    last = next(row for row in reversed(rows) if row["north_m"])
    report = read_run(run)
    assert float(last["north_m"]) == float(report.ticks["north_m"][-1])
    use("replay", codes=(0, 1, 2, 3))
    assert RUN[:5].lstrip("0") in use("logs", "list")[0]


# Of these a page draws something else than of a log that lacks some lines; the others are drawn in the long tier.
DRAWN_OTHERWISE = (
    "flipped bits", "a number that cannot be", "a time far too late", "a time too early",
    "header lost, and there again in the next part",
)  # fmt: skip


@pytest.mark.process
@pytest.mark.parametrize(
    "run",
    [pytest.param(name, marks=() if name in DRAWN_OTHERWISE else pytest.mark.long) for name in COPIES],
    indirect=True,
)
def test_report_is_a_page(run: Path) -> None:
    assert cli.run(["report", str(run), "--log-dir", str(run.parent)]) == 0
    assert (run / "report.html").stat().st_size > 10_000
