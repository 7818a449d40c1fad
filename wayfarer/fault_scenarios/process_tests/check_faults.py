"""What is wrong with a rover before it drives: a check, a calibration or an arming must say so."""

from __future__ import annotations

from math import inf
from typing import Any

from wayfarer.commissioning.calibrate import calibrate
from wayfarer.commissioning.checks import CheckVerdict, Finding
from wayfarer.commissioning.checks.deadman import board_settings
from wayfarer.config.calibration_file import FILE_NAME, Calibration, DeadmanEntry, save, stamp
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.daemon.socket.protocol import Refused
from wayfarer.fault_scenarios.process_tests.hil_setup import UNPROVED, HilSetup, site, wait_for
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.process_tests.rover_on_blocks import ROVER, Workbench, at_workbench
from wayfarer.fault_scenarios.process_tests.wheel_history import told_to_turn
from wayfarer.fault_scenarios.result import Tried
from wayfarer.fault_scenarios.scenario import Reached
from wayfarer.fieldlog.clock import wall_clock
from wayfarer.simhal.faults.kinds import Drive, Fault, MotorField

BIAS_DEG = 15.0
PERSON = "a person answers who sees the simulated wheels, not the fault; a real rover needs a real one"


@procedure(
    "motor-field", 12, f"the motors' current turns the heading by {BIAS_DEG:g} degrees at full duty",
    asked="pre-arm test refuses > 10 deg; at check", expected=Reached.FAULT, tried=Tried.COMMAND,
    remark="wayfarer calibrate motors measures it, and the check before each arming refuses",
)  # fmt: skip
def motor_field(found: Observed) -> None:
    """Calibrate a rover whose motors bend the field, and check it afterwards."""

    async def calibrated(bench: Workbench) -> Finding:
        await calibrate(bench.config, bench.rover, bench.host, bench.person, ("motors",))
        return (await bench.check())["calibrated motors"]

    bent = Fault(0.0, inf, "world", "motor_field", MotorField(BIAS_DEG))
    _compare(found, at_workbench(calibrated), at_workbench(calibrated, [bent]), "the motors turn the heading by")


@procedure(
    "flow-swapped", 19, "the flow sensor is mounted a quarter turn round, or the wrong way",
    asked="`check` push test fails; at check", expected=Reached.FAULT, tried=Tried.COMMAND, remark=PERSON,
)  # fmt: skip
def flow_swapped(found: Observed) -> None:
    """Push a rover whose sensor is not mounted as its file says."""
    well = at_workbench(_finds("push"))
    turned = at_workbench(_finds("push"), mounted=_mounted(forward="+x", right="+y"))
    _compare(found, well, turned, "forward and right under [parts.motion]")
    back = at_workbench(_finds("push"), mounted=_mounted(forward="+y", right="-x"))
    _compare(found, well, back, "the sign of forward under [parts.motion]")


@procedure(
    "failsafe-off", 24, "the ThunderBorg does not acknowledge its failsafe when the rover is armed",
    asked="refuse to arm; at arm", expected=Reached.FAULT,
)  # fmt: skip
def failsafe_off(found: Observed) -> None:
    """Have the board say that its failsafe is off, and ask to arm."""
    with site("minirover") as where:
        where.daemon()
        begins_s = where.bench("inject", target="motors", kind="failsafe_off")["t_s"]
        try:
            where.ask("arm", heading_deg=0.0)
            found.problems.append("it was armed")
        except Refused as refused:
            found.changed, found.cause, found.reached = "what the board answers", str(refused), Reached.FAULT
            found.demand("failsafe" in found.cause, "the refusal does not name the failsafe")
        found.demand(where.status()["mode"] == "disarmed", "it is not disarmed")
        found.demand(not told_to_turn(where.commands(begins_s)), "wheels turned")


@procedure(
    "deadman-unproved", 25, "nobody has seen the Sabertooth stop the wheels by itself, or not with today's timeout",
    asked="send cmd 14 at open and every 1 s; never rely on it alone", expected=Reached.FAULT,
    remark="wayfarer check has a person see it, and the check before each arming asks for that",
)  # fmt: skip
def deadman_unproved(found: Observed) -> None:
    """Ask to arm without a proof, with one, and with one of another timeout."""
    with site("forestrover") as where:
        where.config.write_text(where.config.read_text("utf-8").replace(UNPROVED, ""), encoding="utf-8")
        where.daemon()
        _is_refused(where, found, "nobody has seen")
        file, proof = where.folder / FILE_NAME, board_settings(load_rover(str(where.config)))
        seen = stamp("Sabertooth", wall_clock(0.0))
        save(file, Calibration(deadman=DeadmanEntry(**seen, settings={**proof, "timeout_s": 0.5})))
        _is_refused(where, found, "timeout_s = 0.5 (now 0.3)")
        found.demand(not told_to_turn(where.commands()), "wheels turned")
        save(file, Calibration(deadman=DeadmanEntry(**seen, settings=proof)))
        where.ask("arm", heading_deg=0.0)
        wait_for("the wheels turn", lambda: where.drives)


def _is_refused(where: HilSetup, found: Observed, why: str) -> None:
    """See that arming is refused for this reason, and what to do is told."""
    try:
        where.ask("arm", heading_deg=0.0)
        found.problems.append("it was armed")
    except Refused as refused:
        found.changed, found.cause, found.reached = "what was proved of the board", "deadman proved", Reached.FAULT
        found.demand(why in str(refused) and "wayfarer check" in str(refused), f"the refusal says: {refused}")


@procedure(
    "side-reversed", 28, "the left motors are wired the other way round",
    asked="`check` wiggle fails; run-time: turn sign wrong 2x => S3", expected=Reached.FAULT, tried=Tried.COMMAND,
    remark=PERSON,
)  # fmt: skip
def side_reversed(found: Observed) -> None:
    """Check a rover one of whose sides turns back when told to go ahead."""
    reversed_ = Fault(0.0, inf, "world", "drive", Drive(left_gain=-1.0))
    well, wrong = at_workbench(_finds("left wheels")), at_workbench(_finds("left wheels"), [reversed_])
    _compare(found, well, wrong, "reverse_left under [parts.motors]")
    right = at_workbench(_finds("right wheels"), [reversed_])
    found.demand(right.verdict is CheckVerdict.OK, f"the right wheels, which are well: {right.found}")


def _finds(name: str) -> Any:
    async def look(bench: Workbench) -> Finding:
        return (await bench.check())[name]

    return look


def _mounted(**axes: str) -> RoverConfig:
    """Return the rover with its flow sensor mounted another way."""
    config = load_rover(ROVER)
    return config.model_copy(update={"parts": {**config.parts, "motion": {**config.parts["motion"], **axes}}})


def _compare(found: Observed, well: Finding, wrong: Finding, wanted: str) -> None:
    """See that a rover that is well passes, and the other fails with this in what it is told."""
    told = f"{wrong.found} ({wrong.remedy})"
    found.demand(well.verdict is CheckVerdict.OK, f"{well.name} of a rover that is well: {well.found}")
    found.demand(wrong.verdict is CheckVerdict.FAIL, f"{wrong.name}: {wrong.verdict}: {told}")
    found.demand(wanted in told, f"the finding says: {told}")
    if wrong.verdict is CheckVerdict.FAIL:
        found.changed, found.cause, found.reached = f"{well.found}, but {wrong.found}", wrong.name, Reached.FAULT
