"""The calibration file: what is saved is loaded, what is broken is refused by name."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.config.calibration_file import (
    FILE_NAME,
    Calibration,
    DeadmanEntry,
    FlowEntry,
    calibration_file,
    load,
    save,
    stamp,
)
from wayfarer.errors import BadInput, WayfarerError

T_WALL = 1_795_000_000.0

settings = st.dictionaries(
    st.text(), st.none() | st.booleans() | st.integers(-(2**31), 2**31) | st.floats(-1e9, 1e9) | st.text()
)
st.register_type_strategy(
    DeadmanEntry, st.builds(DeadmanEntry, t_wall=st.floats(0.0, 4e9), date=st.text(), part=st.text(), settings=settings)
)


@given(calibration=...)
def test_what_is_saved_is_loaded(tmp_path_factory: pytest.TempPathFactory, calibration: Calibration) -> None:
    path = tmp_path_factory.mktemp("state") / FILE_NAME
    save(path, calibration)
    assert load(path) == calibration


def test_what_checks_a_file_is_built_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load(tmp_path / FILE_NAME)
    monkeypatch.setattr("wayfarer.config.calibration_file.TypeAdapter", None)
    save(tmp_path / FILE_NAME, Calibration())
    assert load(tmp_path / FILE_NAME) == Calibration()


def test_no_file_is_an_empty_calibration(tmp_path: Path) -> None:
    assert load(tmp_path / FILE_NAME) == Calibration()


def test_an_entry_says_when_it_was_made_to_people_too() -> None:
    assert stamp("CMPS14", T_WALL) == {"part": "CMPS14", "t_wall": T_WALL, "date": "2026-11-18"}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "JSON"),
        ("[]", "object"),
        ('{"schema": 2}', "schema"),
        ('{"schema": 1, "gyro": {}}', "gyro"),
        ('{"schema": 1, "flow": {"t_wall": 1.0, "date": "d", "part": "p", "scale": NaN}}', "flow.scale"),
        ('{"schema": 1, "flow": {"t_wall": 1.0, "date": "d", "part": "p", "scale": "1"}}', "flow.scale"),
        ('{"schema": 1, "flow": {"t_wall": 1.0, "date": "d", "scale": 1.0}}', "flow.part"),
    ],
)
def test_a_broken_file_is_refused_with_its_name_and_the_reason(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / FILE_NAME
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as refused:
        load(path)
    assert str(path) in str(refused.value)
    assert reason in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_key_with_a_line_break_is_refused_in_one_line(tmp_path: Path) -> None:
    """Found by ``tests/fuzz``."""
    (tmp_path / FILE_NAME).write_text('{"a\\nb": null}')
    with pytest.raises(BadInput) as refused:
        load(tmp_path / FILE_NAME)
    assert "\n" not in str(refused.value)


def test_a_folder_in_the_files_place_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        load(tmp_path)
    with pytest.raises(BadInput, match="is not an ordinary file"):
        save(tmp_path, Calibration())


def test_a_file_in_the_folders_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "wayfarer").touch()
    with pytest.raises(WayfarerError, match=r"cannot be written: .*; check the folder's owner and the disk"):
        save(tmp_path / "wayfarer" / FILE_NAME, Calibration())


def test_a_save_that_is_cut_short_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, old = tmp_path / FILE_NAME, Calibration(flow=FlowEntry(**stamp("p", T_WALL), scale=1.2))
    save(path, old)

    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(WayfarerError, match="No space left"):
        save(path, Calibration())
    assert load(path) == old


def test_the_file_is_where_the_service_manager_says_else_in_the_system_else_at_home(tmp_path: Path) -> None:
    home, system = tmp_path / "home", tmp_path / "system"
    given_folder = {"STATE_DIRECTORY": "/var/lib/one:/var/lib/two"}
    assert calibration_file(given_folder, home, system) == Path("/var/lib/one") / FILE_NAME
    assert calibration_file({}, home, system) == home / ".local/state/wayfarer" / FILE_NAME
    system.mkdir()
    assert calibration_file({}, home, system) == system / FILE_NAME
