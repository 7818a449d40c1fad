"""A daemon that is suspended, or whose disk freezes, while somebody asks it to start the wheels: it never does."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import re
import signal
import socket
import subprocess
import time
from collections.abc import Callable

import msgspec
import pytest

from tests.system import broken_os
from tests.system.flooders import connected, message, upgrade
from tests.system.hil_setup import Site, wait_for
from tests.system.measures import now_s, told_to_turn
from tests.system.subprocesses import MAIN, WAYFARER, command, python
from wayfarer.daemon.socket.client import ask
from wayfarer.errors import WayfarerError
from wayfarer.remote.live.model import LIMITS
from wayfarer.safety.permission import PERMISSION_S

LOOKS_S = 1.0  # the start delay is 0 here
FROZEN_S = 6.0
FROZEN = python(
    "import time; from wayfarer.commissioning.checks import system; looks = system.free_mb;"
    f" system.free_mb = lambda path: (time.sleep({FROZEN_S}), looks(path))[1]; {MAIN}"
)

ILL = python(f"from {broken_os.__name__} import patch_os; patch_os(); {MAIN}")
KEYS: dict[str, dict[str, object]] = {"manual_begin": {"driver": "keys"}}


def request(verb: str) -> bytes:
    """Return a request of now."""
    return msgspec.json.encode({"do": verb, "asked_s": now_s(), **KEYS.get(verb, {})}) + b"\n"


def interrupted(site: Site, verb: str, daemon: subprocess.Popen[bytes]) -> None:
    """The command is interrupted, and the daemon is woken at once: its bytes wait, and are fresh."""
    with pytest.raises(WayfarerError, match="did not answer"):
        ask({"do": verb, **KEYS.get(verb, {})}, site.socket, timeout_s=0.3)
    daemon.send_signal(signal.SIGCONT)


def killed(site: Site, verb: str, daemon: subprocess.Popen[bytes]) -> None:
    client = site.start(*WAYFARER, verb)
    time.sleep(1.5)
    client.kill()
    client.wait()
    daemon.send_signal(signal.SIGCONT)


def patient(site: Site, verb: str, daemon: subprocess.Popen[bytes]) -> None:
    """It waits for however long it takes, as another program may."""
    with socket.socket(socket.AF_UNIX) as line:
        line.settimeout(30.0)
        line.connect(str(site.socket))
        line.sendall(request(verb))
        time.sleep(PERMISSION_S + 0.1)
        daemon.send_signal(signal.SIGCONT)
        reply = msgspec.json.decode(line.recv(65_536))
    assert not reply["ok"]
    assert "s ago" in reply["why"]


def half_sent(site: Site, verb: str, daemon: subprocess.Popen[bytes]) -> None:
    with socket.socket(socket.AF_UNIX) as line:
        line.settimeout(30.0)
        line.connect(str(site.socket))
        text = request(verb)
        line.sendall(text[:20])
        daemon.send_signal(signal.SIGCONT)
        time.sleep(PERMISSION_S + 0.1)
        line.sendall(text[20:])
        assert not msgspec.json.decode(line.recv(65_536))["ok"]


def stopped_by_another(site: Site, verb: str, daemon: subprocess.Popen[bytes]) -> None:
    """A relay delivers the request only after the stop of another person, who came later."""
    text = request(verb)
    daemon.send_signal(signal.SIGCONT)
    site.ask("hold" if verb == "resume" else "disarm")
    with socket.socket(socket.AF_UNIX) as line:
        line.settimeout(30.0)
        line.connect(str(site.socket))
        line.sendall(text)
        assert "after this was asked" in msgspec.json.decode(line.recv(65_536))["why"]


Way = Callable[[Site, str, "subprocess.Popen[bytes]"], None]
WAYS: tuple[Way, ...] = (interrupted, killed, patient, half_sent, stopped_by_another)


@pytest.mark.parametrize(
    ("verb", "way"),
    [
        *(("arm", way) for way in WAYS),
        *((verb, way) for verb in ("resume", "manual_begin") for way in (interrupted, patient, half_sent)),
    ],
    ids=lambda tried: tried if isinstance(tried, str) else tried.__name__,
)
def test_suspended_daemon_starts_nothing_when_it_wakes(site: Site, verb: str, way: Way) -> None:
    daemon = stands(site, verb)
    daemon.send_signal(signal.SIGSTOP)
    stands_s = now_s()
    way(site, verb, daemon)
    nothing_starts(site, stands_s)


def stands(site: Site, verb: str, *options: str) -> subprocess.Popen[bytes]:
    """Return a daemon whose rover stands, in the state that a verb is for."""
    if verb != "resume":
        return site.daemon("--manual", *options)
    daemon = site.armed(*options)
    site.ask("hold")
    wait_for("the wheels are stopped", lambda: not site.turning)
    return daemon


def nothing_starts(site: Site, stands_s: float) -> None:
    """Assert that a rover that stands since then goes on to stand."""
    wait_for("it answers", site.sees)
    time.sleep(LOOKS_S)
    status = site.status()
    assert status["mode"] == "disarmed" or status["held"]
    assert not told_to_turn(site.commands(stands_s))


# -- the page ----------------------------------------------------------------------------------------------------------


def page(site: Site) -> tuple[socket.socket, float]:
    """Return a page that was opened with the token, and the newest time that it was told."""
    ((port, query),) = set(re.findall(r"http://127.0.0.1:(\d+)/(\S+)", site.said()))
    line = connected(port)
    line.sendall(upgrade(port, query))
    said = b""
    while not (times := re.findall(rb'"now_s":([\d.]+)', said)):
        said += line.recv(65_536)
    return line, float(times[-1])


@pytest.mark.parametrize("leaves", [True, False], ids=["closed", "open"])
@pytest.mark.parametrize("verb", ["resume", "manual_begin"])
def test_suspended_daemon_starts_nothing_that_a_page_asked_for(site: Site, verb: str, leaves: bool) -> None:
    """A page that was closed asked just now; one that is open waits until its state is old."""
    daemon = stands(site, verb, "--live", "--live-port", "0")
    line, newest_s = page(site)
    with line:
        daemon.send_signal(signal.SIGSTOP)
        stands_s = now_s()
        line.sendall(message(msgspec.json.encode({"do": verb, "asked_s": newest_s})))
        if leaves:
            line.shutdown(socket.SHUT_WR)
        else:
            time.sleep(LIMITS.old_s + 0.1)
        daemon.send_signal(signal.SIGCONT)
        nothing_starts(site, stands_s)


def test_page_s_request_of_now_starts_the_wheels(site: Site) -> None:
    """Or the test before would pass whatever it sends."""
    stands(site, "resume", "--live", "--live-port", "0")
    line, newest_s = page(site)
    with line:
        line.sendall(message(msgspec.json.encode({"do": "resume", "asked_s": newest_s})))
        wait_for("it drives", lambda: site.turning)


# -- the clock ---------------------------------------------------------------------------------------------------------


def test_wall_clock_that_is_set_makes_no_permission_fresh_and_none_stale(site: Site) -> None:
    site.daemon(program=ILL)
    old = request("arm")
    time.sleep(PERMISSION_S + 0.1)
    with socket.socket(socket.AF_UNIX) as line:
        line.settimeout(30.0)
        line.connect(str(site.socket))
        for by_s in (-3600.0, 3600.0):
            site.folder.joinpath(broken_os.CLOCK_STEP).write_text(str(by_s), encoding="ascii")
            line.sendall(old)
            assert "s ago" in msgspec.json.decode(line.recv(65_536))["why"]
            line.sendall(request("arm"))
            assert msgspec.json.decode(line.recv(65_536))["ok"]
            site.ask("disarm")


def test_disk_that_freezes_keeps_the_rover_disarmed_for_good(site: Site) -> None:
    """The command says that nothing was started, while it is so, and stays so when the disk answers."""
    site.daemon(program=FROZEN)
    began_s = now_s()
    arming = site.start(*WAYFARER, "arm", "0")
    wait_for("it is being checked", lambda: site.status()["being_checked"])
    assert "being checked" in command("status", env=site.environment).stdout
    assert arming.wait(10.0) == 1
    assert now_s() - began_s < FROZEN_S
    assert "longer than 4 s" in site.said()
    assert not site.status()["being_checked"]
    time.sleep(began_s + FROZEN_S + LOOKS_S - now_s())
    assert site.status()["mode"] == "disarmed"
    assert not told_to_turn(site.commands(began_s))
