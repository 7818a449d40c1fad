"""The safety case: for each way in which the rover can do harm, what keeps it from that, and what shows that it does.

Mechanisms come from the table of conditions (``safety.conditions``) and its words, and from that of modes
(``control.modes``); tests come from the fault catalogue; what these cannot know stands here. ``docs.generate`` writes
the page. A row without a test is an error (``tests/docs/test_safety_case.py``), and so is a test that there is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from tests.faults.catalogue import catalogue
from wayfarer.control.modes import MODES, Event, Mode
from wayfarer.fieldlog.wording import sentence
from wayfarer.safety.conditions import HOLDING_LEVELS, LEVELS, MANUAL_LEVELS, TABLE, Condition, Means
from wayfarer.vocabulary import WORDS

PAGE = """# Safety case

Each hazard with its causes, what keeps the rover from it, the tests that show so, and what remains. A cause is a
condition of the rover ([levels and words](what-stops-the-wheels.md)), an event that changes
[its mode](what-stops-the-wheels.md#modes), or something else. A test is a scenario of
the [fault catalogue](../reference/faults.md#the-fault-catalogue), or a file of `tests/` with the name of a test in it.
"""
HEAD = ("cause", "mechanism", "test", "what remains")

UNASKED = "Wheels turn that nobody commanded"
UNSTOPPABLE = "Wheels turn that cannot be stopped"
UNEXPECTED = "Wheels turn when nobody expects it"
ASTRAY = "The rover drives in a wrong direction"
PUSHES = "The rover pushes at what it does not see"
BREAKS = "The rover breaks, or burns its motors"
STRANDED = "The rover stops in the wood, and nobody fetches it"
HAZARDS = (UNASKED, UNSTOPPABLE, UNEXPECTED, ASTRAY, PUSHES, BREAKS, STRANDED)  # the worst first


class Case(NamedTuple):
    """What is known of a condition, or of an event, beside its row: sentences without a full stop.

    ``tests`` are ``"file::name"``, below ``tests/``; the fault catalogue's scenarios that name the condition are added.
    """

    hazard: str
    remains: str
    tests: tuple[str, ...] = ()


_DEEPER = "A deeper dip resets the computer: then the board's deadman stops the wheels"
CASES: Mapping[Condition, Case] = {
    Condition.COMPASS_STALE: Case(ASTRAY, "It turns or drives blind for 0.25 s"),
    Condition.COMPASS_LOST: Case(
        ASTRAY,
        "A mission goes on by reckoning: see there",
        ("control/test_controller.py::test_lost_compass_is_a_fault_that_disarms_a_rover_among_people",),
    ),
    Condition.COMPASS_IMPLAUSIBLE: Case(ASTRAY, "A compass that is wrong and smooth, as near iron, is believed"),
    Condition.COMPASS_FROZEN: Case(
        ASTRAY,
        "It is found after a second of turns or 5 s of driving; if pitch or roll still changes, only by the turns",
        (
            "detector/test_compass.py::"
            "test_compass_that_repeats_all_values_for_seconds_of_driving_is_frozen_though_no_turn_is_commanded",
        ),
    ),
    Condition.COMPASS_UNCALIBRATED: Case(ASTRAY, "The heading may be off by tens of degrees without a jump"),
    Condition.HEADING_RECKONED: Case(
        ASTRAY, "The heading drifts with each turn, and a trunk that keeps the rover from turning is not noticed"
    ),
    Condition.MOTION_UNKNOWN: Case(PUSHES, "It may push at a trunk for a stride, 3 m of wheel travel"),
    Condition.MOTION_STALE: Case(PUSHES, "It may push at a trunk for a stride, 3 m of wheel travel"),
    Condition.MOTION_IMPLAUSIBLE: Case(PUSHES, "A sensor that lies plausibly is believed while the wheels are driven"),
    Condition.CONTACT_STALE: Case(
        PUSHES,
        "Only for an algorithm that uses the bumper: a stall or a tilt still counts",
        (
            "detector/test_contact.py::test_silent_contact_sensor_is_stale_and_touches_nothing",
            "control/test_supervisor_services.py::"
            "test_run_is_fresh_only_while_a_sensor_that_it_needs_neither_fails_nor_hangs",
        ),
    ),
    Condition.WHEELS_STALE: Case(
        PUSHES,
        "Wheels that stall are not noticed meanwhile; a motion sensor, a tilt or the end of a stride still counts",
        ("detector/test_wheels.py::test_silent_wheels_are_stale_and_hide_no_stall",),
    ),
    Condition.SLIP_UNSEEN: Case(
        PUSHES,
        "It may push at a trunk with spinning wheels for a stride, 3 m of wheel travel",
        ("detector/test_wheels.py::test_rover_that_sees_no_slip_says_so_and_ends_its_strides",),
    ),
    Condition.OVERTURNED: Case(UNEXPECTED, "A rover without tilt, or whose compass is silent, does not notice"),
    Condition.RUNAWAY: Case(
        UNASKED, "Only a motion sensor sees it: without one, what the board reports; a relay that sticks needs a switch"
    ),
    Condition.DRIVE_REVERSED: Case(ASTRAY, "It is judged on level ground, after 45 degrees the other way"),
    Condition.CANNOT_TURN: Case(
        BREAKS, "Motors at full duty for half a second at a time; the board limits the current"
    ),
    Condition.ENTRAPPED: Case(BREAKS, "Only if the rover file has give_up = true: a person must fetch it"),
    Condition.NO_PROGRESS: Case(STRANDED, "There are places from which no manoeuvre leads out"),
    Condition.RESTING: Case(
        BREAKS,
        "It drives on after the rest, with a warning of a second",
        (
            "escape/test_progress.py::test_rover_without_progress_climbs_the_ladder_rests_warns_and_climbs_it_again",
            "escape/test_ladder.py::test_each_rest_is_twice_as_long_up_to_a_bound",
        ),
    ),
    Condition.MOTORS_FAILED: Case(
        UNSTOPPABLE, "A board whose deadman fails as well: fit a switch in the motors' supply"
    ),
    Condition.BOARD_DISAGREES: Case(UNASKED, "A board that cannot report its duties is not judged"),
    Condition.BOARD_SILENT: Case(
        BREAKS,
        "Battery and faults are unknown meanwhile",
        (
            "safety/test_power.py::test_board_that_falls_silent_says_nothing_any_more",
            "control/test_supervisor_services.py::test_board_or_light_that_fails_is_told_once_and_the_rover_drives_on",
        ),
    ),
    Condition.BATTERY_LOW: Case(STRANDED, "It drives on: somebody must look at the light or the status"),
    Condition.BATTERY_CRITICAL: Case(
        BREAKS, "Without a voltage of the board, or limits in the rover file, nothing warns"
    ),
    Condition.UNDERVOLTAGE: Case(UNSTOPPABLE, _DEEPER),
    Condition.POWER_UNSTABLE: Case(UNSTOPPABLE, _DEEPER),
    Condition.OPERATOR_HOLD: Case(
        UNSTOPPABLE,
        "A hold by radio needs the radio: out of its reach only the rover itself acts",
        (
            "control/test_controller_arming.py::"
            "test_hold_stops_the_wheels_at_the_next_tick_until_resumed_and_the_mission_goes_on",
        ),
    ),
    Condition.RESUME_WARNING: Case(
        UNEXPECTED,
        "A person who does not see the light has no warning",
        (
            "safety/test_resume_warning.py::test_it_warns_after_a_hold_of_more_than_a_second",
            "control/test_motor_failures.py::test_board_that_was_opened_again_drives_after_the_warning",
        ),
    ),
    Condition.TICK_LATE: Case(UNEXPECTED, "Until the tick comes, the board's deadman alone stops the wheels"),
    Condition.DECISION_INVALID: Case(
        UNASKED,
        "A wrong decision that is a number is limited in duty and growth only",
        ("control/test_controller.py::test_decision_that_is_no_number_stops_latches_and_disarms",),
    ),
}


_ARMING = "control/test_controller_arming.py::"
_BY_HAND = "control/test_controller_manual.py::"
_BOARD = "control/test_motor_failures.py::"
_STALE = "daemon/test_permission.py::test_nothing_starts"
_AFTER_A_STOP = "control/test_interleavings.py::test_after_a_stop_no_wheel_turns_until_a_later_request"
EVENTS: Mapping[Event, Case] = {
    Event.ARM: Case(
        UNEXPECTED,
        "The start delay warns a person who stands there; nothing looks for one",
        (_ARMING + "test_start_delay_passes_before_the_wheels_turn", _STALE),
    ),
    Event.SETTLED: Case(
        UNEXPECTED,
        "A heading that is wrong and rests is taken",
        (
            _ARMING + "test_arming_is_refused_when_the_heading_does_not_settle",
            _BOARD + "test_board_that_fails_during_the_start_delay_disarms",
        ),
    ),
    Event.DISARM: Case(
        UNSTOPPABLE,
        "A stop by radio needs the radio",
        (_AFTER_A_STOP, _ARMING + "test_disarm_stops_at_the_next_tick_until_armed_again"),
    ),
    Event.MANUAL: Case(
        UNEXPECTED,
        "Who drives by hand may not see the rover",
        (_BY_HAND + "test_stick_that_is_held_from_the_beginning_drives_only_once_it_was_let_go", _AFTER_A_STOP, _STALE),
    ),
    Event.END_MANUAL: Case(
        UNSTOPPABLE,
        "Of a client that is gone it is known only after 2 s; the wheels stop long before",
        (
            _BY_HAND + "test_client_that_has_gone_leaves_the_rover_as_it_was",
            _BY_HAND + "test_mission_waits_with_its_clocks_and_is_held_afterwards",
        ),
    ),
    Event.HOLD: Case(
        UNSTOPPABLE,
        "A held rover drives on once anybody resumes it",
        (_AFTER_A_STOP, _ARMING + "test_rover_that_is_held_while_it_arms_waits_for_the_resume"),
    ),
    Event.RESUME: Case(
        UNEXPECTED,
        "There is no start delay: the person who resumes must look first",
        (_ARMING + "test_hold_stops_the_wheels_at_the_next_tick_until_resumed_and_the_mission_goes_on", _STALE),
    ),
    Event.GOAL: Case(
        ASTRAY,
        "A heading that is wrong is followed",
        (_ARMING + "test_goal_is_changed_for_the_decisions_and_nothing_else",),
    ),
    Event.BOARD_OPENED: Case(
        UNEXPECTED,
        "Nobody asks for it: the light warns for a second",
        (
            _BOARD + "test_board_that_was_opened_again_drives_after_the_warning",
            _BOARD + "test_operator_who_holds_meanwhile_decides_when_it_goes_on",
            "control/test_modes.py::Walk",
        ),
    ),
}


class Beyond(NamedTuple):
    """A row that no condition stands for."""

    hazard: str
    cause: str
    mechanism: str
    tests: tuple[str, ...]
    remains: str


BEYOND: tuple[Beyond, ...] = (
    Beyond(
        UNSTOPPABLE,
        "The computer fails, or loses its power",
        "The motor board's own deadman (S4) stops the wheels; arming proves that it is on",
        (
            "system/test_brown_out.py::test_wheels_stand_within_the_deadman_after_a_brown_out_of_the_board"
            "_and_the_death_of_the_daemon",
            "system/test_stop_owners.py::test_board_stops_the_wheels_of_a_daemon_that_is_gone",
        ),
        "An H-bridge on GPIO pins has none without a monostable: arming asks for allow_no_deadman",
    ),
    Beyond(
        UNSTOPPABLE,
        "The daemon is killed, hangs, or ends by an error",
        "It stops the wheels first; the stall guard does if it hangs for 0.2 s, systemd's ExecStopPost once it is gone",
        (
            "system/test_stop_owners.py::test_ended_daemon_stops_the_wheels_itself_and_writes_how_it_ended",
            "system/test_stop_owners.py::test_error_in_an_algorithm_ends_the_daemon_with_the_wheels_stopped",
            "daemon/test_watchdog.py::test_blocked_loop_has_its_wheels_stopped_again_and_again",
        ),
        "A killed daemon stops nothing by itself: up to 0.3 s until the deadman acts",
    ),
    Beyond(
        UNEXPECTED,
        "A request to start waited: in a suspended daemon, on a disk, in a network",
        "A permission is fresh for 4 s, good for one start, and void after a stop or if who asked has gone",
        (
            "daemon/test_permission.py::test_nothing_starts",
            "system/test_stop_owners.py::test_suspended_daemon_notices_when_it_wakes_and_ends_in_order",
        ),
        "Within 4 s of asking, the wheels start though who asked may have turned away: the start delay is for that",
    ),
    Beyond(
        UNEXPECTED,
        "The link to a person who drives by hand is lost, late or repeats itself",
        "Wheels turn only on a sample that is younger than the deadman, and newer than the last one",
        (
            "control/test_controller_manual.py::test_wheels_turn_only_on_a_young_sample_however_the_link_loses_delays"
            "_repeats_and_reorders",
        ),
        "It drives on for the deadman's time",
    ),
)


def page() -> str:
    """Return the page."""
    return PAGE + "".join(map(_section, HAZARDS))


def _section(hazard: str) -> str:
    conditions = (_row(condition) for condition, case in CASES.items() if case.hazard is hazard)
    events = (_event(event) for event, case in EVENTS.items() if case.hazard is hazard)
    beyond = (_beyond(each) for each in BEYOND if each.hazard is hazard)
    rows = [HEAD, ("---",) * len(HEAD), *conditions, *events, *beyond]
    return f"\n## {hazard}\n\n" + "".join(f"| {' | '.join(cells)} |\n" for cells in rows)


def scenarios(condition: Condition) -> Iterator[str]:
    """Yield the names of the fault catalogue's scenarios that expect a condition."""
    return (each.name for each in catalogue() if condition.value in each.expect.causes)


def levels(condition: Condition) -> str:
    """Return the levels of a condition: ``S2; among people S3; by hand S1``, those that differ."""
    level, people, by_hand = (each[condition] for each in (LEVELS, HOLDING_LEVELS, MANUAL_LEVELS))
    told = f"S{level.value}"
    told += f"; among people S{people.value}" if people is not level else ""
    return told + (f"; by hand S{by_hand.value}" if by_hand is not level else "")


def _row(condition: Condition) -> tuple[str, ...]:
    case, row, words = CASES[condition], TABLE[condition], WORDS[condition]
    refused = " `arm` refuses it." if Means.NOT_ARMED in row.means else ""
    mechanism = f"`{condition.value}` ({levels(condition)}): {words.does}.{refused}"
    return sentence(words.what), mechanism, _named(*scenarios(condition), *case.tests), case.remains


def _event(event: Event) -> tuple[str, ...]:
    case, does = EVENTS[event], {mode: row.does for (mode, each), row in MODES.items() if each is event}
    mechanism = "".join(f"{sentence(mode.value)}: {what}. " for mode, what in does.items())
    refused = "In another mode it is refused." if len(does) < len(Mode) else ""
    return f"Event: {event.value}", (mechanism + refused).rstrip(), _named(*case.tests), case.remains


def _beyond(row: Beyond) -> tuple[str, ...]:
    return row.cause, row.mechanism, _named(*row.tests), row.remains


def _named(*names: str) -> str:
    return ", ".join(f"`{name}`" for name in names)
