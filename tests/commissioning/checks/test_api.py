"""Findings, and running checks."""

from __future__ import annotations

import json
from pathlib import Path

from tests.commissioning.checks.rigs import Rig
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import CheckVerdict, Finding, Inspection, passed, run_checks
from wayfarer.commissioning.checks.api import fail, ok, skipped, warn
from wayfarer.commissioning.checks.standalone import StandaloneInspection

ALL = (ok("a", "fine"), skipped("b", "no b"), warn("c", "odd", "why", "do"), fail("d", "bad", "why", "do"))


def test_only_a_failure_keeps_from_arming() -> None:
    assert passed(ALL[:3])
    assert not passed(ALL)


def test_findings_are_plain_json() -> None:
    text = json.dumps([finding._asdict() for finding in ALL])
    assert json.loads(text)[3] == {"name": "d", "verdict": "fail", "found": "bad", "cause": "why", "remedy": "do"}


def test_a_check_that_breaks_is_a_finding_and_the_others_run_on(tmp_path: Path) -> None:
    async def broken_check(inspection: Inspection) -> Finding:
        raise ZeroDivisionError("in a\nthird party's driver")

    async def sound_check(inspection: Inspection) -> Finding:
        return ok("sound", "fine")

    rig = Rig(tmp_path)
    inspection = StandaloneInspection(rig.config, rig.rover, rig.host)
    broken, sound = run_virtually(run_checks(inspection, [broken_check, sound_check]))
    assert broken.verdict is CheckVerdict.FAIL
    assert (broken.name, broken.found) == ("broken check", "ZeroDivisionError: in a third party's driver")
    assert sound.verdict is CheckVerdict.OK
