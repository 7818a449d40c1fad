"""Rover files: what is right loads, what is wrong is told in one line with file, key and what is allowed.

Any other file is tried in ``tests/fuzz/on_files.py``.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.config.rover_texts import complaint, load, rover_toml
from wayfarer.config.rover_file import RoverConfig, laid_over, load_rover, part_settings, rover_names
from wayfarer.daemon.driven import DrivenBoard
from wayfarer.daemon.stop_motors import motors_of
from wayfarer.errors import BadConfig, BadInput, UnknownName

SOURCES = "input should be one or more of 'motion', 'contact', 'wheels', 'current', 'yaw', each once, joined by '+'"


@pytest.mark.parametrize("name", rover_names())
def test_shipped_rovers_load_and_their_parts_are_those_that_their_drivers_can_be(name: str) -> None:
    rover = load_rover(name)
    assert rover.name == name
    assert {"compass", "motion", "motors"} <= set(rover.parts)
    for part, table in rover.parts.items():
        driver, settings = part_settings(part, table)
        assert driver.part == part
        assert isinstance(settings, driver.Settings)
        for key in table.keys() - {"driver"}:
            assert getattr(settings, key) == table[key]
    assert rover.buses == "linux"


@pytest.mark.parametrize("name", sorted(set(rover_names()) - {"sim"}))
def test_shipped_rovers_for_the_field_leave_time_to_step_away_and_have_limits(name: str) -> None:
    safety = load_rover(name).safety
    assert safety.start_delay_s >= 10.0
    assert safety.mission_time_s <= 3600.0
    assert safety.mission_radius_m <= 300.0
    assert not safety.allow_no_deadman


def test_sim_rover_is_that_of_the_paper_s_forest() -> None:
    rover = load_rover("sim")
    assert (rover.vehicle.length_m, rover.vehicle.width_m) == (0.4, 0.4)
    assert rover.escape.cruise_m_s / rover.control_hz == 0.05


def test_file_with_only_a_body_has_the_defaults(tmp_path: Path) -> None:
    rover = load(tmp_path, rover_toml())
    assert rover == RoverConfig(name="test", vehicle=rover.vehicle)
    assert rover.safety.start_delay_s == 10.0


def test_values_of_the_file_are_used(tmp_path: Path) -> None:
    rover = load(tmp_path, rover_toml("control_hz = 10", "[escape]\nturn_angle_deg = 45.0", track_m="0.7"))
    assert (rover.control_hz, rover.escape.turn_angle_deg, rover.vehicle.track_m) == (10.0, 45.0, 0.7)


def test_other_sense_is_another_rover_and_this_one_stays() -> None:
    rover = load_rover("sim")
    assert rover.with_anomaly_source("contact").anomaly_source == "contact"
    assert rover.with_anomaly_source("wheels+yaw").sources == {"wheels", "yaw"}
    assert rover.anomaly_source == "motion"


def motors(table: str) -> str:
    return f"[parts.motors]\n{table}\n"


SABERTOOTH = 'driver = "sabertooth"\n'
H_BRIDGES = """
driver = "gpio_motors"
left_forward = 1
left_backward = 2
right_forward = 3
right_backward = 4
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "key 'name' is missing"),
        (rover_toml(track_m=""), "key 'vehicle.track_m' is missing"),
        (rover_toml("contro_hz = 20"), "unknown key 'contro_hz'; did you mean 'control_hz'?"),
        (rover_toml(rest="[safety]\nslew_per = 5"), "unknown key 'safety.slew_per'; did you mean 'slew_per_s'?"),
        (rover_toml(rest="[escape.x]\na = 1"), "unknown key 'escape.x'"),
        (rover_toml(length_m="inf"), "key 'vehicle.length_m' = inf: input should be a finite number; allowed is"),
        (rover_toml(length_m="-1"), "key 'vehicle.length_m' = -1: input should be greater than or equal to 0.1"),
        (rover_toml(length_m="true"), "key 'vehicle.length_m' = True: input should be a valid number"),
        (rover_toml(length_m='"long"'), "key 'vehicle.length_m' = 'long': input should be a valid number"),
        (rover_toml(rest="[board]\nbattery_low_v = 0"), "key 'board.battery_low_v' = 0: input should be"),
        (rover_toml("declination_deg = 181"), "key 'declination_deg' = 181: input should be less than or equal to 180"),
        (rover_toml('buses = "linuxx"'), "key 'buses': unknown buses 'linuxx': did you mean linux?"),
        *(
            (rover_toml(f'anomaly_source = "{source}"'), f"key 'anomaly_source' = '{source}': {SOURCES}")
            for source in ("x", "", "motion+", "motion+motion", "motion, wheels", "Motion")
        ),
        (
            rover_toml('anomaly_source = "wheels+current"'),
            "key 'anomaly_source' = 'wheels+current': 'current' needs detector.stall_current_a",
        ),
        ("vehicle = 3\nname = 'x'", "key 'vehicle' = 3: input should be a table"),
        ("a = = 3", "not valid TOML: Invalid value (at line 1, column 5)"),
        ('name = "a"\nname = "b"', "not valid TOML: Cannot overwrite a value (at line 2, column"),
        (b"\xff\xfe", "cannot be read: 'utf-8' codec can't decode byte 0xff"),
        ('"a\\nb" = 1\n' + rover_toml(), "unknown key 'a b'"),
        ("x = " + "[" * 5000, "not valid TOML: "),
        ("x = " + "9" * 5000, "not valid TOML: "),
        (rover_toml(rest="[escape]\nlevy_stride_min_m = 11.0"), "key 'escape' = {'levy_stride_min_m': 11.0}: levy_st"),
        ("control_hz = 4\n" + rover_toml(), "key 'control_hz' = 4: too slow, safety.tick_late_s = 0.2 s"),
        (
            rover_toml(rest="[board]\nbattery_low_v = 10\nbattery_critical_v = 11"),
            "key 'board' = {'battery_low_v': 10, 'battery_critical_v': 11}: battery_critical_v = 11 must be below b",
        ),
        (
            rover_toml("control_hz = 50", motors(SABERTOOTH + "baud = 2400")),
            "key 'control_hz' = 50: too fast for parts.motors.baud = 2400: ",
        ),
    ],
)  # fmt: skip
def test_bad_file_is_told_by_file_key_and_what_is_allowed(tmp_path: Path, text: str | bytes, said: str) -> None:
    assert complaint(tmp_path, text).startswith(said)


def test_mistyped_key_is_named_before_the_key_that_it_leaves_missing(tmp_path: Path) -> None:
    said = complaint(tmp_path, rover_toml(length_m="", lenght_m="0.4"))
    assert said == "unknown key 'vehicle.lenght_m'; did you mean 'length_m'?"


def test_file_that_is_not_there_names_the_shipped_rovers(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match=r"mine\.toml: no such file; shipped rovers are .*sim"):
        load_rover(str(tmp_path / "mine.toml"))


@pytest.mark.parametrize("special", ["pipe", "/dev/zero", "sparse"])
def test_special_or_endless_file_is_refused_at_once(tmp_path: Path, special: str) -> None:
    path = tmp_path / "rover.toml"
    if special == "pipe":
        os.mkfifo(path)
    elif special == "sparse":
        with path.open("wb") as file:
            file.truncate(10**12)
    else:
        path.symlink_to(special)
    for read in (load_rover, lambda name: motors_of(Path(name))):
        with pytest.raises(BadInput, match=r"cannot be read: it |not valid TOML"):
            read(str(path))


@pytest.mark.parametrize("name", ["{}/", "a\0.toml"])
def test_folder_or_path_that_no_file_can_have_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadConfig, match="cannot be read"):
        load_rover(name.format(tmp_path))


def test_unknown_rover_offers_those_there_are() -> None:
    with pytest.raises(UnknownName, match="unknown rover 'simm': did you mean sim"):
        load_rover("simm")


@pytest.mark.parametrize(
    ("control_hz", "rest", "said"),
    [
        (7, "[safety]\ntick_late_s = 1.0", "the stall guard stops the wheels below 7.5"),
        (7.9, motors('driver = "thunderborg"'), "the board's own deadman of 0.25 s stops the wheels below 8"),
        (19, motors(SABERTOOTH + "timeout_s = 0.1"), "the board's own deadman of 0.1 s stops the wheels below 20"),
    ],
)
def test_control_that_what_guards_the_wheels_would_stop_is_refused(
    tmp_path: Path, control_hz: float, rest: str, said: str
) -> None:
    assert complaint(tmp_path, rover_toml(f"control_hz = {control_hz}", rest)) == (
        f"key 'control_hz' = {control_hz:g}: too slow, {said}"
    )


@pytest.mark.parametrize(
    ("control_hz", "rest"),
    [
        (7.5, ""),
        (8, motors('driver = "thunderborg"')),
        (20, motors(SABERTOOTH + "timeout_s = 0.1")),
        (20, motors(SABERTOOTH + "baud = 2400")),
        (50, motors(SABERTOOTH)),
        (7.5, motors(H_BRIDGES)),
    ],
)
def test_control_that_is_just_fast_or_slow_enough_is_accepted(tmp_path: Path, control_hz: float, rest: str) -> None:
    assert load(tmp_path, rover_toml(f"control_hz = {control_hz}", rest)).control_hz == control_hz


def test_settings_that_a_part_s_table_leaves_out_are_the_driver_s_defaults() -> None:
    driver, settings = part_settings("compass", {"driver": "cmps14"})
    assert settings == driver.Settings()


@pytest.mark.parametrize("given", [{}, {"address": 0x29}])
def test_part_that_gets_another_driver_begins_with_that_driver_s_defaults(given: dict[str, int]) -> None:
    rover = load_rover("forestrover")
    of_another = {"driver": "bno055", **given}
    assert laid_over(rover, {"parts": {"compass": of_another}}).parts == {**rover.parts, "compass": of_another}
    same = laid_over(rover, {"parts": {"compass": {"driver": "cmps14", "address": 0x61}}})
    assert same.parts["compass"] == {**rover.parts["compass"], "address": 0x61}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (rover_toml(length_m="-1"), "; allowed is 0.1 to 5 metres"),
        (rover_toml(rest="[board]\nbattery_low_v = 99"), "; allowed is 3 to 60 volts"),
        (rover_toml(rest='[parts.compass]\ndriver = "cmps14"\naddress = 0x10'), "; allowed is 96 to 103"),
        (rover_toml(rest='[parts.motion]\ndriver = "pmw3901"\nheight_m = nan'), "; allowed is 0.08 to 5 metres"),
        (rover_toml(rest='[parts.compass]\ndrver = "cmps14"'), "thunderborg_light"),
        (rover_toml(track_m=""), "key 'vehicle.track_m' is missing"),
    ],
)
def test_bad_value_is_told_with_its_whole_range(tmp_path: Path, text: str, said: str) -> None:
    assert complaint(tmp_path, text).endswith(said)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (rover_toml(f'name2 = "{"x" * 5000}"'), "name2"),
        (rover_toml(f'buses = "{"x" * 5000}"'), "buses"),
        (rover_toml(rest=f'[parts.compass]\ndriver = "cmps14"\nbus = "/dev/{"x" * 4995}"'), "parts.compass.bus"),
        (rover_toml(rest=f'[parts.compass]\ndriver = "{"x" * 5000}"'), "parts.compass.driver"),
    ],
)
def test_value_of_5000_characters_is_refused_and_not_printed(tmp_path: Path, text: str, key: str) -> None:
    said = complaint(tmp_path, text)
    assert f"key '{key}'" in said
    assert len(said) < 200


def test_limit_of_a_device_s_name_is_said(tmp_path: Path) -> None:
    compass = '[parts.compass]\ndriver = "cmps14"\nbus = "/dev/{}"'
    assert load(tmp_path, rover_toml(rest=compass.format("x" * 250))).parts["compass"]["bus"] == "/dev/" + "x" * 250
    said = complaint(tmp_path, rover_toml(rest=compass.format("x" * 251)))
    assert ": 256 bytes; allowed are at most 255" in said
    assert ": 505 bytes; " in complaint(tmp_path, rover_toml(rest=compass.format("ü" * 250)))


def test_name_with_a_zero_byte_is_refused(tmp_path: Path) -> None:
    said = complaint(tmp_path, rover_toml(rest='[parts.compass]\ndriver = "cmps14"\nbus = "/dev/i2c\\u0000"'))
    assert said.endswith("key 'parts.compass.bus' = '/dev/i2c\\x00': a NUL byte, which no name can have")


@pytest.mark.parametrize("text", [f"{'k' * 6000} = 1\n", f'name = "test"\n[parts.{"p" * 6000}]\ndriver = "cmps14"\n'])
def test_key_of_6000_characters_is_not_printed(tmp_path: Path, text: str) -> None:
    assert len(complaint(tmp_path, text).removeprefix(str(tmp_path))) < 300


BOM = b"\xef\xbb\xbf"


def test_byte_order_mark_that_an_editor_wrote_is_no_error(tmp_path: Path) -> None:
    assert load(tmp_path, BOM + rover_toml().encode()).name == "test"
    assert complaint(tmp_path, BOM + b"nam = 1\n") == "unknown key 'nam'; did you mean 'name'?"


I2C_COMPASS = '[parts.compass]\ndriver = "cmps14"\nbus = "{}"\naddress = 0x60\n'
I2C_MOTORS = '[parts.motors]\ndriver = "thunderborg"\nbus = "/dev/i2c-1"\naddress = {}\n'
I2C_LIGHT = '[parts.light]\ndriver = "thunderborg_light"\naddress = {}\n'


@pytest.mark.parametrize(
    ("parts", "key"),
    [
        (I2C_COMPASS.format("/dev/i2c-1") + I2C_MOTORS.format("0x60"), "parts.motors"),
        (I2C_COMPASS.format("/dev/../dev//i2c-1") + I2C_MOTORS.format("0x60"), "parts.motors"),
        (I2C_COMPASS.format("/dev/i2c-1") + I2C_MOTORS.format("0x15") + I2C_LIGHT.format("0x60"), "parts.light"),
        (I2C_COMPASS.format("/dev/i2c-3") + I2C_MOTORS.format("0x60"), ""),  # one address on two buses
        (I2C_MOTORS.format("0x15") + I2C_LIGHT.format("0x15"), ""),  # motors and light of one board
    ],
)
def test_two_chips_at_one_address_of_a_bus_are_refused(tmp_path: Path, parts: str, key: str) -> None:
    if not key:
        assert load(tmp_path, rover_toml(rest=parts)).parts
        return
    assert complaint(tmp_path, rover_toml(rest=parts)).startswith(
        f"key '{key}.address' = 0x60: parts.compass has this address on "
    )


SERIAL_COMPASS = '[parts.compass]\ndriver = "bno055"\nport = "{}"\n'
SERIAL_MOTORS = '[parts.motors]\ndriver = "sabertooth"\nport = "/dev/serial0"\n'


def test_two_parts_at_one_serial_port_are_refused_and_the_address_of_a_part_on_a_port_does_not_count(
    tmp_path: Path,
) -> None:
    for port in ("/dev/serial0", "/dev/../dev/serial0"):
        assert complaint(tmp_path, rover_toml(rest=SERIAL_COMPASS.format(port) + SERIAL_MOTORS)) == (
            "key 'parts.motors.port' = '/dev/serial0': parts.compass is on this port already; correct one of them"
        )
    elsewhere = SERIAL_COMPASS.format("/dev/ttyAMA2")
    assert load(tmp_path, rover_toml(rest=elsewhere + SERIAL_MOTORS)).parts
    assert load(tmp_path, rover_toml(rest=elsewhere + I2C_MOTORS.format("0x28"))).parts


def test_drivers_of_one_board_whose_port_has_two_speeds_are_refused(tmp_path: Path) -> None:
    board = '[parts.motors]\ndriver = "roboclaw"\nbaud = 115200\n[parts.wheels]\ndriver = "roboclaw_wheels"\n'
    assert complaint(tmp_path, rover_toml(rest=board)) == (
        "key 'parts.wheels.baud' = 38400: parts.motors has 115200 on the same port"
    )
    assert load(tmp_path, rover_toml(rest=board + "baud = 115200\n")).parts


def test_stopping_the_motors_reads_past_a_byte_order_mark(tmp_path: Path) -> None:
    """With its first key unread, the file's ``buses`` would be taken for the Raspberry Pi's own."""
    path = tmp_path / "rover.toml"
    path.write_bytes(BOM + b'buses = "my.usb:adapter"\n[parts.motors]\ndriver = "sabertooth"\n')
    assert motors_of(path)[0] == DrivenBoard({"driver": "sabertooth"}, "my.usb:adapter")
