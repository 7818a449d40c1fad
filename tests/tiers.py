"""The three tiers of tests. Each test is in one: the longest that it is marked with, or that of its folder.

unit     virtual time or none at all, in pytest's own process
process  a real process: daemon, systemd, gpsd, browser, kernel shim, workers of a campaign; and pages that are drawn
long     above about 10 s: soak, kills at random instants, replay of a campaign, planted leaks, many damaged inputs

Plain ``pytest`` leaves out ``long``; ``pytest -m unit`` takes one tier. A unit test that starts a process fails.

Each worker takes a file at a time. Tests of processes come first and mostly wait, so there are two workers more than
cores. Those that judge how soon a process does something put it first (``tests/system/subprocesses.py``).

No test can hang: after the limit of its tier it fails, whatever it waits for.

A bound in real time also measures the computer. So a test of a process that fails is run again, twice at most, and
pytest's summary shows it. A daemon that breaks its promise fails each time. Unit tests have no such excuse.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from multiprocessing import util
from pathlib import Path

import pytest

TIERS = ("unit", "process", "long")
RERUNS = 2
# Seconds, of a test with its fixtures; some ten times what the longest takes on an idle computer. Chosen by us.
LIMIT_S = {"unit": 120, "process": 300, "long": 3600}
# Drawing takes most of the time of the tests of pages, and is the same on every Python: not a unit test's.
PROCESS_FOLDERS = {Path(__file__).parent / folder for folder in ("system", "reports")}

_STARTS = {"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.system"}
_in_unit_test = False


def tier_of(item: pytest.Item) -> str:
    """Return the tier of a test."""
    marked = [mark.name for mark in item.iter_markers() if mark.name in TIERS]
    return max([*marked, "process" if item.path.parent in PROCESS_FOLDERS else "unit"], key=TIERS.index)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """If unit tests alone are asked for, leave out folders that have none: each worker would import what they do."""
    return True if config.getoption("markexpr") == "unit" and collection_path in PROCESS_FOLDERS else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark each test with its tier only, and begin with those that wait long, so that all workers end at once."""
    tiers = {item: tier_of(item) for item in items}
    for item, tier in tiers.items():
        for node in item.listchain():
            node.own_markers[:] = [mark for mark in node.own_markers if mark.name not in TIERS]
        item.add_marker(tier)
        item.add_marker(pytest.mark.timeout(LIMIT_S[tier]))
        if tier != "unit":
            item.add_marker(pytest.mark.flaky(reruns=RERUNS))
    items.sort(key=lambda item: -TIERS.index(tiers[item]))


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """Return two more than there are cores, unless processes are left out or the number is set."""
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ or config.getoption("markexpr") == "unit":
        return None  # xdist knows
    return len(os.sched_getaffinity(0)) + 2


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Let no unit test start a process, in its fixtures neither."""
    global _in_unit_test  # noqa: PLW0603 - an audit hook has no other way to know
    _in_unit_test = item.get_closest_marker("unit") is not None
    try:
        return (yield)
    finally:
        _in_unit_test = False


def refuse_process() -> None:
    """Fail a unit test."""
    if _in_unit_test:
        pytest.fail("a unit test starts no process: mark it @pytest.mark.process", pytrace=False)


def _audit(event: str, _: object) -> None:
    if event in _STARTS:
        refuse_process()


sys.addaudithook(_audit)

# What multiprocessing spawns raises no audit event.
_spawn = vars(util)["spawnv_passfds"]


def _spawn_or_refuse(*args: object) -> object:
    refuse_process()
    return _spawn(*args)


setattr(util, "spawnv_passfds", _spawn_or_refuse)  # noqa: B010 - no part of its stubs
