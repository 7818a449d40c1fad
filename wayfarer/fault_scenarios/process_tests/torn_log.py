"""A log whose end the power cut off: half a line, NUL bytes, bytes that are no text."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from wayfarer.fault_scenarios.process_tests.hil_setup import site, wait_for
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.scenario import Reached
from wayfarer.fieldlog.folders import FILE_NAME, run_folders
from wayfarer.fieldlog.reader import Record, RunReader

DAMAGED = 3  # exit code of `wayfarer logs check` for a log of which something is lost
NUL_BYTES = 4096
TAIL = b"\xff\xfe no text \x80\n" + bytes(NUL_BYTES) + b'\n{"record":"tick","n":99999,"t_s":1'


@procedure(
    "torn-log", 44, "the last lines are torn, NUL and no text",
    asked="reader skips+counts, exit 3; at start", expected=Reached.NOTE,
    remark="the next run has a folder of its own: nothing is written behind a torn line, so nothing is cut away",
)  # fmt: skip
def torn_log(found: Observed) -> None:
    """Kill a daemon, spoil the end of its log, and read it; then start the next daemon on top."""
    with site() as where:
        daemon = where.armed()
        daemon.kill()
        daemon.wait()
        run = run_folders(where.logs)[-1]
        whole = list(RunReader(run))
        with (run / FILE_NAME).open("ab") as file:
            file.write(TAIL)
        reader = RunReader(run)
        found.demand(list(reader) == whole, "records before the damage are lost")
        damage = reader.damage
        found.demand((damage.garbled, damage.nul, damage.torn) == (1, 1, 1), f"counted: {damage}")
        checked = where.run("logs", "check", "--logs", where.logs)
        found.demand(checked.returncode == DAMAGED, f"logs check ends with {checked.returncode}")
        found.changed, found.cause, found.reached = f"{len(TAIL)} bytes", checked.stdout.strip(), Reached.NOTE
        before = run_folders(where.logs)
        where.daemon()
        later = run_folders(where.logs)[len(before) :]  # on a busy computer it may take two starts
        event = wait_for("the event 'unclean_shutdown'", lambda: _first(later, "unclean_shutdown"))
        found.demand(event["run"] == run.name and event["last_t_s"] == whole[-1]["t_s"], f"the next run says {event}")


def _first(runs: Iterable[Path], name: str) -> Record | None:
    """Return the first event of this name in any of these runs."""
    return next((record for run in runs for record in RunReader(run) if record.get("name") == name), None)
