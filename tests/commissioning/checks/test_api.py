"""Findings, and running checks."""

from __future__ import annotations

from tests.kit.rover import Rig
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import CheckVerdict, Finding, Inspection, passed, run_checks
from wayfarer.commissioning.checks.api import fail, ok, skipped, warn

ALL = (ok("a", "fine"), skipped("b", "no b"), warn("c", "odd", "do"), fail("d", "bad", "do"))


def test_only_a_failure_keeps_from_arming() -> None:
    assert passed(ALL[:3])
    assert not passed(ALL)


def test_a_check_that_breaks_is_a_finding_and_the_others_run_on(rig: Rig) -> None:
    async def broken_check(inspection: Inspection) -> Finding:
        raise ZeroDivisionError("in a\nthird party's driver")

    async def sound_check(inspection: Inspection) -> Finding:
        return ok("sound", "fine")

    broken, sound = run_virtually(run_checks(rig.inspection(), [broken_check, sound_check]))
    assert broken.verdict is CheckVerdict.FAIL
    assert broken.name == "broken check"
    assert broken.text.startswith("ZeroDivisionError: in a third party's driver: an error in a driver")
    assert sound.verdict is CheckVerdict.OK
