"""Rows of the fault catalogue that no simulated run can show: a test in wayfarer's checkout holds each of them."""

from __future__ import annotations

from typing import NamedTuple

from wayfarer.fault_scenarios.scenario import ResponseLevel


class FaultTest(NamedTuple):
    """A fault that a test makes happen: mostly to the real daemon, as a process over simulated chips.

    ``asked`` is what the fault catalogue asks for, ``level`` and ``within_s`` what the test holds the rover to.
    ``within_s`` is None where nothing is timed; where the motor board's deadman stops the wheels, it is that of the
    slower board. ``test`` is the test's name for pytest.
    """

    name: str
    row: int
    about: str
    asked: str
    level: ResponseLevel
    within_s: float | None
    test: str


_ALL = (
    FaultTest(
        "motor-field", 12, "the motors' current turns the heading by 13 degrees at full duty",
        "pre-arm test refuses > 10 deg; at check", ResponseLevel.FAULT, None,
        "tests/commissioning/calibrate/test_calibrate.py::test_the_heading_shift_of_the_motors_is_measured_and_judged",
    ),
    FaultTest(
        "flow-swapped", 19, "the flow sensor is mounted a quarter turn round, or the wrong way",
        "`check` push test fails; at check", ResponseLevel.FAULT, None,
        "tests/commissioning/checks/test_motion.py::test_a_push_tells_how_the_sensor_is_mounted",
    ),
    FaultTest(
        "failsafe-off", 24, "the ThunderBorg does not acknowledge its failsafe when the rover is armed",
        "refuse to arm; at arm", ResponseLevel.FAULT, None,
        "tests/system/test_arming_refused.py::test_board_that_does_not_acknowledge_its_failsafe_is_not_armed",
    ),
    FaultTest(
        "deadman-unproved", 25, "nobody has seen the Sabertooth stop the wheels by itself, or not with this timeout",
        "send cmd 14 at open and every 1 s; never rely on it alone", ResponseLevel.FAULT, None,
        "tests/system/test_arming_refused.py::test_sabertooth_is_armed_only_with_a_proof_of_its_deadman",
    ),
    FaultTest(
        "side-reversed", 28, "the left motors are wired the other way round",
        "`check` wiggle fails; run-time: turn sign wrong 2x => S3", ResponseLevel.FAULT, None,
        "tests/commissioning/checks/test_motion.py::test_what_was_seen_of_a_side_names_the_setting_or_the_wires",
    ),
    FaultTest(
        "brown-out", 33, "the power fails for a moment: computer and motor board start again",
        "comes up DISARMED; previous log readable; event unclean_shutdown", ResponseLevel.DEADMAN, 0.3,
        "tests/system/test_brown_out.py::test_start_after_a_brown_out_is_disarmed",
    ),
    FaultTest(
        "sigterm", 34, "the service is stopped while the rover drives",
        "motors 0 first, then log close; 0.1 s, exit < 2 s", ResponseLevel.FAULT, 0.1,
        "tests/system/test_stop_owners.py::test_ended_daemon_stops_the_wheels_itself_and_writes_how_it_ended",
    ),
    FaultTest(
        "sigkill", 35, "the daemon is killed: driving, starting, arming, stopping",
        "S4 stops; next start repairs log, disarmed", ResponseLevel.DEADMAN, 0.32,
        "tests/system/test_sigkill.py::test_every_kill_leaves_standing_wheels_and_a_whole_log",
    ),
    FaultTest(
        "sigstop", 36, "the daemon is suspended, or the computer swaps",
        "S4 stops; systemd watchdog SIGABRT + restart; 0.25 s motors", ResponseLevel.DEADMAN, 0.32,
        "tests/system/test_stop_owners.py::test_board_stops_the_wheels_of_a_daemon_that_is_gone",
    ),
    FaultTest(
        "loop-blocked", 37, "an algorithm blocks the event loop for a second",
        "guard thread writes zero; dump stacks; 0.2 s", ResponseLevel.HOLD, 0.22,
        "tests/system/test_algorithm_faults.py::test_guard_stops_the_wheels_of_an_algorithm_that_blocks",
    ),
    FaultTest(
        "algorithm-raises", 38, "an exception in a third party's algorithm",
        "supervisor S3, not a zombie; 1 cycle", ResponseLevel.FAULT, 0.1,
        "tests/system/test_stop_owners.py::test_error_in_an_algorithm_ends_the_daemon_with_the_wheels_stopped",
    ),
    FaultTest(
        "out-of-memory", 39, "an algorithm takes memory without end",
        "MemoryMax, as 35", ResponseLevel.FAULT, 0.25,
        "tests/system/test_algorithm_faults.py::test_algorithm_that_takes_all_memory_ends_with_the_wheels_stopped",
    ),
    FaultTest(
        "disk-full", 40, "the disk runs full while the rover drives",
        "run goes on; S0; refuse NEXT arm; detect <= 1 s", ResponseLevel.NOTE, 1.3,
        "tests/system/test_log_faults.py::test_rover_drives_on_while_the_disk_is_full",
    ),
    FaultTest(
        "logs-gone", 41, "the folder of the logs vanishes, and cannot be made again",
        "as 40; `check` fails; <= 1 s", ResponseLevel.NOTE, 1.3,
        "tests/system/test_log_faults.py::test_rover_drives_on_without_its_folder_of_logs_and_check_fails",
    ),
    FaultTest(
        "slow-disk", 42, "each sync of the log takes half a second",
        "writer thread only; control jitter < 10 ms", ResponseLevel.NONE, None,
        "tests/system/test_host_faults.py::test_slow_disk_delays_no_tick_and_costs_no_record",
    ),
    FaultTest(
        "log-deleted", 43, "the log is rotated, and a file of it deleted by somebody else",
        "no torn line; reopen; 1 s", ResponseLevel.NOTE, 1.3,
        "tests/system/test_log_faults.py::test_log_that_somebody_deletes_goes_on_in_a_new_file",
    ),
    FaultTest(
        "torn-log", 44, "the last lines are incomplete, or hold NUL bytes or no text",
        "reader skips+counts, exit 3; at start", ResponseLevel.NOTE, None,
        "tests/system/test_log_faults.py::test_torn_end_of_a_log_costs_nothing_before_it",
    ),
    FaultTest(
        "clock-step", 45, "the wall clock is set by hours, ahead and back",
        "no timer moves; clock_step event", ResponseLevel.NOTE, 0.2,
        "tests/system/test_host_faults.py::test_wall_clock_that_is_set_moves_no_timer",
    ),
    FaultTest(
        "suspend", 46, "the computer sleeps for a second: time jumps",
        "treat as loop stall: zero, re-check; 1 cycle", ResponseLevel.HOLD, 0.15,
        "tests/system/test_stop_owners.py::test_suspended_daemon_notices_when_it_wakes_and_ends_in_order",
    ),
    FaultTest(
        "bad-config", 47, "a rover file that is wrong in 8 ways, one at a time",
        "refuse start/arm; line+key+allowed range; at load", ResponseLevel.FAULT, None,
        "tests/system/test_config_faults.py::test_daemon_refuses_a_bad_rover_file_in_one_line",
    ),
    FaultTest(
        "config-changed", 48, "the rover file is changed while the daemon runs",
        "ignored until reload; hash in log", ResponseLevel.NONE, None,
        "tests/system/test_config_faults.py::test_rover_file_that_is_changed_counts_from_the_next_start_on",
    ),
    FaultTest(
        "calibration-unusable", 49, "the calibration file is garbage, another part's, or not there",
        "refuse arm, say which; at arm", ResponseLevel.FAULT, None,
        "tests/system/test_arming_refused.py::test_calibration_that_cannot_be_used_is_named",
    ),
    FaultTest(
        "socket-abuse", 50, "garbage, a line of 1 GB, half lines, byte after byte, 1,000 clients, all at once",
        "bounded line, client cap, timeout; control loop jitter unchanged; 10 ms", ResponseLevel.NONE, None,
        "tests/system/test_socket_faults.py::test_socket_that_is_abused_delays_no_tick",
    ),
    FaultTest(
        "wrong-state", 51, "valid commands in a state that does not allow them",
        "typed refusal, no state change", ResponseLevel.NONE, None,
        "tests/system/test_socket_faults.py::test_verbs_at_the_wrong_time_are_refused_and_change_nothing",
    ),
    FaultTest(
        "second-daemon", 52, "a second daemon is started; then the socket of an ended daemon is left behind",
        "lock; second exits code 75-style, first untouched; start", ResponseLevel.NONE, None,
        "tests/system/test_socket_faults.py::test_second_daemon_leaves_the_first_alone",
    ),
    FaultTest(
        "no-permission", 53, "the user is in none of the groups that own the device files",
        "`check` says which group; at check", ResponseLevel.FAULT, None,
        "tests/system/test_permissions.py::test_user_without_rights_is_told_which_group_has_them",
    ),
)  # fmt: skip
COVERED_BY_TESTS = {each.name: each for each in _ALL}
