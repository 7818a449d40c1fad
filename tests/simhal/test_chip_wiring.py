"""A third party's driver runs at bus depth over a chip that no file of wayfarer names."""

from __future__ import annotations

import csv
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.simhal import third_party_compass
from wayfarer.config import registry
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput
from wayfarer.simhal.built_in_chips import CMPS14
from wayfarer.simhal.chip_wiring import BUILT_IN_CHIPS, CHIP_GROUP, chip_of
from wayfarer.simhal.faults.kinds import Fault, misplaced

MODULE = "tests.simhal.third_party_compass"
BY_PATH = f"{MODULE}:LooseXC9"


@pytest.fixture
def rover(tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A rover file with the third party's compass: by its path, or by the name that its package is installed with."""
    points = [
        EntryPoint("xc9", f"{MODULE}:XC9", registry.DRIVER_GROUP),
        EntryPoint("xc9", f"{MODULE}:XC9_CHIP", CHIP_GROUP),
    ]
    monkeypatch.setattr(registry, "entry_points", lambda *, group: [each for each in points if each.group == group])
    shipped = (Path(registry.__file__).parents[1] / "rovers/sim.toml").read_text(encoding="utf-8")
    file = tmp_path / "mine.toml"
    assert 'driver = "cmps14"' in shipped
    file.write_text(shipped.replace('driver = "cmps14"', f'driver = "{request.param}"'), encoding="utf-8")
    return file


@pytest.mark.parametrize("rover", ["xc9", BY_PATH], indirect=True)
def test_rover_with_a_third_party_s_compass_escapes_through_its_chip(run: Run, rover: Path, tmp_path: Path) -> None:
    rows = {}
    for depth in ("device", "bus"):
        out = tmp_path / depth
        code, _, err = run("sim", "--rover", rover, "--depth", depth, "--trials", 1, "--jobs", 1, "--out", out)
        assert code == 0, err
        rows[depth] = (out / "trials.csv").read_text(encoding="utf-8")
    assert rows["bus"] == rows["device"], "opening takes its time at both depths"
    (row,) = csv.DictReader(rows["bus"].splitlines())
    assert row["outcome"] == "escaped"


@pytest.mark.parametrize("rover", [BY_PATH], indirect=True)
def test_third_party_s_part_can_have_the_faults_of_its_bus(rover: Path) -> None:
    config = load_rover(str(rover))
    assert misplaced(Fault(0.0, 1.0, "compass", "nack"), config) is None
    assert misplaced(Fault(0.0, 1.0, "compass", "lost_bytes"), config) is not None
    assert misplaced(Fault(0.0, 1.0, "compass", "uncalibrated"), config) is not None


def test_every_built_in_chip_is_that_of_a_built_in_driver() -> None:
    assert set(BUILT_IN_CHIPS) < set(registry.BUILT_IN_DRIVERS)


def test_built_in_driver_given_by_its_path_has_its_chip() -> None:
    assert chip_of("compass", {"driver": registry.BUILT_IN_DRIVERS["cmps14"]})[0] is CMPS14


@pytest.mark.parametrize(
    ("named", "says"),
    [("no_such_package:CHIP", "cannot import no_such_package"), (f"{MODULE}:attach", "is not a wayfarer.testing")],
)
def test_what_is_no_simulated_chip_is_told(monkeypatch: pytest.MonkeyPatch, named: str, says: str) -> None:
    monkeypatch.setattr(third_party_compass.LooseXC9, "simulated_chip", named)
    with pytest.raises(BadInput, match=says):
        chip_of("compass", {"driver": BY_PATH})
