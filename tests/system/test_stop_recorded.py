"""`wayfarer stop-motors` if the rover file is not what the daemon has read: real processes, over simulated chips."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from tests.system.hil_setup import PATIENCE_S, Site, rover_toml, wait_for
from tests.system.subprocesses import WAYFARER

NOBODY = 65534
OTHER = {"forestrover": "minirover", "minirover": "forestrover"}

BOTH = pytest.mark.parametrize("site", sorted(OTHER), indirect=True)


def as_nobody(site: Site) -> tuple[str, ...]:
    """Return the command that runs wayfarer as a user who owns the site, if an interpreter lets one."""
    if os.geteuid() != 0:
        return WAYFARER
    site.environment["PYTHONPATH"] = os.pathsep.join(each for each in sys.path if each)
    shutil.chown(site.folder, NOBODY, NOBODY)
    site.uid = NOBODY
    become = ("setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups")
    for python in (sys.executable, "/usr/bin/python3"):  # the tests' own may be in root's home
        program = (*become, python, *WAYFARER[1:])
        tried = subprocess.run([*program, "run", "--help"], env=site.environment, capture_output=True, check=False)
        if tried.returncode == 0:
            return program
    pytest.skip(f"user {NOBODY} cannot run wayfarer here")


@pytest.mark.parametrize(("site", "how"), [("forestrover", "closed"), ("minirover", "gone")], indirect=["site"])
def test_rover_file_that_may_not_be_read_any_more_keeps_no_wheels_turning(site: Site, how: str) -> None:
    program = as_nobody(site)
    site.armed(program=program)
    if how == "gone":
        site.config.unlink()
    else:
        site.config.chmod(0o600 if os.geteuid() == 0 else 0)
    done = site.run("stop-motors", "--rover", site.config, program=program)
    assert done.returncode == 0, done.stderr
    assert not site.turning
    assert done.stdout.startswith(f"the daemon's {site.folder}/motors.json: ")
    assert f"; {site.config}: cannot be read: " in done.stdout


@BOTH
def test_board_that_a_killed_daemon_drove_is_stopped_though_the_file_names_another(site: Site) -> None:
    site.armed().kill()
    site.stopped()
    site.bench("power_cycle")  # the board has forgotten its deadman
    site.turn_wheels()
    time.sleep(2 * site.deadman_s)
    assert site.turning
    site.config.write_text(rover_toml(OTHER[site.rover]), encoding="utf-8")
    began_s = time.monotonic()
    done = site.run("stop-motors", "--rover", site.config)
    assert not site.turning
    print(f"{site.rover}: {time.monotonic() - began_s:.2f} s: {done.returncode} {done.stdout}{done.stderr}")
    driven, named = (done.stdout + done.stderr).split("; ", maxsplit=1)
    assert "motors.json: " in driven
    assert ("are stopped" if site.rover == "minirover" else "stop was sent to Sabertooth") in driven
    assert str(site.config) in named


@BOTH
def test_board_that_a_suspended_daemon_drives_is_stopped_and_the_daemon_told_of(site: Site) -> None:
    site.armed().send_signal(signal.SIGSTOP)
    site.config.write_text(rover_toml(OTHER[site.rover]), encoding="utf-8")
    done = site.run("stop-motors", "--rover", site.config)
    assert done.returncode == 1
    assert (
        f"motors.json: stop was sent, but a wayfarer daemon at {site.socket} still commands these wheels" in done.stderr
    )
    assert not site.turning


def test_record_is_there_while_a_daemon_runs_and_left_by_a_death_only(site: Site) -> None:
    record = site.folder / "motors.json"
    site.armed().kill()
    assert record.exists()
    daemon = site.daemon()
    assert record.exists()
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0
    wait_for("it is gone", lambda: not record.exists())
