"""The deadman of a board that cannot be asked: what a person saw counts, for the board and settings of that time."""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.commissioning.checks.test_parts import whole_calibration
from tests.kit.rover import T_WALL, ChipRig, Rig, Script
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import CALIBRATED, CheckVerdict, Finding, check, deadman, parts
from wayfarer.commissioning.checks.deadman import board_settings, keep_proof, proved
from wayfarer.config import calibration_file
from wayfarer.config.calibration_file import Calibration, save
from wayfarer.config.rover_file import load_rover, part_settings
from wayfarer.daemon.daemon import DryMotors

FOREST_ROVER = load_rover("forestrover")


class Watched(ChipRig):
    """A Sabertooth on blocks, wired as its rover file says, and a person who watches its wheels."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.config = FOREST_ROVER
        self.drive_by_sabertooth(part_settings("motors", FOREST_ROVER.parts["motors"])[1])
        self.file = self.host.calibration_file

    def watch(self, *, they_stopped: bool = True) -> Finding:
        """Have a person watch, and answer."""
        return self.look(Script(self.world, {"Did they turn": they_stopped}).watch_the_deadman)

    def lay_over(self, part: str = "motors", **keys: Any) -> None:
        """Change the rover file."""
        parts = {**self.config.parts, part: {**self.config.parts[part], **keys}}
        self.config = self.config.model_copy(update={"parts": parts})


@pytest.fixture
def watched(tmp_path: Path) -> Watched:
    return Watched(tmp_path)


def test_of_a_board_that_cannot_be_asked_nothing_is_claimed(watched: Watched) -> None:
    found = watched.look(parts.motor_board)
    assert found.verdict is CheckVerdict.OK
    assert found.text == "it opens; it cannot answer, and its deadman of 0.3 s is not tested by this"
    assert watched.look(parts.motor_faults).verdict is CheckVerdict.SKIPPED


def test_board_that_nobody_has_watched_is_not_armed_and_what_to_do_is_told(watched: Watched) -> None:
    found = watched.look(proved)
    assert found.verdict is CheckVerdict.FAIL
    assert found.text.startswith("nobody has seen Sabertooth 128 on /dev/ttyAMA0 stop the wheels by itself; this board")
    assert "wayfarer check" in found.remedy
    assert "deadman_unproved_because" in found.remedy


def test_what_a_person_saw_is_kept_with_date_port_and_settings_and_arms(watched: Watched) -> None:
    assert watched.watch().verdict is CheckVerdict.OK
    kept = watched.kept.deadman
    assert kept is not None
    assert (kept.date, kept.part) == ("2026-11-18", "Sabertooth 128 on /dev/ttyAMA0")
    told = {key: kept.settings[key] for key in ("buses", "driver", "port", "baud", "address", "timeout_s")}
    assert list(told.values()) == ["linux", "sabertooth", "/dev/ttyAMA0", 9600, 128, 0.3]
    found = watched.look(proved)
    assert (found.verdict, found.text) == (CheckVerdict.OK, "the wheels were seen to stop by themselves on 2026-11-18")


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"port": "/dev/ttyUSB0"}, "port = /dev/ttyAMA0 (now /dev/ttyUSB0)"),
        ({"timeout_s": 0.5}, "timeout_s = 0.3 (now 0.5)"),
        ({"address": 129, "baud": 38400}, "address = 128 (now 129), baud = 9600 (now 38400)"),
        ({"battery_min_v": 10.0}, "battery_min_v = None (now 10.0)"),
    ],
)
def test_proof_does_not_count_for_another_port_or_other_settings(
    watched: Watched, changed: dict[str, Any], told: str
) -> None:
    watched.watch()
    watched.lay_over(**changed)
    found = watched.look(proved)
    assert found.verdict is CheckVerdict.FAIL
    assert found.text.startswith(f"seen on 2026-11-18, but with {told}; this board cannot report its deadman")


def test_settings_of_other_parts_and_defaults_written_out_change_nothing(watched: Watched) -> None:
    watched.watch()
    watched.lay_over(baud=9600, address=128)
    watched.lay_over("motion", height_m=0.2)
    assert watched.look(proved).verdict is CheckVerdict.OK


def test_setting_that_is_younger_than_the_proof_counts_only_if_it_is_in_use(watched: Watched) -> None:
    watched.watch()
    kept = watched.kept
    assert kept.deadman is not None
    settings = {key: value for key, value in kept.deadman.settings.items() if key != "autobaud"}
    save(watched.file, replace(kept, deadman=replace(kept.deadman, settings=settings)))
    assert watched.look(proved).verdict is CheckVerdict.OK
    watched.lay_over(autobaud=True)
    assert "autobaud = None (now True)" in watched.look(proved).text


def test_proof_does_not_count_on_other_buses(watched: Watched) -> None:
    watched.watch()
    watched.config = watched.config.model_copy(update={"buses": "my.adapter:buses"})
    assert "buses = linux (now my.adapter:buses)" in watched.look(proved).text


def test_wheels_that_did_not_stop_take_an_earlier_proof_back(watched: Watched) -> None:
    watched.watch()
    assert watched.watch(they_stopped=False).verdict is CheckVerdict.FAIL
    assert watched.look(proved).verdict is CheckVerdict.FAIL


def test_proof_keeps_what_else_was_calibrated(watched: Watched) -> None:
    whole = whole_calibration(Rig(watched.host.root))
    save(watched.file, whole)
    watched.watch()
    assert replace(watched.kept, deadman=None) == whole


def test_proof_that_cannot_be_kept_is_a_failure_that_says_so(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(calibration_file, "write_atomically", full)
    found = watched.watch()
    assert found.verdict is CheckVerdict.FAIL
    assert "the wheels were seen to stop by themselves; not kept:" in found.text
    assert str(watched.file) in found.text


def test_proof_of_more_than_half_a_year_ago_is_a_warning(watched: Watched) -> None:
    watched.watch()
    watched.host = replace(watched.host, t_wall=T_WALL + 200 * 86_400.0)
    assert watched.look(proved).verdict is CheckVerdict.WARN


@pytest.mark.parametrize(
    ("because", "verdict"), [("the wheels hang in the lab", CheckVerdict.WARN), ("", CheckVerdict.FAIL)]
)
def test_reason_in_the_rover_file_arms_without_a_proof_and_is_told(
    watched: Watched, because: str, verdict: CheckVerdict
) -> None:
    watched.set(safety={"deadman_unproved_because": because})
    found = watched.look(proved)
    assert found.verdict is verdict
    assert because in found.text


def test_board_of_any_driver_that_reads_nothing_back_wants_a_proof_and_another_none(rig: Rig) -> None:
    for motors in (rig.motors, DryMotors(rig.motors)):
        rig.rover = replace(rig.rover, motors=motors)
        for rig.motors.tells, verdict in ((True, CheckVerdict.SKIPPED), (False, CheckVerdict.FAIL)):
            assert rig.look(proved).verdict is verdict


def test_board_without_a_deadman_is_judged_elsewhere(rig: Rig) -> None:
    rig.motors.deadman_s = None
    assert rig.look(proved).verdict is CheckVerdict.SKIPPED


def test_simulated_rover_needs_no_proof() -> None:
    assert deadman.proved in CALIBRATED


def test_first_check_with_a_person_finds_the_deadman_proved(watched: Watched) -> None:
    """It is looked at after the person was asked, so that nobody has to check twice."""
    someone, rover = Script(watched.world, {}), watched.rover
    with_person = run_virtually(check(watched.config, rover, watched.host, watched.kept, someone.ask))
    seen = "the wheels were seen to stop by themselves on 2026-11-18"
    assert with_person[-1] == Finding("deadman proved", CheckVerdict.OK, seen)
    watched.file.unlink()
    alone = run_virtually(check(watched.config, rover, watched.host, watched.kept, None))
    assert (alone[-1].name, alone[-1].verdict) == ("deadman proved", CheckVerdict.FAIL)


def test_rover_without_motors_in_its_file_has_no_settings() -> None:
    bare = FOREST_ROVER.model_copy(update={"parts": {}})
    assert board_settings(bare) == {"buses": "linux", "driver": None}


def test_forgetting_what_was_never_known_is_no_error(watched: Watched) -> None:
    keep_proof(watched.inspection(), tripped=False)
    assert watched.kept == Calibration()
