"""What the rover tells a ground station: log records in, MAVLink messages out. Pure.

A message is made when it is due, from the state of the run so far; a record costs no more than the fold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite, radians
from typing import Final, TypeVar

from pymavlink.dialects.v20 import common

from wayfarer.angles import wrap180, wrap360
from wayfarer.escape.api import Phase
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Board, Fix, RunEvent
from wayfarer.safety.conditions import Level
from wayfarer.views.mavlink import modes

Messages = Iterator[common.MAVLink_message]
Said = TypeVar("Said", Fix, Board)

# "Not known", as the definitions of the fields say.
NO_U16: Final = 0xFFFF
NO_I16: Final = -1
FRESH_S = 5.0  # a receiver speaks once a second, a motor board four times: from no source
PHASES: Final = tuple(phase.value for phase in Phase)  # ``phase`` tells the place in this list, from 0
LEVELS: Final = {level.name.lower(): int(level) for level in Level}

COMPASS = common.MAV_SYS_STATUS_SENSOR_3D_MAG
MOTION = common.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW
RECEIVER = common.MAV_SYS_STATUS_SENSOR_GPS
MOTORS = common.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
BATTERY = common.MAV_SYS_STATUS_SENSOR_BATTERY
ARMING_CHECKS = common.MAV_SYS_STATUS_PREARM_CHECK
NO_FENCE_BREACH = common.MAV_SYS_STATUS_GEOFENCE  # healthy, though there is none: MAVProxy warns of a breach otherwise
BITS = {"compass": COMPASS, "motion": MOTION, "position": RECEIVER}


class Telemetry:
    """Takes the records of one run in their order; ``state`` is the run so far.

    Times of messages are milliseconds of the loop's clock, as ``t_s``; MAVLink calls them those since boot.

    Args:
        declination_deg: from true to magnetic north, east positive; None: headings stay those from magnetic north.
    """

    def __init__(self, declination_deg: float | None) -> None:
        self._fold = RunFold()
        self._declination_deg = declination_deg or 0.0
        self.state = self._fold.state

    def take(self, record: Record) -> Sequence[RunEvent]:
        """Take a record; return what it tells."""
        return self._fold.take(record)

    @property
    def wheels_turn(self) -> bool:
        """Whether this run can turn real wheels; a simulated one and a dry run cannot."""
        header = self.state.header
        return not (header.simulated is True or header.dry_run is True)

    def heartbeat(self) -> Messages:
        """Tell mode and state."""
        yield modes.heartbeat(self.state)

    def attitude(self) -> Messages:
        """Tell roll, pitch and heading; nothing before the first reading of the compass."""
        tick = self.state.tick
        if tick.heading_deg is None:
            return
        yield common.MAVLink_attitude_message(
            self._ms(), radians(tick.roll_deg or 0.0), radians(tick.pitch_deg or 0.0),
            radians(wrap180(self._heading_deg(tick.heading_deg))), 0.0, 0.0, 0.0,
        )  # fmt: skip

    def position(self) -> Messages:
        """Tell where the rover is: by the receiver, if it speaks, and by dead reckoning from where the log begins."""
        state = self.state
        if (fix := self._fresh(state.fix)) is not None:
            heading = (
                NO_U16 if state.tick.heading_deg is None else _hundredths(self._heading_deg(state.tick.heading_deg))
            )
            lat, lon = round(fix.latitude_deg * 1e7), round(fix.longitude_deg * 1e7)
            yield common.MAVLink_global_position_int_message(self._ms(), lat, lon, 0, 0, 0, 0, 0, heading)
        if state.place is not None:
            north_m, east_m = state.place.north_m, state.place.east_m
            yield common.MAVLink_local_position_ned_message(self._ms(), north_m, east_m, 0.0, 0.0, 0.0, 0.0)

    def speed(self) -> Messages:
        """Tell the measured speed, 0 where it is not known; the heading; and the larger duty as throttle."""
        tick = self.state.tick
        if tick.heading_deg is not None:
            speed = tick.measured_m_s if isfinite(tick.measured_m_s) else 0.0
            heading = int(self._heading_deg(tick.heading_deg)) % 360
            throttle = min(100, round(100.0 * (tick.duty or 0.0)))
            yield common.MAVLink_vfr_hud_message(0.0, speed, heading, throttle, 0.0, 0.0)

    def receiver(self) -> Messages:
        """Tell how the position receiver does, if the rover has one: a fix, or none."""
        if "position" not in self.state.sensors:
            return
        fix = self._fresh(self.state.fix)
        lat, lon, kind = (0, 0, common.GPS_FIX_TYPE_NO_FIX)
        if fix is not None:
            lat, lon, kind = round(fix.latitude_deg * 1e7), round(fix.longitude_deg * 1e7), common.GPS_FIX_TYPE_2D_FIX
        error_mm = min(2**32 - 1, round(1000.0 * fix.error_m)) if fix is not None and fix.error_m else 0
        yield common.MAVLink_gps_raw_int_message(
            round(self.state.last["t_s"] * 1e6), kind, lat, lon, 0, NO_U16, NO_U16, NO_U16, NO_U16, 255, 0, error_mm
        )

    def health(self) -> Messages:
        """Tell which parts there are and which of them are well, the battery, and how many log records were lost."""
        state = self.state
        present = sum(BITS[name] for name in state.sensors if name in BITS) | MOTORS | ARMING_CHECKS
        ill = sum(BITS[name] for name, each in state.sensors.items() if name in BITS and each.is_late(state.t_s))
        board = self._fresh(state.board)
        ill |= (MOTORS if state.board.faults else 0) | (ARMING_CHECKS if state.tick.level == "fault" else 0)
        if board is not None and board.battery_v is not None:
            present |= BATTERY
        yield common.MAVLink_sys_status_message(
            present,
            present,
            present & ~ill,
            0,
            self._millivolts(),
            NO_I16,
            -1,
            0,
            0,
            min(state.dropped, NO_U16),
            0,
            0,
            0,
        )

    def battery(self) -> Messages:
        """Tell the battery's voltage, if the motor board measures it."""
        if (millivolts := self._millivolts()) != NO_U16:
            yield common.MAVLink_battery_status_message(
                0, common.MAV_BATTERY_FUNCTION_PROPULSION, common.MAV_BATTERY_TYPE_UNKNOWN, 0x7FFF,
                [millivolts, *[NO_U16] * 9], -1, -1, -1, -1,
            )  # fmt: skip

    def values(self) -> Messages:
        """Tell what no message of the dialect has: phase, level, counter C, goal, way and episodes of the mission."""
        state, tick = self.state, self.state.tick
        if tick.phase in PHASES:
            yield self._number("phase", PHASES.index(tick.phase))
        yield self._number("level", LEVELS.get(tick.level or "", -1))
        named = (
            ("C_deg", tick.counter_deg), ("goal_deg", state.goal_heading_deg), ("mission_m", state.mission_m),
            ("episodes", tick.episodes),
        )  # fmt: skip
        for name, value in named:
            if (
                value is not None and isfinite(value) and abs(value) < 1e30
            ):  # a third party's algorithm may say anything
                yield common.MAVLink_named_value_float_message(self._ms(), name.encode(), value)

    def _number(self, name: str, value: int) -> common.MAVLink_message:
        return common.MAVLink_named_value_int_message(self._ms(), name.encode(), value)

    def _ms(self) -> int:
        return round(self.state.t_s * 1000.0) & 0xFFFF_FFFF

    def _heading_deg(self, magnetic_deg: float) -> float:
        return wrap360(magnetic_deg + self._declination_deg)

    def _millivolts(self) -> int:
        board = self._fresh(self.state.board)
        volts = None if board is None else board.battery_v
        return NO_U16 if volts is None or not 0.0 <= volts < 65.0 else round(1000.0 * volts)

    def _fresh(self, said: Said | None) -> Said | None:
        return None if said is None or not self.state.t_s - said.t_s <= FRESH_S else said


def _hundredths(heading_deg: float) -> int:
    return round(100.0 * heading_deg) % 36_000
