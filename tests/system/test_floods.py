"""Floods of the control socket and of the live page: the tick goes on, and a stop of anybody gets in at once."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import re
import resource
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from tests.system.flooders import connected, flooded, message, upgrade
from tests.system.hil_setup import Site, wait_for
from tests.system.measures import jitter, now_s
from wayfarer.daemon.socket.protocol import RequestRefused

QUIET_S, FLOOD_S = 1.0, 1.0
JITTER_S = 0.02  # a tick is late, and the wheels are held, beyond 0.2 s
STOPS_S = 0.25  # before any deadman
MORE_MB = 3.0
OPENED_S = 1.0  # by a page that is opened: behind a hundred connections that wait to be accepted, 5 ms each

OF_THE_SOCKET = (
    "requests", "requests without reading", "lines without end", "connections", "half lines", "new requests",
)  # fmt: skip
OF_THE_PAGE = ("connections", "half lines", "pages", "new viewers", "messages", "messages without reading")


def floods(site: Site, kind: str, where: str, *stops: tuple[Callable[[], object], float]) -> None:
    """Flood an armed rover, and then have people stop it, one after the other, each within a time."""
    quiet_s = now_s()
    time.sleep(QUIET_S)
    with flooded(kind, where):
        flood_s = now_s()
        time.sleep(FLOOD_S)
        ends_s = now_s()
        for stop, within_s in stops:
            if not site.drives:
                site.ask("resume")
                wait_for("it drives again", lambda: site.drives)
            asked_s = now_s()
            stop()
            answered_s = now_s()
            stopped_s = site.stopped_by_daemon_s(asked_s - QUIET_S)
            print(f"{kind}: stopped {stopped_s - asked_s:.3f} s, answered {answered_s - asked_s:.3f} s")
            assert stopped_s - asked_s < within_s
    times_s = site.ticks_beyond(ends_s - 0.2)
    before, after = jitter(times_s, quiet_s, flood_s), jitter(times_s, flood_s, ends_s)
    held = [record for record in site.log() if record["record"] == "tick" and record["cause"] == "tick_late"]
    print(f"jitter of the tick, median / p95 / worst: {before} before, {after} with it")
    assert not held
    assert after.median_s - before.median_s < JITTER_S


@pytest.mark.parametrize("kind", OF_THE_SOCKET)
def test_flood_of_the_socket_holds_no_wheel_and_keeps_no_stop_out(site: Site, kind: str) -> None:
    site.armed()
    floods(site, kind, str(site.socket), (lambda: site.ask("disarm"), STOPS_S))


def memory_mb(pid: int) -> float:
    """Return what a process has in memory."""
    pages = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * resource.getpagesize() / 1e6


def page_of(site: Site) -> tuple[str, str]:
    """Return the port and the query of the page of an armed rover."""
    site.armed("--live", "--live-port", "0")
    ((port, query),) = set(re.findall(r"http://127.0.0.1:(\d+)/(\S+)", site.said()))
    return port, query


def test_flood_of_stops_takes_no_memory_and_keeps_nobody_else_out(site: Site) -> None:
    """They wait for no turn. The rover stands as long as it lasts, and can be armed afterwards."""
    daemon = site.armed()
    with flooded("stops", str(site.socket)):
        time.sleep(FLOOD_S)
        before_mb = memory_mb(daemon.pid)
        for _ in range(5):
            assert site.status()["mode"] == "disarmed"
        time.sleep(FLOOD_S)
        print(f"stops: {before_mb:.1f} MB, {memory_mb(daemon.pid):.1f} MB after {FLOOD_S:g} s more")
        assert memory_mb(daemon.pid) - before_mb < MORE_MB
    assert not site.turning

    def arms() -> bool:
        with suppress(RequestRefused):  # those that wait in the kernel are stops, too
            site.ask("arm", heading_deg=0.0)
        return site.drives

    wait_for("it is armed and drives", arms)


@pytest.mark.parametrize("kind", OF_THE_PAGE)
def test_flood_of_the_page_holds_no_wheel_and_keeps_no_stop_out(site: Site, kind: str) -> None:
    """Of a command, nor of a person who opens the page: all places are taken by others, who have no token."""
    port, query = page_of(site)

    def stop_on_the_page() -> None:
        with connected(port) as page:
            page.sendall(upgrade(port, query) + message(b'{"do": "hold"}'))
            said = b""
            while b'"held"' not in said:
                data = page.recv(65_536)
                assert data, said
                said += data

    floods(site, kind, port, (lambda: site.ask("hold"), STOPS_S), (stop_on_the_page, OPENED_S))
