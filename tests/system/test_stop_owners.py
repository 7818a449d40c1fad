"""Who stops the wheels when the daemon dies, hangs, is ended, or has gone: real processes, over simulated chips.

The bench (``wayfarer.simhal.bench``) is a process of its own, and writes down what the wheels were told and when. All
processes of a machine share one monotonic clock, so its times compare with those in the daemon's log; a busy machine
delays what this test sees, not what it judges.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import Any

import pytest

from wayfarer.control.client import ask
from wayfarer.control.paths import SOCKET_NAME
from wayfarer.drivers.sabertooth import packet
from wayfarer.simhal.bench_buses import SOCKET_VARIABLE, BenchI2C, BenchLine, BenchSerial

pytestmark = pytest.mark.slow

I2C, SERIAL, COMPASS = "/dev/i2c-1", "/dev/ttyAMA0", 0x60
DEADMAN_S = {"minirover": 0.25, "forestrover": 0.3}  # ThunderBorg, and what forestrover.toml sets its Sabertooth to
HANG_S = 1.0
MARGIN_S = 0.02  # between the two writes of one drive command
PATIENCE_S = 15.0
ROVERS = Path(__file__).resolve().parents[2] / "wayfarer" / "rovers"
WAYFARER = (sys.executable, "-c", "from wayfarer.cli import main; main()")
FLOW = '[parts.motion]\ndriver = "pmw3901"\nbus = "/dev/spidev0.1"\n\n'
FAULTY = """
from wayfarer.escape.api import Decision, Phase
from wayfarer.escape.catalogue import Algorithm
from wayfarer.hal import WheelCommand


class Faulty:
    decisions = 0

    def decide(self, observation):
        self.decisions += 1
        if self.decisions > 10:
            raise ZeroDivisionError("the bug of a third party")
        return Decision(WheelCommand(0.3, 0.3), Phase.FOLLOW, "follow")

    def reset(self):
        pass

    def memory(self):
        return {"counter_deg": 0.0, "episodes": 0.0}


FAULTY = Algorithm("faulty", "test", "raises while it drives", lambda settings, vehicle, rng: Faulty())
"""

Commands = list[tuple[float, float, float]]


def rover_toml(name: str) -> str:
    """A shipped rover, on the bench: it starts at once, and has no camera."""
    text = (ROVERS / f"{name}.toml").read_text(encoding="utf-8")
    text = re.sub(r"start_delay_s = [\d.]+", "start_delay_s = 0.0", text)
    text = re.sub(r"\[parts\.motion\].*?(?=\[parts\.motors\])", FLOW, text, flags=re.DOTALL)
    return 'buses = "wayfarer.simhal.bench_buses:buses"\n' + text


def wait_for(what: str, holds: Callable[[], Any]) -> Any:
    """Poll until something holds, and return it."""
    ends_s = time.monotonic() + PATIENCE_S
    while not (found := holds()):
        assert time.monotonic() < ends_s, f"after {PATIENCE_S:g} s not yet: {what}"
        time.sleep(0.02)
    return found


STARTS = 3
BUSY = "no end of a transfer within"  # what a daemon says whose bus has no time for it


class Site:
    """A folder with a bench and, at times, a daemon."""

    def __init__(self, folder: Path, rover: str) -> None:
        self.folder, self.rover = folder, rover
        self.deadman_s = DEADMAN_S[rover]
        self.config = folder / "rover.toml"
        self.config.write_text(rover_toml(rover), encoding="utf-8")
        (folder / "faulty.py").write_text(FAULTY, encoding="utf-8")
        self.environment = os.environ | {
            SOCKET_VARIABLE: str(folder / "bench"),
            "RUNTIME_DIRECTORY": str(folder),
            "HOME": str(folder),
            "XDG_STATE_HOME": str(folder),
            "PYTHONPATH": str(folder),
        }
        self.processes: list[subprocess.Popen[bytes]] = []
        self.start(sys.executable, "-m", "wayfarer.simhal.bench", "--rover", self.config, "--socket", folder / "bench")
        self._line: BenchLine = wait_for("the bench listens", self._connect)

    def start(self, *command: str | Path) -> subprocess.Popen[bytes]:
        with (self.folder / "output.txt").open("ab") as output:
            process = subprocess.Popen(command, env=self.environment, stdout=output, stderr=output, cwd=self.folder)
        self.processes.append(process)
        return process

    def _connect(self) -> BenchLine | None:
        try:
            return BenchLine(str(self.folder / "bench"))
        except OSError:
            return None

    def end(self) -> None:
        self._line.close()
        for process in reversed(self.processes):
            process.kill()
            process.wait()

    # -- the bench -------------------------------------------------------------------------------------------------

    def bench(self, do: str, **details: object) -> dict[str, Any]:
        return self._line.ask(do, **details)

    @property
    def turning(self) -> bool:
        return any(self.bench("look")["commanded"])

    def stopped(self) -> Commands:
        """What the wheels were told until they stood still, and stayed so for longer than any deadman."""
        wait_for("the wheels stand still", lambda: not self.turning)
        time.sleep(0.4)
        look = self.bench("look")
        assert look["commanded"] == [0.0, 0.0]
        commands: Commands = look["commands"]
        return commands

    # -- the daemon --------------------------------------------------------------------------------------------------

    def daemon(self, *options: str) -> subprocess.Popen[bytes]:
        """A daemon whose parts are open. On a busy computer the bench may be too slow for it: then another one."""
        for _ in range(STARTS):
            process = self.start(*WAYFARER, "run", "--config", self.config, "--logs", self.folder / "logs", *options)
            wait_for("the daemon sees, or has ended", lambda: self._sees() or self.processes[-1].poll() is not None)
            if process.poll() is None:
                return process
            if BUSY not in (said := (self.folder / "output.txt").read_text(encoding="utf-8")):
                break
        pytest.fail(said)

    def _sees(self) -> bool:
        try:
            return self.status().get("heading_deg") is not None
        except Exception:  # not up yet
            return False

    def status(self) -> dict[str, Any]:
        return ask({"do": "status"}, self.folder / SOCKET_NAME)

    def armed(self, *options: str) -> subprocess.Popen[bytes]:
        """A daemon whose rover drives."""
        process = self.daemon(*options)
        ask({"do": "arm", "heading_deg": 0.0}, self.folder / SOCKET_NAME)
        wait_for("the wheels turn", lambda: min(self.bench("look")["wheels_m_s"]) > 0.05)
        return process

    def log(self) -> list[dict[str, Any]]:
        newest = max((self.folder / "logs").iterdir()) / "run.jsonl"
        return [json.loads(line) for line in newest.read_text(encoding="utf-8").splitlines()]

    def run(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*WAYFARER, *arguments], env=self.environment, capture_output=True, text=True, check=False, timeout=20
        )


@pytest.fixture(params=sorted(DEADMAN_S))
def site(request: pytest.FixtureRequest) -> Iterator[Site]:
    folder = Path(tempfile.mkdtemp(prefix="wf-"))  # a socket's path must be short
    made = Site(folder, request.param)
    try:
        yield made
    finally:
        made.end()
        shutil.rmtree(folder)


def stop_after(commands: Commands) -> tuple[float, float]:
    """Return when the wheels were last told to turn, and when they were told to stand for good."""
    last = max(index for index, (_, left, right) in enumerate(commands) if left or right)
    stop_s = next(t_s for t_s, left, right in commands[last:] if not (left or right))
    return commands[last][0], stop_s


def spans(commands: Commands) -> list[tuple[float, float]]:
    """Return from when to when any wheel was told to turn; a span that has not ended ends in infinity."""
    found: list[tuple[float, float]] = []
    start_s: float | None = None
    for t_s, left, right in commands:
        if (left or right) and start_s is None:
            start_s = t_s
        elif not (left or right) and start_s is not None:
            found.append((start_s, t_s))
            start_s = None
    return found if start_s is None else [*found, (start_s, inf)]


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "suspended"])
def test_board_stops_the_wheels_of_a_daemon_that_is_gone(site: Site, how: signal.Signals) -> None:
    site.armed().send_signal(how)
    turned_s, stopped_s = stop_after(site.stopped())
    # No earlier: nobody but the deadman stopped them. No later: it was armed.
    assert stopped_s - turned_s == pytest.approx(site.deadman_s, abs=MARGIN_S)


def test_suspended_daemon_notices_when_it_wakes_and_ends_in_order(site: Site) -> None:
    daemon = site.armed()
    daemon.send_signal(signal.SIGSTOP)
    site.stopped()
    woken_s = site.bench("look")["t_s"]
    daemon.send_signal(signal.SIGCONT)
    wait_for("a tick", lambda: site.log()[-1]["t_s"] > woken_s + 0.3)
    after = [record for record in site.log() if record["record"] == "tick" and record["t_s"] >= woken_s]
    # Its first tick may be one that the suspension cut in two, and applies what it had begun; no further one does.
    assert any(tick["level"] in {"hold", "fault"} for tick in after[:2]), after[:2]
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0
    assert site.log()[-1]["record"] == "outcome"


def test_ended_daemon_stops_the_wheels_itself_and_writes_how_it_ended(site: Site) -> None:
    daemon = site.armed()
    began_s = time.monotonic()
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0
    took_s = time.monotonic() - began_s
    turned_s, stopped_s = stop_after(site.stopped())
    print(f"{site.rover}: stopped {stopped_s - began_s:.3f} s after SIGTERM, ended after {took_s:.3f} s")
    assert stopped_s - turned_s < site.deadman_s - MARGIN_S, "the deadman did it"
    assert stopped_s - began_s < 0.5
    assert took_s < 2.0
    outcome = site.log()[-1]
    assert (outcome["record"], outcome["reason"]) == ("outcome", "signal")


def test_error_in_an_algorithm_ends_the_daemon_with_the_wheels_stopped(site: Site) -> None:
    daemon = site.armed("--algorithm", "faulty:FAULTY")
    assert daemon.wait(PATIENCE_S) == 1
    turned_s, stopped_s = stop_after(site.stopped())
    assert stopped_s - turned_s < site.deadman_s - MARGIN_S, "the deadman did it"
    outcome = site.log()[-1]
    assert (outcome["record"], outcome["reason"]) == ("outcome", "failed")
    assert "the bug of a third party" in outcome["text"]


def test_daemon_that_was_killed_comes_back_disarmed(site: Site) -> None:
    site.armed().kill()
    site.stopped()
    stopped_s = site.bench("look")["t_s"]
    site.daemon()
    assert site.status()["mode"] == "disarmed"
    time.sleep(0.5)
    assert all(not (left or right) for t_s, left, right in site.bench("look")["commands"] if t_s >= stopped_s)


def turn_wheels(site: Site) -> None:
    """What another program might do: no deadman, and wheels that turn for ever."""
    path = str(site.folder / "bench")
    if site.rover == "minirover":
        bus = BenchI2C(path, I2C)
        for command in ((19, 0), (8, 100), (11, 100)):
            bus.write(0x15, bytes(command))
        bus.close()
    else:
        port = BenchSerial(path, SERIAL)
        port.write(packet(128, 0, 60) + packet(128, 4, 60))
        port.close()


def test_stop_motors_stops_wheels_that_nobody_owns(site: Site) -> None:
    turn_wheels(site)
    time.sleep(2 * site.deadman_s)
    look = site.bench("look")
    assert look["deadman_armed"] == [False]
    assert all(look["commanded"])
    began_s = time.monotonic()
    done = site.run("stop-motors", "--config", site.config)
    took_s = time.monotonic() - began_s
    assert done.returncode == 0, done.stderr
    _, stopped_s = stop_after(site.stopped())
    print(f"{site.rover}: stopped after {stopped_s - began_s:.3f} s, ended after {took_s:.3f} s: {done.stdout.strip()}")
    assert took_s < 5.0


def test_stop_motors_fails_loudly_where_no_board_answers(site: Site) -> None:
    site.processes[0].kill()
    site.processes[0].wait()
    done = site.run("stop-motors", "--config", site.config)
    assert done.returncode == 1
    assert "power off" in done.stderr


def test_compass_that_falls_silent_stops_the_wheels(site: Site) -> None:
    site.armed()
    silent_s = site.bench("silence", bus=I2C, address=COMPASS)["t_s"]
    _, stopped_s = stop_after(site.stopped())
    assert stopped_s - silent_s < 0.5
    wait_for("a status that says why", lambda: {"compass_stale", "compass_lost"} & set(site.status()["conditions"]))


def test_bus_that_hangs_stops_the_wheels_and_never_the_control_loop(site: Site) -> None:
    site.armed()
    hung_s = site.bench("hang", bus=I2C, for_s=HANG_S)["t_s"]
    wait_for("the bus is back", lambda: site.bench("look")["t_s"] > hung_s + HANG_S + 0.3)
    first, *later = (span for span in spans(site.bench("look")["commands"]) if span[1] > hung_s)
    ticks = [tick for tick in site.log() if tick["record"] == "tick" and hung_s <= tick["t_s"] < hung_s + HANG_S]
    print(f"{site.rover}: stopped after {first[1] - hung_s:.3f} s; {len(ticks)} ticks in {HANG_S} s; later {later}")
    # The compass hangs as well, and on the ForestRover only the compass: its wheels are held, and then go on.
    assert first[1] - hung_s < 0.5
    assert len(ticks) >= 0.8 * 20.0 * HANG_S
    assert all(late["t_s"] - tick["t_s"] < 0.2 for tick, late in pairwise(ticks)), "a tick waits one transfer at most"
    assert {tick["applied_left"] for tick in ticks if tick["t_s"] > hung_s + 0.5} == {0.0}
    if site.rover == "minirover":
        assert first[1] - hung_s <= site.deadman_s + MARGIN_S, "its board is on the same bus: only the deadman is left"
        assert site.status()["mode"] == "disarmed"
        # What hung in the wire arrives late, and is taken back by the next tick.
        assert all(end_s - start_s < 0.1 for start_s, end_s in later)
    else:
        assert site.status()["mode"] == "armed"
