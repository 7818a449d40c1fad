"""The benchmark of the witnesses: what must come out of any drive of it."""

from __future__ import annotations

import pytest

from benchmarks import witnesses
from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.world.physics import GroundName


@pytest.fixture(scope="module")
def told() -> dict[str, witnesses.Told]:
    """What became of a minute and a half on dry soil."""
    with pytest.MonkeyPatch.context() as shorter:
        shorter.setattr(witnesses, "DRIVE_S", 90.0)
        return witnesses.measure(load_rover("forestrover"), (GroundName.dry_soil, 3))


def test_each_way_of_asking_meets_the_same_drive(told: dict[str, witnesses.Told]) -> None:
    assert set(told) == set(witnesses.ASKED)
    assert len({(each["hold"], each["slip"]) for each in told.values()}) == 1
    assert told["motion"]["hold"] >= 1
    assert told["motion"]["slip"] >= 1


def test_encoders_notice_every_hold_and_no_slip_and_claim_nothing_else(told: dict[str, witnesses.Told]) -> None:
    wheels = told["wheels"]
    assert (wheels["hold missed"], wheels["false"]) == (0, 0)
    assert wheels["slip missed"] == wheels["slip"]


def test_who_looks_at_the_ground_notices_slips_as_well(told: dict[str, witnesses.Told]) -> None:
    assert told["motion+wheels"]["slip missed"] == 0
