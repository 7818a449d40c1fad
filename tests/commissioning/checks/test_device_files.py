"""A run without its ports is refused before anything is opened, by the key that names them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from wayfarer import cli
from wayfarer.commissioning.checks import HostEnvironment
from wayfarer.commissioning.checks.system import device_files, refuse_missing_ports
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import NotThereYet

PORTS = ("/dev/i2c-1", "/dev/spidev0.1", "/dev/ttyAMA0")


def host(root: Path) -> HostEnvironment:
    return HostEnvironment(root, root / "calibration.json", (), 0.0, root)


def make(root: Path, *devices: str) -> None:
    (root / "dev").mkdir(exist_ok=True)
    for device in devices:
        (root / device.lstrip("/")).touch()


@pytest.mark.parametrize(("settings", "device"), [({"port": "/dev/ttyAMA3"}, "/dev/ttyAMA3"), ({}, "/dev/i2c-1")])
def test_part_that_can_be_on_either_line_needs_only_the_one_that_it_is_on(
    settings: dict[str, str], device: str
) -> None:
    table = {"driver": "bno055", **settings}
    assert device_files(load_rover("sim").model_copy(update={"parts": {"compass": table}})) == (device,)


def test_buses_of_a_third_party_have_no_device_files(tmp_path: Path) -> None:
    other_buses = load_rover("forestrover").model_copy(update={"buses": "my.adapter:buses"})
    refuse_missing_ports(other_buses, "forestrover", host(tmp_path))


def test_device_file_of_two_parts_is_given_once_and_none_of_other_buses() -> None:
    config = load_rover("minirover")
    assert {config.parts[part]["driver"] for part in ("compass", "motors")} == {"cmps14", "thunderborg"}
    assert device_files(config).count("/dev/i2c-1") == 1
    assert device_files(config.model_copy(update={"buses": "some:buses"})) == ()


@pytest.mark.parametrize(
    ("missing", "key", "remedy"),
    [
        ("/dev/i2c-1", "parts.compass.bus", "do_i2c 0"),
        ("/dev/spidev0.1", "parts.motion.bus", "do_spi 0"),
        ("/dev/ttyAMA0", "parts.motors.port", "do_serial_hw 0"),
    ],
)
def test_port_that_is_not_there_is_named_with_file_key_and_remedy(
    tmp_path: Path, missing: str, key: str, remedy: str
) -> None:
    make(tmp_path, *(port for port in PORTS if port != missing))
    with pytest.raises(NotThereYet) as caught:
        refuse_missing_ports(load_rover("forestrover"), "forestrover", host(tmp_path))
    said = str(caught.value)
    assert re.match(rf"forestrover: key '{key}': {missing} is not there", said)
    assert remedy in said
    assert "\n" not in said


def test_run_ends_with_one_line_and_exit_code_1_and_begins_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    shipped = Path(cli.__file__).parents[1] / "rovers/minirover.toml"
    monkeypatch.setattr("wayfarer.commissioning.checks.system.refuse_missing_ports", _refuse)
    assert cli.run(["run", "--rover", str(shipped), "--log-dir", str(tmp_path / "logs")]) == 1
    assert capsys.readouterr().err == "wayfarer: no such port\n"
    assert not (tmp_path / "logs").exists()


def _refuse(*_: object) -> None:
    raise NotThereYet("no such port")
