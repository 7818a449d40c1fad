"""Each test is in one tier, and a unit test starts no process."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import subprocess
from collections.abc import Callable

import pytest

from tests.tiers import LIMIT_S

pytest_plugins = ["pytester"]

NO_PROCESS = "a unit test starts no process: mark it @pytest.mark.process"
STARTS: dict[str, Callable[[], object]] = {
    "subprocess": lambda: subprocess.run(["true"], check=True),
    "shell": lambda: os.system("true"),
    "fork": os.fork,
    "asyncio": lambda: asyncio.run(asyncio.create_subprocess_exec("true")),
    "spawned worker": lambda: multiprocessing.get_context("spawn").Process(target=print).start(),
    "forked worker": lambda: multiprocessing.get_context("fork").Process(target=print).start(),
}


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_unit_test_that_starts_a_process_fails_with_the_marker_that_it_needs(start: Callable[[], object]) -> None:
    with pytest.raises(pytest.fail.Exception) as failed:
        start()
    assert failed.value.msg == NO_PROCESS


@pytest.mark.process
@pytest.mark.parametrize("start", [STARTS["subprocess"], STARTS["shell"]])
def test_process_test_may(start: Callable[[], object]) -> None:
    start()


CONFTEST = "from tests.tiers import pytest_collection_modifyitems, pytest_runtest_protocol"
TESTS = """
import subprocess
import pytest

def test_plain(): pass

def test_starts(): subprocess.run(["true"])

@pytest.fixture
def started(): subprocess.run(["true"])

def test_with_a_fixture_that_starts(started): pass

@pytest.mark.process
class TestProcesses:
    def test_starts(self, started): subprocess.run(["true"])

    @pytest.mark.long
    def test_long(self): pass

    @pytest.mark.parametrize("how", ["short", pytest.param("long", marks=pytest.mark.long)])
    def test_both(self, how): pass
"""
TIERS = {
    "unit": ["test_plain", "test_starts", "test_with_a_fixture_that_starts"],
    "process": ["TestProcesses::test_starts", "TestProcesses::test_both[short]"],
    "long": ["TestProcesses::test_long", "TestProcesses::test_both[long]"],
}


@pytest.fixture
def suite(pytester: pytest.Pytester) -> pytest.Pytester:
    """Tests of all tiers."""
    pytester.makeconftest(CONFTEST)
    pytester.makeini("[pytest]\nasyncio_default_fixture_loop_scope = function\nmarkers =\n  unit\n  process\n  long")
    pytester.makepyfile(test_suite=TESTS)
    return pytester


@pytest.mark.parametrize("tier", TIERS)
def test_test_is_in_the_longest_tier_that_it_is_marked_with_and_in_no_other(suite: pytest.Pytester, tier: str) -> None:
    lines = suite.runpytest_inprocess("-m", tier, "--collect-only", "-q", "-p", "no:cacheprovider").outlines
    assert [line.removeprefix("test_suite.py::") for line in lines if "::" in line] == TIERS[tier]


def test_only_unit_tests_fail_that_start_a_process(suite: pytest.Pytester) -> None:
    done = suite.runpytest_inprocess("-p", "no:cacheprovider")
    done.assert_outcomes(passed=5, failed=1, errors=1)
    assert done.stdout.str().splitlines().count(NO_PROCESS) == 2


def test_test_that_hangs_fails_after_the_limit_of_its_tier(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(LIMIT_S, "unit", 0.1)
    suite.makepyfile(test_suite="import threading\n\ndef test_hangs(): threading.Event().wait()")
    done = suite.runpytest_inprocess("-p", "no:cacheprovider")
    done.assert_outcomes(failed=1)
    done.stdout.fnmatch_lines("*Timeout (>0.1s)*")
