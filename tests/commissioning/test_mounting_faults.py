"""Parts that are mounted or wired the wrong way, on blocks with a person who sees the simulated wheels.

The person does not know the fault; a real rover needs a real person.
"""

from __future__ import annotations

from math import inf

from tests.commissioning.rover_on_blocks import ROVER, Workbench, at_workbench
from wayfarer.commissioning.calibrate import calibrate
from wayfarer.commissioning.checks import CheckVerdict, Finding
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.simhal.faults.kinds import Drive, Fault, MotorField

BENT = Fault(0.0, inf, "world", "motor_field", MotorField(15.0))
REVERSED = Fault(0.0, inf, "world", "drive", Drive(left_gain=-1.0))


def test_rover_that_is_well_fails_no_check() -> None:
    async def look(bench: Workbench) -> dict[str, CheckVerdict]:
        return {found.name: found.verdict for found in (await bench.check()).values()}

    found = at_workbench(look)
    wheels = ("deadman trips", "left wheels", "right wheels", "notices being stuck", "push")
    assert {found[name] for name in wheels} == {CheckVerdict.OK}
    assert CheckVerdict.FAIL not in found.values()


def test_motors_that_turn_the_heading_are_measured_and_refused() -> None:
    async def calibrated(bench: Workbench) -> Finding:
        await calibrate(bench.config, bench.rover, bench.host, bench.person, ("motors",))
        return (await bench.check())["calibrated motors"]

    assert at_workbench(calibrated).verdict is CheckVerdict.OK
    fails(at_workbench(calibrated, [BENT]), "the motors turn the heading by")


def test_flow_sensor_that_is_mounted_wrong_fails_the_push() -> None:
    turned = checked("push", mounted=mounted(forward="+x", right="+y"))
    fails(turned, "forward and right under [parts.motion]")
    back = checked("push", mounted=mounted(forward="+y", right="-x"))
    fails(back, "the sign of forward under [parts.motion]")


def test_side_that_is_wired_the_other_way_round_fails_alone() -> None:
    fails(checked("left wheels", REVERSED), "reverse_left under [parts.motors]")
    assert checked("right wheels", REVERSED).verdict is CheckVerdict.OK


def checked(name: str, *faults: Fault, mounted: RoverConfig | None = None) -> Finding:
    """What `wayfarer check` finds under this name."""

    async def look(bench: Workbench) -> Finding:
        return (await bench.check())[name]

    return at_workbench(look, faults, mounted)


def mounted(**axes: str) -> RoverConfig:
    """The rover with its flow sensor mounted another way."""
    config = load_rover(ROVER)
    return config.model_copy(update={"parts": {**config.parts, "motion": {**config.parts["motion"], **axes}}})


def fails(found: Finding, wanted: str) -> None:
    assert found.verdict is CheckVerdict.FAIL
    assert wanted in f"{found.found} ({found.remedy})"
