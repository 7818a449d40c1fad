"""Rover files and calibrations that cannot be used, or that change under a daemon."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import re
import tempfile
import time
from pathlib import Path

from wayfarer.config.calibration_file import FILE_NAME, Calibration, CompassEntry, save, stamp
from wayfarer.daemon.socket.protocol import Refused
from wayfarer.fault_scenarios.process_tests.hil_setup import HilSetup, rover_toml, site, wait_for
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.process_tests.subprocesses import command
from wayfarer.fault_scenarios.result import Tried
from wayfarer.fault_scenarios.scenario import Reached
from wayfarer.fieldlog.clock import wall_clock

BAD_INPUT = 2
CRUISE = "cruise_m_s = 0.42"
GENTLER = "cruise_m_s = 0.21"
HUGE_FILE_BYTES = 5_000_000
# What stands in the file instead of the line CRUISE, and what the one line on the terminal must say besides its number.
BAD_LINES = {
    "unknown key": ("cruse_m_s = 0.42", ("escape.cruse_m_s", "did you mean 'cruise_m_s'")),
    "wrong type": ('cruise_m_s = "fast"', ("escape.cruise_m_s", "a valid number")),
    "NaN": ("cruise_m_s = nan", ("escape.cruise_m_s", "allowed is")),
    "out of range": ("cruise_m_s = -1", ("escape.cruise_m_s", "allowed is")),
    "huge number": ("cruise_m_s = 1e300", ("escape.cruise_m_s", "allowed is")),
    "twice": (f"{CRUISE}\n{CRUISE}", ("Cannot overwrite a value",)),
    "no TOML": ("cruise_m_s = = 0.42", ("not valid TOML",)),
    "huge line": ("a" * HUGE_FILE_BYTES, ("not valid TOML",)),
}


@procedure(
    "bad-config", 47, f"a rover file that is wrong in {len(BAD_LINES)} ways, one at a time",
    asked="refuse start/arm; line+key+allowed range; at load", expected=Reached.FAULT, tried=Tried.COMMAND,
)  # fmt: skip
def bad_config(found: Observed) -> None:
    """Run a daemon on each bad file."""
    text = rover_toml("forestrover")
    line = text[: text.index(CRUISE)].count("\n") + 1
    with tempfile.TemporaryDirectory(prefix="wf-") as folder:
        config = Path(folder) / "rover.toml"
        for what, (instead, wanted) in BAD_LINES.items():
            config.write_text(text.replace(CRUISE, instead), encoding="utf-8")
            done = command("run", "--config", config, "--logs", folder)
            said = done.stderr.strip()
            found.demand(done.returncode == BAD_INPUT, f"{what}: exit code {done.returncode}")
            found.demand(said.count("\n") == 0, f"{what}: more than a line: {said[:200]}")
            found.demand(all(part in said for part in wanted), f"{what}: {said[:200]}")
            lines = [int(number) for number in re.findall(r"line (\d+)", said)]
            found.demand(lines in ([line], [line + 1]), f"{what}: it is line {line}, and said is {lines}")
    found.changed, found.cause, found.reached = "the rover file", "exit code 2", Reached.FAULT


@procedure(
    "config-changed", 48, "the rover file is changed while the daemon runs",
    asked="ignored until reload; hash in log", expected=Reached.NONE,
)  # fmt: skip
def config_changed(found: Observed) -> None:
    """Change the speed in the file of a rover that drives, and start it anew."""
    with site() as where:
        daemon = where.armed()
        where.config.write_text(where.config.read_text("utf-8").replace(CRUISE, GENTLER), encoding="utf-8")
        time.sleep(1.0)
        before = where.log()[0]
        found.demand(before["config"]["escape"]["cruise_m_s"] == 0.42, "the log does not say what is driven with")
        found.demand(where.status()["mode"] == "armed", "it is not armed any more")
        wait_for("it drives on", lambda: where.drives, patience_s=3.0)  # between two manoeuvres it stands for a moment
        daemon.terminate()
        daemon.wait()
        where.daemon()
        after = where.log()[0]
        found.demand(after["config"]["escape"]["cruise_m_s"] == 0.21, "the next start does not read the file")
        found.demand(before["config_hash"] != after["config_hash"], "the hash is the same")
        found.changed = f"config_hash {before['config_hash']}, at the next start {after['config_hash']}"


@procedure(
    "calibration-unusable", 49, "the calibration file is garbage, another part's, or not there",
    asked="refuse arm, say which; at arm", expected=Reached.FAULT,
    remark="a file that is not there is a warning at each arming: a rover that was never calibrated may be driven",
)  # fmt: skip
def calibration_unusable(found: Observed) -> None:
    """Spoil the calibration file under a daemon, and ask to arm."""
    with site() as where:
        where.daemon()
        file = where.folder / FILE_NAME
        file.write_text('{"schema": 1, "compass": ', encoding="ascii")
        _is_refused(where, (str(file), "not a calibration"), found)
        save(
            file,
            Calibration(
                compass=CompassEntry(
                    **stamp("CMPS14 at 0x61 on /dev/i2c-9", wall_clock(0.0)), level=3, residual_deg=1.0
                )
            ),
        )
        _is_refused(where, ("calibrated compass", "made with CMPS14 at 0x61 on /dev/i2c-9", "but this is"), found)
        file.unlink()
        warnings = where.ask("arm", heading_deg=0.0)["warnings"]
        found.demand(any("calibrated compass" in warning for warning in warnings), f"no warning: {warnings}")
        found.reached = Reached.FAULT


def _is_refused(where: HilSetup, wanted: tuple[str, ...], found: Observed) -> None:
    """See that arming is refused, for a reason that says all of this."""
    try:
        where.ask("arm", heading_deg=0.0)
        found.problems.append(f"it was armed, in spite of: {wanted}")
    except Refused as refused:
        found.demand(all(part in str(refused) for part in wanted), f"the refusal says: {refused}")
        found.changed, found.cause = "the calibration file", "arming_refused"
