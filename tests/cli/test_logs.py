"""``wayfarer logs``: what its commands print, what they write, and how they refuse."""

from __future__ import annotations

import gzip
import json
import os
import pty
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from shutil import rmtree
from threading import Event, Timer

import pytest

from tests.children import child
from tests.conftest import Run, refusal
from tests.logview.records import HEADER, drive, event, line, noted, numbered, outcome, record, tick, write
from wayfarer import cli
from wayfarer.logview.summary import NO_OUTCOME

FIRST, SECOND = "00001-20261121T061405Z", "00002-20261121T071405Z"
LONG_S = 20.0


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A run that ended, and one that was cut off."""
    write(tmp_path / "logs" / FIRST, numbered([HEADER, event("armed", 0.0), *drive(0.0, 6.0), outcome(6.0)]))
    write(tmp_path / "logs" / SECOND, numbered([HEADER, *drive(0.0, 3.0, phase="halt")]))
    return tmp_path / "logs"


@pytest.fixture
def run(run: Run, logs: Path) -> Run:
    return lambda *arguments: run("logs", *arguments, "--log-dir", logs)


def test_list_has_a_line_for_each_run_the_newest_last(run: Run) -> None:
    code, out, _ = run("list")
    titles, first, second = out.splitlines()
    assert code == 0
    assert titles.split()[0] == "run"
    assert (first.split()[0], first.split()[-2]) == ("1", "requested")
    assert second.split()[0] == "2"


def test_show_tells_a_run_from_its_beginning_without_colours_in_a_file(run: Run) -> None:
    code, out, _ = run("show", 1)
    assert code == 0
    assert out.splitlines()[0] == "0:00:00.00  run of minirover, forest-pledge, wayfarer 9.9"
    assert out.splitlines()[-1] == "0:00:06.00  The run has ended: enough"
    assert "\x1b" not in out


@pytest.mark.parametrize("command", ["logs list", "logs show", "logs summary", "logs check", "logs export", "report"])
def test_name_of_a_folder_cannot_control_the_terminal(
    logs: Path, command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (logs / SECOND).rename(logs / f"{SECOND}\x1b[31m\r{os.fsdecode(bytes([255]))}")
    monkeypatch.chdir(logs)
    assert cli.run([*command.split(), "--log-dir", str(logs)]) in {0, 3}
    said = "".join(capsys.readouterr())
    assert said.replace("\n", "").isprintable()


def test_show_takes_the_newest_and_says_what_is_missing(run: Run, logs: Path) -> None:
    with (logs / SECOND / "run.00001.jsonl").open("ab") as file:
        file.write(b'{"record":"ti')
    _, out, _ = run("show")
    assert out.splitlines()[-2:] == ["no outcome: the run was cut off, or is still running", "1 line is torn"]


def test_show_tells_every_tick_when_asked_to(run: Run) -> None:
    assert run("show", 1, "--ticks")[1].count("applied") == 120


def test_summary_is_for_people_or_for_machines(run: Run) -> None:
    code, out, _ = run("summary", 1)
    assert code == 0
    assert "3.0 m commanded" in out
    found = json.loads(run("summary", 1, "--json")[1])
    assert (found["run"], found["reason"], found["ticks"], found["damage"]["torn"]) == (FIRST, "requested", 120, 0)
    assert found["where"]["by_reckoning"]["distance_m"] == pytest.approx(3.0, abs=0.1)


def test_check_ends_with_the_worst_of_what_it_found(run: Run, logs: Path) -> None:
    code, out, _ = run("check", 1)
    assert (code, out) == (0, f"{FIRST}: complete: 123 records\n")
    code, out, _ = run("check", 1, 2)
    assert (code, len(out.splitlines())) == (3, 2)
    assert "no outcome" in out
    write(logs / "00003-20261121T081405Z", [])
    assert run("check", 3, 1, 2)[0] == 1


def test_export_writes_a_file_named_as_the_run_where_one_is(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("export", 1) == (0, f"the export is in {FIRST}.csv\n", f"Next: xdg-open {FIRST}.csv\n")
    assert len(Path(f"{FIRST}.csv").read_text().splitlines()) == 122
    code, _, err = run("export", 1)
    assert code == 2
    assert "--force" in err
    assert run("export", 1, "--force")[0] == 0
    assert run("export", logs_file(tmp_path), "--format", "csv", "--out", "other.csv")[0] == 0
    assert Path("other.csv").read_text().startswith("elapsed_s,")


def logs_file(folder: Path) -> Path:
    return folder / "logs" / FIRST / "run.00001.jsonl"


def test_export_takes_the_format_from_the_name_of_the_file(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    for name, begins in (
        ("a.mcap", b"\x89MCAP"),
        ("b.CSV", b"elapsed_s,"),
        ("c.csv", b"elapsed_s,"),
        ("d", b"elapsed_s,"),
    ):
        assert run("export", 1, "--out", tmp_path / name)[0] == 0
        assert (tmp_path / name).read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--format", "csv", "--out", "x.mcap"), "--out x.mcap ends in .mcap, --format is csv"),
        (("--format", "mcap", "--out", "x.csv"), "--out x.csv ends in .csv, --format is mcap"),
        (("--out", "x.kml"), "a run is written as csv, gpx, mcap"),
    ],
)
def test_export_refuses_a_name_that_says_another_format(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run("export", 1, *options)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert said in err
    assert not Path(options[-1]).exists()


def test_export_goes_to_a_pipe(run: Run) -> None:
    assert run("export", 1, "--out", "-")[1].startswith("elapsed_s,t_s,t_wall,n,event,phase")
    assert run("export", 1, "--out", "-", "--format", "mcap")[:2] == (2, "")


@pytest.mark.parametrize("command", ["show", "summary", "check", "export", "follow"])
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("99", "there is no run and no folder '99'"),
        ("9" * 5_000, "cannot be a run: File name too long"),
        ("/etc/passwd", "not a field log"),
        ("/etc", "no run"),
    ],
)
def test_run_that_is_not_there_is_one_line_and_exit_code_2(run: Run, command: str, name: str, said: str) -> None:
    assert said in refusal(run, command, name)


def crlf(log: bytes) -> bytes:
    return log.replace(b"\n", b"\r\n")


def marked(log: bytes) -> bytes:
    return b"\xef\xbb\xbf" + log


def through_jq(log: bytes) -> bytes:
    """As ``jq -c .`` writes it: numbers in another form, and characters that are not ASCII as they are."""
    return b"".join(
        json.dumps(json.loads(each), ensure_ascii=False, separators=(",", ":")).encode() + b"\n"
        for each in log.replace(b".0,", b",").splitlines()
    )


@pytest.mark.parametrize("change", [crlf, marked, through_jq, gzip.compress])
def test_log_that_was_copied_packed_or_renamed_tells_the_same(
    run: Run, logs: Path, tmp_path: Path, change: Callable[[bytes], bytes]
) -> None:
    original = (logs / FIRST / "run.00001.jsonl").read_bytes()
    copied = tmp_path / "from the rover (1).txt"
    copied.write_bytes(change(original))
    assert run("check", copied) == (0, "from the rover (1).txt: complete: 123 records\n", "")
    assert run("show", copied) == run("show", 1)
    exported, expected = (run("export", each, "--out", "-")[1] for each in (copied, 1))
    assert exported.replace(".0,", ",") == expected.replace(".0,", ",")
    assert run("summary", copied)[1].splitlines()[1:] == run("summary", 1)[1].splitlines()[1:]
    (logs / FIRST / "run.00002.jsonl").write_bytes(change(b"".join(map(line, numbered([HEADER | {"part": 2}])))))
    (logs / FIRST / "run.00001.jsonl").write_bytes(change(original))
    assert run("check", 1)[:2] == (0, f"{FIRST}: complete: 124 records\n")
    assert run("list")[1].splitlines()[1].split()[-2] == "requested"


def test_parts_that_were_packed_are_read_with_the_others(run: Run, logs: Path) -> None:
    older = logs / FIRST / "run.00001.jsonl.gz"
    whole = (logs / FIRST / "run.00001.jsonl").read_bytes().splitlines(keepends=True)
    (logs / FIRST / "run.00001.jsonl").unlink()
    older.write_bytes(gzip.compress(b"".join(whole[:60])))
    (logs / FIRST / "run.00002.jsonl").write_bytes(b"".join([line(HEADER | {"part": 2}), *whole[60:]]))
    assert run("check", 1)[:2] == (0, f"{FIRST}: complete: 124 records\n")
    older.write_bytes(older.read_bytes()[:-20])
    code, out, _ = run("check", 1)
    assert (code, "1 part of the log cannot be read" in out) == (3, True)
    older.write_bytes(older.read_bytes()[:100] + b"?" * 400)
    assert run("check", 1)[0] == 3
    assert run("list")[0] == 0
    (logs / FIRST / "run.00002.jsonl").unlink()
    assert run("check", 1)[0] in {1, 3}
    assert run("list")[1].splitlines()[1].split() == ["1", "unreadable"]


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        (b'{"record":"tock","t_s":1}\n', "1 record is of an unknown kind"),
        (b'{"level":"info"}\n', "1 record is of an unknown kind"),
        (
            line(tick(1.0, heading_deg="north")) * 2,
            "2 records hold impossible values (the first: tick: Expected `float | null`, got `str` - at "
            "`$.heading_deg`)",
        ),
        (b"what?\n", "1 line is torn"),
    ],
)
def test_what_is_no_record_is_counted_and_the_first_wrong_value_named(
    run: Run, logs: Path, broken: bytes, said: str
) -> None:
    write(logs / FIRST, [broken])
    assert run("check", 1) == (3, f"{FIRST}: partial: 123 readable records; {said}\n", "")
    assert run("summary", 1)[1].splitlines()[-1] == f"log        {said}"
    assert run("show", 1)[1].splitlines()[-1] == said


@pytest.mark.parametrize("command", ["show", "summary", "export", "follow", "check"])
def test_log_of_an_older_wayfarer_is_refused_in_one_line(
    run: Run, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    write(logs / "00003-20261121T081405Z", [HEADER | {"schema": 3}, *numbered(drive(0.0, 1.0))])
    code, out, err = run(command, 3)
    (said,) = (out + err).splitlines()
    assert ": this log has schema 3, and wayfarer " in said
    assert code == (1 if command == "check" else 2), "check says that it cannot be read, as of every such log"


NASTY = "\x1b[2J\x07\r\x7f\x9b31m\u202e"


@pytest.mark.parametrize("command", ["show", "show --ticks", "summary", "check", "export --out -", "list", "follow"])
def test_text_in_a_log_cannot_command_a_terminal(run: Run, logs: Path, command: str) -> None:
    records = [
        HEADER | {"rover": NASTY, "algorithm": NASTY, "version": NASTY},
        noted(1.0, NASTY),
        event(NASTY, 1.0, NASTY, NASTY, **{NASTY: [NASTY], "error": {NASTY: NASTY}}),
        tick(1.0, phase=NASTY, why=NASTY, anomalies=[NASTY], cause=NASTY, level=NASTY, **{NASTY: NASTY}),
        record("board", 1.0, faults=[NASTY], battery_v=1.0),
        record("computer", 1.0, throttled=NASTY),
        record("fault", 1.0, target=NASTY, begins=True, params={NASTY: NASTY}) | {"kind": NASTY},
        record("outcome", 1.0, reason=NASTY, text=NASTY),
    ]
    write(logs / "00003-20261121T081405Z", [*map(raw, numbered(records))])
    code, out, err = run(*command.split()[:1], *([] if command == "list" else [3]), *command.split()[1:])
    assert code == 0
    assert [each for each in (out + err).splitlines() if not each.isprintable()] == []


def raw(nasty: dict[str, object]) -> bytes:
    """Return a line in which the texts stand as they are, as far as JSON allows."""
    return json.dumps(nasty, ensure_ascii=False).encode() + b"\n"


@pytest.mark.parametrize("command", ["list", "show", "summary", "check", "export"])
def test_folder_without_runs_is_one_line_and_exit_code_2(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["logs", command, "--log-dir", str(tmp_path / "nowhere")]) == 2
    assert "holds no run" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["show", "summary", "export"])
def test_log_without_a_record_is_one_line_and_exit_code_2(
    run: Run, logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    write(logs / "00003-20261121T081405Z", [])
    assert "nothing in this log can be read" in refusal(run, command, 3)


# -- with a terminal, pipes and signals of their own -----------------------------------------------------------------


def wayfarer(*arguments: object) -> list[str]:
    return [sys.executable, "-c", "from wayfarer.cli import main; main()", "logs", *map(str, arguments)]


def on_a_terminal(*arguments: object, **environment: str) -> str:
    """What a command writes to a terminal."""
    leader, follower = pty.openpty()
    usual = {key: value for key, value in os.environ.items() if key not in {"NO_COLOR", "TERM"}}
    with child(wayfarer(*arguments), stdout=follower, env=usual | {"TERM": "xterm"} | environment):
        os.close(follower)
        told = b""
        with suppress(OSError):  # how Linux tells that the other side is closed
            while more := os.read(leader, 65536):
                told += more
    os.close(leader)
    return told.decode()


@pytest.mark.process
def test_terminal_gets_colours_unless_its_owner_wants_none(logs: Path) -> None:
    assert "\x1b[36m" in on_a_terminal("show", "1", "--log-dir", logs)
    assert "\x1b" not in on_a_terminal("show", "1", "--log-dir", logs, NO_COLOR="1")
    os.utime(logs / SECOND / "run.00001.jsonl", (0.0, 0.0))  # not the log of a run that goes on
    lines = on_a_terminal("list", "--log-dir", logs).splitlines()
    assert ["\x1b[33m" in line for line in lines] == [False, False, True], "the second was cut off"


@pytest.mark.process
def test_reader_that_has_enough_ends_a_command_without_a_message(logs: Path) -> None:
    write(logs / SECOND, drive(3.0, 600.0))  # more than a pipe holds
    with child(
        wayfarer("show", "--ticks", "--log-dir", logs), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(LONG_S) == cli.READER_GONE


@pytest.mark.process
@pytest.mark.parametrize(
    "command",
    [
        "logs list --log-dir logs",
        "logs check 1 2 --log-dir logs",
        "list",
        "sim --help",
        "-V",
    ],
)
def test_command_whose_output_nobody_reads_ends_without_a_message_and_with_one_exit_code(
    logs: Path, command: str
) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = subprocess.run(
            [sys.executable, "-c", "from wayfarer.cli import main; main()", *command.split()],
            cwd=logs.parent,
            stdout=writer,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (cli.READER_GONE, "")


@pytest.mark.process
def test_following_a_run_that_was_cut_off_says_that_it_waits(logs: Path) -> None:
    with child(
        wayfarer("follow", "2", "--log-dir", logs), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        assert process.stdout is not None
        silent = Timer(LONG_S, process.kill)
        silent.start()
        said = process.stderr.readline()
        silent.cancel()
        Event().wait(0.1)  # it is likely to wait for more by now
        process.send_signal(signal.SIGINT)
        assert (process.wait(LONG_S), process.stderr.read()) == (0, "")
    assert said == f"{NO_OUTCOME}; waiting for more (Ctrl-C ends)\n"


@pytest.fixture
def following(logs: Path) -> Iterator[subprocess.Popen[str]]:
    """``wayfarer logs follow``, after its first line."""
    with child(wayfarer("follow", "--log-dir", logs), stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"{SECOND}\n"
        yield process


@pytest.mark.process
def test_follow_tells_what_is_written_while_it_waits_and_ends_by_ctrl_c(
    following: subprocess.Popen[str], logs: Path
) -> None:
    assert following.stdout is not None
    write(logs / SECOND, [noted(3.0, "hit log")])
    write(logs / "00003-20261121T081405Z", [HEADER, tick(1.0)])
    told = [following.stdout.readline() for _ in range(5)]
    assert told[-3] == "0:00:03.00  Mark: hit log\n"
    assert told[-2:] == ["00003-20261121T081405Z\n", "0:00:00.00  run of minirover, forest-pledge, wayfarer 9.9\n"]
    Event().wait(0.1)  # it is likely to wait for more by now
    following.send_signal(signal.SIGINT)
    assert following.wait(LONG_S) == 0


def test_prune_says_what_it_would_delete_then_deletes_it_and_never_without_a_limit(run: Run, logs: Path) -> None:
    for name in (FIRST, SECOND):
        (logs / name / "run.00001.jsonl").write_bytes(bytes(9_000_000))
    assert run("prune")[0] == 2
    code, out, _ = run("prune", "--keep-mb", 10, "--dry-run")
    assert (code, out) == (0, f"{FIRST}\n1 run would be deleted, 9.0 MB; 9.0 MB are left\n")
    assert (logs / FIRST).exists()
    assert run("prune", "--keep-mb", 10)[1] == f"{FIRST}\n1 run deleted, 9.0 MB; 9.0 MB are left\n"
    assert not (logs / FIRST).exists()
    (logs / SECOND / "run.00001.jsonl").write_bytes(bytes(11_000_000))
    code, out, err = run("prune", "--keep-mb", 10)
    assert (code, out) == (1, "0 runs deleted, 0.0 MB; 11.0 MB are left\n")
    assert "more than keep_mb" in err
    rmtree(logs)
    code, _, err = run("prune", "--keep-mb", 10)
    assert (code, f"{logs}: no such folder" in err) == (2, True)
