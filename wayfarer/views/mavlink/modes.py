"""Modes and states of the rover in MAVLink's numbers, and what a station's command asks for. Pure.

The numbers of the modes are those of ArduPilot's rovers, because MAVProxy and Mission Planner know the names of these
for each vehicle of the type ground rover. The autopilot is told as ``GENERIC``: no station may take this for ArduPilot
or PX4, whose parameters and missions it would then ask for.
"""

from __future__ import annotations

from enum import Enum
from math import isfinite
from typing import Final

from pymavlink.dialects.v20 import common

from wayfarer.fieldlog.run_state import RunState

MODE_MANUAL: Final = 0
MODE_HOLD: Final = 4
MODE_AUTO: Final = 10
MODE_INITIALISING: Final = 16


class Order(Enum):
    """What a station can ask for."""

    ARM = "arm"
    DISARM = "disarm"
    HOLD = "hold"
    RESUME = "resume"
    MANUAL = "manual"


STARTING = (Order.ARM, Order.RESUME, Order.MANUAL)  # what can make wheels turn
_BY_MODE = {MODE_MANUAL: Order.MANUAL, MODE_HOLD: Order.HOLD, MODE_AUTO: Order.RESUME}


def custom_mode(run: RunState) -> int:
    """Return the number of the mode that a run is in: a rover that is disarmed is in HOLD."""
    if run.mode == "manual":
        return MODE_MANUAL
    if run.mode == "arming":
        return MODE_INITIALISING
    return MODE_AUTO if run.mode == "armed" and not run.operator_hold else MODE_HOLD


def heartbeat(run: RunState) -> common.MAVLink_message:
    """Return the message that says: a rover, in this mode and state."""
    mode, base = custom_mode(run), common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if run.mode in ("armed", "manual"):
        base |= common.MAV_MODE_FLAG_SAFETY_ARMED
    base |= common.MAV_MODE_FLAG_AUTO_ENABLED if mode == MODE_AUTO else 0
    base |= common.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED if mode == MODE_MANUAL else 0
    return common.MAVLink_heartbeat_message(
        common.MAV_TYPE_GROUND_ROVER, common.MAV_AUTOPILOT_GENERIC, base, mode, _state(run), 3
    )


def _state(run: RunState) -> int:
    """Return how the rover does. A fault disarms it, so its level counts in any mode."""
    if run.tick.level == "fault":
        return int(common.MAV_STATE_EMERGENCY)
    if run.mode not in ("armed", "manual"):
        return int(common.MAV_STATE_STANDBY)
    troubled = run.tick.level in ("degrade", "hold") and not run.operator_hold
    return int(common.MAV_STATE_CRITICAL if troubled else common.MAV_STATE_ACTIVE)


def asked_for(command: int, first: float, second: float) -> Order | None:
    """Return what a command (MAV_CMD) with these two parameters asks for; None where it is none of ours.

    Parameters that are no such value, NaN among them, ask for nothing.
    """
    if not (isfinite(first) and isfinite(second)):
        return None
    match command:
        case common.MAV_CMD_COMPONENT_ARM_DISARM:
            return {1.0: Order.ARM, 0.0: Order.DISARM}.get(first)
        case common.MAV_CMD_DO_SET_MODE:
            return _BY_MODE.get(int(second)) if int(first) & common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED else None
        case common.MAV_CMD_DO_PAUSE_CONTINUE:
            return {0.0: Order.HOLD, 1.0: Order.RESUME}.get(first)
        case _:
            return None
