"""From a rover file to its drivers: nothing is touched, and what is missing or wrong is told by its key."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from unittest.mock import AsyncMock

import pytest

from tests.config.rover_texts import complaint, load, rover_toml
from wayfarer.config.calibration_file import Calibration, FlowEntry
from wayfarer.config.factory import ScaledMotionSensor, assemble
from wayfarer.config.registry import find_driver
from wayfarer.config.rover_file import RoverConfig, load_rover, rover_names
from wayfarer.drivers.buses import Buses
from wayfarer.drivers.cmps14 import CMPS14
from wayfarer.drivers.pmw3901 import PMW3901
from wayfarer.errors import BadConfig
from wayfarer.hal import MotionReading, MotionSensor, error_counts_of
from wayfarer.simhal.buses import FakeBuses

COMPASS = '[parts.compass]\ndriver = "cmps14"\n'
MOTORS = '[parts.motors]\ndriver = "sabertooth"\n'
FLOW = FlowEntry(t_wall=0.0, date="1970-01-01", part="bench flow", scale=1.25)


class OwnCompass(CMPS14):
    """A third party's driver, named by module and attribute."""


def loaded(folder: Path, *tables: str) -> RoverConfig:
    return load(folder, rover_toml(rest="".join(tables)))


@pytest.mark.parametrize("name", rover_names())
def test_shipped_rovers_have_the_parts_of_their_files(name: str) -> None:
    """The buses have no chips: nothing may be touched yet."""
    config = load_rover(name)
    rover = assemble(config, FakeBuses())
    assert {part: type(driver) for part, driver in rover.parts.items()} == {
        part: find_driver(table["driver"]) for part, table in config.parts.items()
    }
    assert next(iter(rover.parts)) == "motors", "what is opened first is closed last, and stopped first"


def test_settings_of_the_file_reach_the_drivers(tmp_path: Path) -> None:
    tables = (COMPASS + 'bus = "/dev/i2c-7"\naddress = 0x61\n', MOTORS + "address = 130\ntimeout_s = 0.5\n")
    rover = assemble(loaded(tmp_path, *tables), FakeBuses())
    assert rover.compass.name == "CMPS14 at 0x61 on /dev/i2c-7"
    assert rover.motors.name == "Sabertooth 130 on /dev/serial0"
    assert rover.motors.deadman_s == 0.5


@pytest.mark.parametrize(("given", "missing"), [(COMPASS, "motors"), (MOTORS, "compass"), ("", "compass")])
def test_rover_without_a_part_that_every_rover_needs_can_only_be_simulated(
    tmp_path: Path, given: str, missing: str
) -> None:
    with pytest.raises(BadConfig, match=rf"key 'parts\.{missing}' is missing: rover 'test' has .* only be simulated"):
        assemble(loaded(tmp_path, given), FakeBuses())


def test_driver_of_a_third_party_is_named_by_module_and_attribute(tmp_path: Path) -> None:
    own = '[parts.compass]\ndriver = "tests.config.test_factory:OwnCompass"\naddress = 0x62\n'
    rover = assemble(loaded(tmp_path, own, MOTORS), FakeBuses())
    assert type(rover.compass).__name__ == "OwnCompass"
    assert "0x62" in rover.compass.name


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ('[parts.compass]\ndriver = "cmps41"\n', "key 'parts.compass.driver': unknown driver 'cmps41': did you mean"),
        (
            '[parts.compass]\ndriver = "pmw3901"\n',
            "key 'parts.compass.driver': 'pmw3901' is not a driver for compass, but for motion",
        ),
        ('[parts.compass]\ndriver = "no_such:x"\n', "key 'parts.compass.driver': driver 'no_such:x': cannot import"),
        ('[parts.compass]\nbus = "/dev/i2c-1"\n', "key 'parts.compass.driver' is missing"),
        ("[parts.compass]\ndriver = 3\n", "key 'parts.compass.driver' = 3: input should be a text; allowed are"),
        (COMPASS + "adress = 0x61\n", "unknown key 'parts.compass.adress'; did you mean 'address'?"),
        (COMPASS + 'address = "0x60"\n', "key 'parts.compass.address' = '0x60': input should be"),
        (COMPASS + "heading_offset_deg = 181\n", "key 'parts.compass.heading_offset_deg' = 181: input should be less"),
        (MOTORS + "timeout_s = 13\n", "key 'parts.motors.timeout_s' = 13: input should be less than or equal to 12.7"),
        ('[parts.motion]\ndriver = "pmw3901"\nforward = "+x"\nright = "-x"\n', "key 'parts.motion': forward '+x'"),
        ("[parts]\ncompass = 3\n", "key 'parts.compass' = 3: input should be a table"),
    ],
)  # fmt: skip
def test_part_that_cannot_be_used_is_told_by_its_key(tmp_path: Path, tables: str, said: str) -> None:
    assert complaint(tmp_path, rover_toml(rest=tables)).startswith(said)


# -- calibration -------------------------------------------------------------------------------------------------


async def test_calibrated_metres_are_scaled_and_nothing_else_is() -> None:
    class Flow:
        name, error_counts = "bench flow", MappingProxyType({"impossible readings rejected": 2})
        open, close = AsyncMock(), AsyncMock()
        read = AsyncMock(return_value=MotionReading(3.0, 0.4, -0.2, 0.7, signed=False))

    scaled = ScaledMotionSensor(Flow(), 1.25)
    assert isinstance(scaled, MotionSensor)
    assert scaled.name == "bench flow", "the calibration is kept under this name"
    await scaled.open()
    assert await scaled.read() == MotionReading(3.0, 0.4 * 1.25, -0.2 * 1.25, 0.7, signed=False)
    await scaled.close()
    assert [method.await_count for method in (Flow.open, Flow.read, Flow.close)] == [1, 1, 1]
    assert error_counts_of(scaled) == {"impossible readings rejected": 2}


def test_only_a_rover_whose_flow_was_calibrated_is_scaled(tmp_path: Path) -> None:
    buses: Buses = FakeBuses()
    config = load_rover("forestrover")
    plain, scaled = assemble(config, buses), assemble(config, buses, Calibration(flow=FLOW))
    assert isinstance(plain.motion, PMW3901)
    assert isinstance(scaled.motion, PMW3901), "it judges what it can have seen by the calibrated angle"
    assert scaled.motion._settings.rad_per_count == plain.motion._settings.rad_per_count * FLOW.scale
    assert scaled.motion.name == plain.motion.name
    camera = assemble(load_rover("minirover"), buses, Calibration(flow=FLOW))
    assert isinstance(camera.motion, ScaledMotionSensor)
    blind = assemble(loaded(tmp_path, COMPASS, MOTORS), buses, Calibration(flow=FLOW))
    assert blind.motion is None
