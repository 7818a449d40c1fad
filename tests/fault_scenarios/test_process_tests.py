"""Faults that take a real process, on the real daemon and the real commands; and what judges them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from wayfarer.errors import BadInput
from wayfarer.fault_scenarios.catalogue import catalogue
from wayfarer.fault_scenarios.process_tests.check_faults import flow_swapped, motor_field, side_reversed
from wayfarer.fault_scenarios.process_tests.jitter import jitter
from wayfarer.fault_scenarios.process_tests.log_recovery import cut_off, numbered_twice, read_back
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.process_tests.rover_on_blocks import Workbench, at_workbench
from wayfarer.fault_scenarios.process_tests.sigkill import after_death
from wayfarer.fault_scenarios.process_tests.wheel_history import Commands, first_stop, spans, stop_after, told_to_turn
from wayfarer.fault_scenarios.result import Procedure, Result
from wayfarer.fault_scenarios.scenario import Reached

QUICK = (motor_field, flow_swapped, side_reversed)
SLOW = [each for each in catalogue() if isinstance(each, Procedure) and each not in QUICK]
HEADER = '{"record":"run","t_s":0.0,"schema":2}\n'
TICKS = "".join(f'{{"record":"tick","n":{n},"t_s":{n / 20}}}\n' for n in range(1, 5))
OUTCOME = '{"record":"outcome","n":5,"t_s":0.25,"reason":"requested"}\n'


@pytest.mark.slow
@pytest.mark.parametrize("row", SLOW, ids=lambda row: row.name)
def test_fault_of_a_process_is_met(row: Procedure) -> None:
    result = row.run()
    print(result)
    assert result.problems == ()


@pytest.mark.parametrize("row", QUICK, ids=lambda row: row.name)
def test_fault_that_a_check_must_find_is_found(row: Procedure) -> None:
    assert row.run().problems == ()


# -- a procedure's own judgement -------------------------------------------------------------------------------------


def judged(expected: Reached = Reached.HOLD, within_s: float | None = 0.5, **seen: Any) -> Result:
    @procedure("it", 1, "about", asked="S2", expected=expected, within_s=within_s, remark="always")
    def it(found: Observed) -> None:
        for name, value in {"changed": "something", "reached": Reached.HOLD, **seen}.items():
            setattr(found, name, value)

    return it.run()


def test_what_is_as_expected_has_no_problem() -> None:
    result = judged(detected_s=0.1, stopped_s=0.5, remark="measured")
    assert result.passed
    assert (result.reached, result.within_s, result.remark) == (Reached.HOLD, 0.5, "measured; always")


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        ({"changed": ""}, "nothing shows that the fault happened"),
        ({"reached": Reached.NONE}, "- was reached, S2 is expected"),
        ({"reached": Reached.FAULT}, "S3 was reached, S2 is expected"),
        ({"detected_s": 0.6}, "detected after 0.600 s, 0.5 s are allowed"),
        ({"stopped_s": 0.51}, "the wheels stood after 0.510 s, 0.5 s are allowed"),
    ],
)
def test_what_is_not_as_expected_is_a_problem(seen: dict[str, Any], said: str) -> None:
    assert judged(**seen).problems == (said,)


def test_procedure_that_breaks_is_a_problem_and_ends_nothing_else() -> None:
    @procedure("it", 1, "about", asked="S2", expected=Reached.NONE)
    def it(found: Observed) -> None:
        found.changed = "something"
        raise BadInput("no bench")

    assert it.run().problems == ("BadInput: no bench",)


# -- what wheels were told ---------------------------------------------------------------------------------------------

DRIVE: Commands = [(1.0, 0.3, 0.0), (1.0, 0.3, 0.3), (1.1, 0.3, 0.3), (1.4, 0.0, 0.0)]


def test_stop_is_the_first_command_after_the_last_motion() -> None:
    assert stop_after(DRIVE) == (1.1, 1.4)
    assert stop_after([*DRIVE, (2.0, 0.0, 0.1), (2.2, 0.0, 0.0), (2.3, 0.0, 0.0)]) == (2.0, 2.2)


def test_first_stop_after_a_time_is_found_though_wheels_turn_again() -> None:
    assert first_stop([*DRIVE, (2.0, 0.2, 0.1), (2.2, 0.0, 0.0)], 1.0) == (1.1, 1.4)


def test_spans_of_motion_are_those_between_stops() -> None:
    assert spans([*DRIVE, (2.0, 0.0, 0.1)]) == [(1.0, 1.4), (2.0, float("inf"))]
    assert told_to_turn(DRIVE)
    assert not told_to_turn(DRIVE[-1:])


@pytest.mark.parametrize(
    ("died_s", "found"),
    [
        (1.15, (pytest.approx(0.3), pytest.approx(0.25))),
        (1.5, (None, None)),
        (0.9, (None, None)),
    ],
)
def test_stop_after_a_death_counts_from_the_last_command_and_from_the_death(
    died_s: float, found: tuple[float | None, float | None]
) -> None:
    assert after_death(DRIVE, died_s) == found


def test_wheels_that_nobody_stops_are_stopped_never() -> None:
    assert after_death(DRIVE[:-1], 1.15) == (float("inf"), float("inf"))


# -- what a killed run left ------------------------------------------------------------------------------------------


def run_of(logs: Path, text: str, name: str = "00001-20261121T061405Z") -> Path:
    run = logs / name
    run.mkdir(parents=True)
    (run / "run.jsonl").write_text(text, encoding="utf-8")
    return run


def test_log_that_a_kill_cut_short_reads_back_to_its_last_whole_tick(tmp_path: Path) -> None:
    found = read_back(run_of(tmp_path, f'{HEADER}{TICKS}{{"record":"tick","n":5'))
    assert (found.last_tick_s, found.torn, found.ended, found.problems) == (0.2, True, False, ())


def test_record_that_is_missing_or_garbled_before_the_end_is_a_problem(tmp_path: Path) -> None:
    hole = TICKS.replace('"n":2,', '"n":12,')
    assert "missing" in read_back(run_of(tmp_path / "a", HEADER + hole)).problems[0]
    assert "no record" in read_back(run_of(tmp_path / "b", f"{HEADER}nonsense\n{TICKS}")).problems[0]


def test_run_without_a_log_or_with_an_outcome_has_lost_nothing(tmp_path: Path) -> None:
    (tmp_path / "00001-20261121T061405Z").mkdir()
    assert read_back(tmp_path / "00001-20261121T061405Z") == (None, False, False, False, ())
    run = run_of(tmp_path, HEADER + TICKS + OUTCOME, "00002-20261121T061405Z")
    assert read_back(run).ended
    assert cut_off(tmp_path) is None


def test_newest_run_without_an_outcome_was_cut_off(tmp_path: Path) -> None:
    assert cut_off(tmp_path) is None
    run_of(tmp_path, HEADER + TICKS + OUTCOME)
    run = run_of(tmp_path, HEADER + TICKS, "00002-20261121T061405Z")
    assert cut_off(tmp_path) == run.name


def test_runs_that_share_a_number_are_found(tmp_path: Path) -> None:
    for name in ("00001-20261121T061405Z", "00002-20261121T061405Z", "00002-20261121T061406Z"):
        run_of(tmp_path, HEADER, name)
    assert numbered_twice(tmp_path) == ["2 runs have the number 2"]


# -- ticks and wheels on blocks ----------------------------------------------------------------------------------------


def test_jitter_is_how_far_ticks_are_from_their_period() -> None:
    even = [number * 0.05 for number in range(101)]
    late = [t_s + 0.02 * (number == 50) for number, t_s in enumerate(even)]
    assert jitter(even, 0.0, 5.0) == pytest.approx((0.0, 0.0, 0.0))
    assert jitter(late, 0.0, 5.0) == pytest.approx((0.0, 0.0, 0.02))


def test_loop_that_hardly_ticks_has_no_jitter_to_speak_of() -> None:
    with pytest.raises(ValueError, match="only 3 ticks"):
        jitter([0.0, 1.0, 2.0], 0.0, 5.0)


def test_person_beside_a_rover_that_is_well_finds_nothing_wrong() -> None:
    async def look(bench: Workbench) -> dict[str, str]:
        return {found.name: found.verdict.value for found in (await bench.check()).values()}

    found = at_workbench(look)
    wheels = ("deadman trips", "left wheels", "right wheels", "notices being stuck", "push")
    assert {found[name] for name in wheels} == {"ok"}
    assert "fail" not in found.values()
