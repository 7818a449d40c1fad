"""Checks with motion: the deadman trips, each side turns the right way, being stuck or pushed is detected.

Nothing here turns a wheel before a person has agreed that the rover stands on blocks; without a person to ask all of it
is skipped. Each drive is a second long or less, but for the silence that the deadman must end: a board that cannot be
asked is given its deadman and 2.65 s more, and no silence is longer than 5 s. The wheels are stopped after each drive
in any case, before anybody is asked what was seen.

No duty exceeds the rover file's ``safety.duty_max``.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial

from wayfarer.commissioning.checks.api import Ask, Finding, Inspection, fail, ok, skipped
from wayfarer.commissioning.checks.deadman import DRIVE_S, SILENCE_MAX_S, deadman_silence_s, deadman_trips
from wayfarer.commissioning.checks.parts import part_failed
from wayfarer.commissioning.manual_drive import RATE_HZ, Push, keep_driving, measure_push, wheels_stopped_after
from wayfarer.control.rate import Rate
from wayfarer.detector import StallMonitor
from wayfarer.errors import DriverError
from wayfarer.hal import MotionReading, WheelCommand, WheelReading
from wayfarer.safety.tick_interval import Moved, TickInterval

ON_BLOCKS = (
    "The wheels are going to turn, slowly, several times, for up to {longest_s:.1f} s. "
    "Does the rover stand on blocks, all wheels free, with nobody's hands near them?"
)
PUSH = "Set the rover on the ground and push it half a metre straight ahead by hand; then answer. Is it done?"

DUTY = 0.25  # enough to turn free wheels, too little to jump off the blocks
STALL_DUTY = 0.5
STALL_S = 1.0
ROLLED_MIN_M = 0.01  # of a rim at DUTY for half a second; chosen by us
# Of the half metre asked for: scales are wrong by up to a half before calibration (docs/reference/hardware.md).
PUSHED_MIN_M = 0.15
UNKNOWN_MAX = 0.5  # share of readings without quality beyond which nothing was seen


async def check_motion(inspection: Inspection, ask: Ask | None) -> list[Finding]:
    """Return what each check with motion found; ``ask`` None: there is no person to agree."""
    if ask is None:
        return [skipped(name, "it needs a person; run it at a terminal") for name in (*WHEEL_CHECKS, "push")]
    return [*await _on_blocks(ask, inspection), await push(ask, inspection)]


async def _on_blocks(ask: Ask, inspection: Inspection) -> list[Finding]:
    """Return what the checks that turn the wheels found; once a part is gone, no wheel turns again."""
    why, findings = await _why_not(ask, inspection), []
    for name, wheel_check in WHEEL_CHECKS.items():
        if why:
            findings.append(skipped(name, why))
            continue
        try:
            findings.append(await wheel_check(ask, inspection))
        except DriverError as error:
            findings.append(part_failed(inspection, name, "motors", error))
            why = f"'{name}' broke off"
    return findings


async def _why_not(ask: Ask, inspection: Inspection) -> str:
    """Return why the wheels may not turn, nothing if they may."""
    try:
        await inspection.open("motors")
        silence_s = await deadman_silence_s(inspection.rover.motors)
    except DriverError:
        return "the motor board does not answer"
    longest_s = max(STALL_S, DRIVE_S + silence_s if silence_s <= SILENCE_MAX_S else 0.0)
    return "" if await ask(ON_BLOCKS.format(longest_s=longest_s)) else "it needs the rover on blocks"


async def side(which: str, ask: Ask, inspection: Inspection) -> Finding:
    """Turn one side ahead and back, and ask what was seen; a wrong answer gives the setting to change.

    So does what the wheels' own sensor has counted meanwhile, if the rover has one.

    Raises:
        DriverError: the board did not answer.
    """
    name, other = f"{which} wheels", "right" if which == "left" else "left"
    duty = min(DUTY, inspection.config.safety.duty_max)
    counted = await _turn(inspection, which, duty)
    if not await ask(f"Did the {which} wheels turn, only they, and forwards (their tops moved to the front)?"):
        return await _name_the_mistake(name, which, other, ask)
    await _turn(inspection, which, -duty)
    if not await ask(f"Did the {which} wheels turn again, only they, and backwards?"):
        text = "turn forwards, but not backwards; half of the board's output, or of its wiring, is dead"
        return fail(name, text, f"swap the plugs of the {which} and {other} motors to find out")
    if counted is not None and (wrong := _wrong_encoder(which, other, counted)):
        return fail(name, *wrong)
    return ok(name, "turn forwards and backwards")


async def _turn(inspection: Inspection, which: str, duty: float) -> WheelReading | None:
    """Turn one side, and return what the wheels' sensor says of that; None if there is none, or it does not answer."""
    command = WheelCommand(duty, 0.0) if which == "left" else WheelCommand(0.0, duty)
    motors, counted = inspection.rover.motors, None
    with suppress(DriverError):  # its own check says so
        if inspection.rover.wheels is not None:
            counted = await inspection.read("wheels")  # what came before is not ours
    async with wheels_stopped_after(motors):
        await keep_driving(motors, command, DRIVE_S)
    with suppress(DriverError):
        return await inspection.read("wheels") if counted is not None else None
    return None


def _wrong_encoder(which: str, other: str, counted: WheelReading) -> tuple[str, str] | None:
    """Return what is wrong with the encoders if only this side turned, and ahead, and what to do."""
    if counted.left_m is None or counted.right_m is None:
        return None  # it measures the current only
    own_m, other_m = (counted.left_m, counted.right_m)[:: 1 if which == "left" else -1]
    if max(abs(own_m), abs(other_m)) < ROLLED_MIN_M:
        text = "they turned, and their encoder counted nothing; a loose wire, no power, or a wrong counts_per_m"
        return text, "check the encoder's wires; correct [parts.wheels]"
    if abs(other_m) > abs(own_m):
        text = f"they turned, and the {other} encoder counted; left and right are swapped"
        return text, "change left under [parts.wheels], or swap the pins there"
    if own_m < 0.0:
        text = "they turned forwards, and their encoder counted down"
        return text, f"change reverse_{which} under [parts.wheels]: true if it is false or not there, else false"
    return None


async def _name_the_mistake(name: str, which: str, other: str, ask: Ask) -> Finding:
    if await ask(f"Did the {which} wheels turn, but backwards?"):
        remedy = f"change reverse_{which} under [parts.motors]: true if it is false or not there, else false"
        return fail(name, "turn backwards instead of forwards; the motor is wired the other way round", remedy)
    if await ask(f"Did the {other} wheels turn instead?"):
        remedy = "change left under [parts.motors] to the board's other channel (A or B, 1 or 2), or swap the pins"
        return fail(name, f"the {other} wheels turned instead; left and right are swapped", remedy)
    text = "did not turn as commanded; likely no motor power, a loose motor wire, or a blocked gear"
    return fail(name, text, "check battery, fuse, motor switch and the motor's two wires")


async def notices_being_stuck(_ask: Ask, inspection: Inspection) -> Finding:
    """Turn the wheels of the lifted rover and see whether the detector's own rule calls it immobilised.

    Raises:
        DriverError: the board or the motion sensor did not answer.
    """
    name, config = "notices being stuck", inspection.config
    if inspection.rover.motion is None:
        return skipped(name, "this rover has no motion sensor")
    await inspection.open("motion")
    found, unknown = await _watch_stall(inspection)
    if unknown > UNKNOWN_MAX:
        return skipped(name, "the motion sensor saw nothing: too dark, or the lens too far from the ground")
    if not found:
        speed_m_s = min(STALL_DUTY, config.safety.duty_max) * config.vehicle.max_speed_m_s
        text = "the wheels turned on blocks, and the rover was not noticed as stuck; a wheel moved in the sensor's "
        text += f"view, or [detector] immobilised_* fit no drive at {speed_m_s:g} m/s"
        return fail(name, text, "clear its view; try again")
    return ok(name, "wheels that turn without motion are noticed")


async def _watch_stall(inspection: Inspection) -> tuple[bool, float]:
    """Return whether a stall was found, and the share of readings that said nothing."""
    config, motors = inspection.config, inspection.rover.motors
    stall, unknown, found = StallMonitor(config.detector, config.vehicle), 0, False
    duty = min(STALL_DUTY, config.safety.duty_max)
    commanded, dt_s = WheelCommand(duty, duty), 1.0 / RATE_HZ
    interval = TickInterval(0.0, commanded, dt_s, dt_s, duty * config.vehicle.max_speed_m_s * dt_s)
    ticks, rate = round(STALL_S * RATE_HZ), Rate(RATE_HZ)
    async with wheels_stopped_after(motors):
        await inspection.read("motion")  # what came before is not ours
        for _ in range(ticks):
            await motors.drive(commanded)
            await rate.wait()
            reading: MotionReading = await inspection.read("motion")
            unknown += reading.quality < config.detector.quality_min
            moved = Moved()
            moved.drive(interval, 0.0, config.vehicle.max_speed_m_s)
            moved.driven_s = interval.driven_s
            moved.see(reading.forward_m, 0.0, signed=reading.signed)
            stall.add(moved)
            found = found or stall.found
    return found, unknown / ticks


WHEEL_CHECKS: dict[str, Callable[[Ask, Inspection], Awaitable[Finding]]] = {
    "deadman trips": deadman_trips,
    "left wheels": partial(side, "left"),
    "right wheels": partial(side, "right"),
    "notices being stuck": notices_being_stuck,
}


async def push(ask: Ask, inspection: Inspection) -> Finding:
    """Let a person push the rover ahead, and see whether the motion sensor says so; no wheel is driven."""
    if inspection.rover.motion is None:
        return skipped("push", "this rover has no motion sensor")
    done = False

    async def pushed() -> None:
        nonlocal done
        done = await ask(PUSH)

    try:
        await inspection.open("motion")
        read = partial(inspection.read, "motion")
        seen = await measure_push(read, pushed(), inspection.config.detector.quality_min)
    except DriverError as error:
        return part_failed(inspection, "push", "motion", error)
    return judge_push(seen) if done else skipped("push", "it was not pushed")


def judge_push(seen: Push) -> Finding:
    """Return what a push ahead says of the sensor's mounting; a wrong one gives the setting to change."""
    text = f"{seen.forward_m:+.2f} m ahead, {seen.right_m:+.2f} m to the right"
    if seen.unknown > UNKNOWN_MAX:
        text = "the motion sensor saw nothing: too dark, too plain a ground, or a leaf on the lens"
        return fail("push", text, "clean the lens; push on grass in daylight")
    if max(abs(seen.forward_m), abs(seen.right_m)) < PUSHED_MIN_M:
        remedy = "push it half a metre; if you did, correct the lens height or the scale under [parts.motion]"
        return fail("push", f"{text}; it was hardly pushed, or the sensor's scale is wrong", remedy)
    if abs(seen.right_m) >= abs(seen.forward_m):
        remedy = "change forward and right under [parts.motion]: give each the other's axis"
        return fail("push", f"{text}; the sensor is mounted a quarter turn round", remedy)
    if seen.forward_m < 0.0:
        remedy = "change the sign of forward under [parts.motion], and of right if it is mounted half a turn round"
        return fail("push", f"{text}; the sensor is mounted the other way round", remedy)
    return ok("push", text)
