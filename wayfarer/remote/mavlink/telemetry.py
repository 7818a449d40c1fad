"""What the rover sends to a ground station: log records in, MAVLink messages out. Pure.

A message is made when it is due, from the state of the run so far; a record costs no more than the fold.

The numbers of the modes are those of ArduPilot's rovers, because MAVProxy and Mission Planner know the names of these
for each vehicle of the type ground rover. The autopilot is reported as ``GENERIC``: no station may take this for
ArduPilot or PX4, whose parameters and missions it would then ask for.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from math import isfinite, radians
from typing import Final, TypeVar

from pymavlink.dialects.v20 import common

from wayfarer import __version__
from wayfarer.angles import wrap180, wrap360
from wayfarer.config.settings import MavlinkSettings
from wayfarer.escape.api import Phase
from wayfarer.fieldlog.record import AnyRecord, Board, Fix
from wayfarer.fieldlog.run_fold import PhaseChanged, RunFold, RunState, Told
from wayfarer.fieldlog.wording import Tone
from wayfarer.logview.narrator import log_lines
from wayfarer.safety.conditions import Level

Messages = Iterator[common.MAVLink_message]
Said = TypeVar("Said", Fix, Board)

MODE_MANUAL, MODE_HOLD, MODE_LOITER, MODE_AUTO, MODE_INITIALISING = 0, 4, 5, 10, 16

# "Not known", as the definitions of the fields say.
NO_U16: Final = 0xFFFF
NO_I16: Final = -1
FRESH_S = 5.0  # a receiver speaks once per second, a motor board four times: chosen by us
PHASES: Final = tuple(phase.value for phase in Phase)  # ``phase`` is the place in this list, from 0
LEVELS: Final = {level.name.lower(): int(level) for level in Level}

COMPASS = common.MAV_SYS_STATUS_SENSOR_3D_MAG
MOTION = common.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW
RECEIVER = common.MAV_SYS_STATUS_SENSOR_GPS
MOTORS = common.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
BATTERY = common.MAV_SYS_STATUS_SENSOR_BATTERY
ARMING_CHECKS = common.MAV_SYS_STATUS_PREARM_CHECK
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

    def add(self, record: AnyRecord) -> Sequence[Told]:
        """Add a record; return what it says."""
        return self._fold.add(record)

    def heartbeat(self) -> Messages:
        """Send mode and state."""
        run, mode = self.state, custom_mode(self.state)
        base = common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= common.MAV_MODE_FLAG_SAFETY_ARMED if run.mode in ("armed", "manual") else 0
        base |= common.MAV_MODE_FLAG_AUTO_ENABLED if mode == MODE_AUTO else 0
        base |= common.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED if mode == MODE_MANUAL else 0
        yield common.MAVLink_heartbeat_message(
            common.MAV_TYPE_GROUND_ROVER, common.MAV_AUTOPILOT_GENERIC, base, mode, system_status(run), 3
        )

    def attitude(self) -> Messages:
        """Send roll, pitch and heading; nothing before the first reading of the compass."""
        tick = self.state.tick
        if tick.heading_deg is None:
            return
        yield common.MAVLink_attitude_message(
            self._ms(), radians(tick.roll_deg or 0.0), radians(tick.pitch_deg or 0.0),
            radians(wrap180(self._heading_deg(tick.heading_deg))), 0.0, 0.0, 0.0,
        )  # fmt: skip

    def position(self) -> Messages:
        """Send where the rover is: by the receiver, if it answers, and by dead reckoning from where the log begins."""
        state = self.state
        if (fix := self._fresh(state.fix)) is not None:
            magnetic_deg = state.tick.heading_deg  # sent in hundredths of a degree
            heading = NO_U16 if magnetic_deg is None else round(100.0 * self._heading_deg(magnetic_deg)) % 36_000
            lat, lon = round(fix.latitude_deg * 1e7), round(fix.longitude_deg * 1e7)
            yield common.MAVLink_global_position_int_message(self._ms(), lat, lon, 0, 0, 0, 0, 0, heading)
        if state.place is not None:
            north_m, east_m = state.place.north_m, state.place.east_m
            yield common.MAVLink_local_position_ned_message(self._ms(), north_m, east_m, 0.0, 0.0, 0.0, 0.0)

    def speed(self) -> Messages:
        """Send the measured speed, 0 if it is not known; the heading; and the larger duty as throttle."""
        tick = self.state.tick
        if tick.heading_deg is not None:
            speed = self.state.measured_m_s if isfinite(self.state.measured_m_s) else 0.0
            heading = int(self._heading_deg(tick.heading_deg)) % 360
            throttle = min(100, round(100.0 * tick.duty))
            yield common.MAVLink_vfr_hud_message(0.0, speed, heading, throttle, 0.0, 0.0)

    def receiver(self) -> Messages:
        """Send how the position receiver does, if the rover has one: a fix, or none."""
        if "position" not in self.state.sensors:
            return
        fix = self._fresh(self.state.fix)
        lat, lon, kind = (0, 0, common.GPS_FIX_TYPE_NO_FIX)
        if fix is not None:
            lat, lon, kind = round(fix.latitude_deg * 1e7), round(fix.longitude_deg * 1e7), common.GPS_FIX_TYPE_2D_FIX
        error_mm = min(2**32 - 1, round(1000.0 * fix.error_m)) if fix is not None and fix.error_m else 0
        yield common.MAVLink_gps_raw_int_message(
            round(self.state.t_s * 1e6), kind, lat, lon, 0, NO_U16, NO_U16, NO_U16, NO_U16, 255, 0, error_mm
        )

    def health(self) -> Messages:
        """Send which parts there are and which of them are well, the battery, and how many log records were lost."""
        state = self.state
        present = sum(BITS[name] for name in state.sensors if name in BITS) | MOTORS | ARMING_CHECKS
        ill = sum(BITS[name] for name, each in state.sensors.items() if name in BITS and each.is_late(state.t_s))
        board = self._fresh(state.board)
        ill |= (MOTORS if state.board is not None and state.board.faults else 0) | (
            ARMING_CHECKS if state.tick.level == "fault" else 0
        )
        if board is not None and board.battery_v is not None:
            present |= BATTERY
        yield common.MAVLink_sys_status_message(
            present, present, present & ~ill, 0, self._millivolts(), NO_I16, -1,
            0, 0, min(state.dropped, NO_U16), 0, 0, 0,
        )  # fmt: skip

    def battery(self) -> Messages:
        """Send the battery's voltage, if the motor board measures it."""
        if (millivolts := self._millivolts()) != NO_U16:
            yield common.MAVLink_battery_status_message(
                0, common.MAV_BATTERY_FUNCTION_PROPULSION, common.MAV_BATTERY_TYPE_UNKNOWN, 0x7FFF,
                [millivolts, *[NO_U16] * 9], -1, -1, -1, -1,
            )  # fmt: skip

    def values(self) -> Messages:
        """Send what no message of the dialect has: phase, level, counter C, goal, way and episodes of the mission."""
        state, tick = self.state, self.state.tick
        if tick.phase in PHASES:
            yield self._number("phase", PHASES.index(tick.phase))
        yield self._number("level", LEVELS.get(tick.level, -1))
        named = (
            ("C_deg", tick.remembered("counter_deg")), ("goal_deg", tick.goal_heading_deg),
            ("mission_m", state.mission_m), ("episodes", tick.remembered("episodes")),
        )  # fmt: skip
        for name, value in named:
            # A third party's algorithm may say anything.
            if value is not None and isfinite(value) and abs(value) < 1e30:
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


def custom_mode(run: RunState) -> int:
    """Return the number of the mode that a run is in: a rover that is disarmed is in HOLD."""
    if run.mode == "manual":
        return MODE_MANUAL
    if run.mode == "arming":
        return MODE_INITIALISING
    return MODE_AUTO if run.mode == "armed" and not run.tick.held else MODE_HOLD


def system_status(run: RunState) -> int:
    """Return how the rover does (MAV_STATE). A fault disarms it, so its level counts in any mode."""
    if run.tick.level == "fault":
        return int(common.MAV_STATE_EMERGENCY)
    if run.mode not in ("armed", "manual"):
        return int(common.MAV_STATE_STANDBY)
    troubled = run.tick.level in ("degrade", "hold") and not run.tick.held
    return int(common.MAV_STATE_CRITICAL if troubled else common.MAV_STATE_ACTIVE)


# -- texts -----------------------------------------------------------------------------------------------------------

WAITING = 24  # texts; the oldest go first
CHUNK_BYTES, CHUNKS = 50, 6  # of one text; the longest refusals have 300 characters
SEVERITIES: Final = {
    Tone.FAULT: common.MAV_SEVERITY_CRITICAL,
    Tone.WARNING: common.MAV_SEVERITY_WARNING,
    Tone.PERSON: common.MAV_SEVERITY_NOTICE,
    Tone.END: common.MAV_SEVERITY_NOTICE,
}
LAST_NUMBER: Final = 0xFFFF  # of a text in chunks; 0 means that there is one chunk only


class StatusTexts:
    """What happens in a run, in the words of the terminal, in chunks of 50 bytes.

    While nobody listens the newest texts wait. So a station that connects gets how the run before ended, and one that
    was out of reach gets what it has missed.
    """

    def __init__(self) -> None:
        self._waiting: deque[list[common.MAVLink_message]] = deque(maxlen=WAITING)
        self._number = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def add_events(self, events: Iterable[Told]) -> None:
        """Queue a text for each event that has one."""
        for event in events:
            if not isinstance(event, PhaseChanged):
                for _, text, tone in log_lines(event):
                    self.add(text, SEVERITIES.get(tone, common.MAV_SEVERITY_INFO))

    def add(self, text: str, severity: int) -> None:
        """Queue a text with a severity (MAV_SEVERITY); what stations cannot show becomes a question mark."""
        data = text.encode("ascii", "replace")[: CHUNKS * CHUNK_BYTES]
        number, pieces = 0, [data]
        if len(data) > CHUNK_BYTES:
            self._number = number = self._number % LAST_NUMBER + 1
            # A chunk that is not full ends a text: an empty one does, if the others are all full.
            pieces = [data[begin : begin + CHUNK_BYTES] for begin in range(0, len(data) + 1, CHUNK_BYTES)]
        chunk = partial(common.MAVLink_statustext_message, severity)
        self._waiting.append([chunk(piece, number, place) for place, piece in enumerate(pieces)])

    def pop(self) -> list[common.MAVLink_message]:
        """Return the chunks of the oldest text that waits."""
        return self._waiting.popleft()


# -- what stations ask when they connect -------------------------------------------------------------------------------

CAPABILITIES = common.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | common.MAV_PROTOCOL_CAPABILITY_COMMAND_INT


class Answers:
    """Parameters and an empty mission: QGroundControl and Mission Planner wait for them before they show a vehicle.

    Parameters are there to be read, names of at most 16 characters; ArduPilot calls the first one so.
    """

    def __init__(self, settings: MavlinkSettings) -> None:
        self._parameters = {
            "SYSID_THISMAV": settings.system_id,
            "LINK_LOST_S": settings.link_lost_s,
            "LINK_LOST_HOLD": settings.on_link_lost == "hold",
        }

    def to(self, message: common.MAVLink_message) -> Messages:
        """Yield the answers to a message; none if it asks for nothing."""
        sender = message.get_srcSystem(), message.get_srcComponent()
        match message:
            case common.MAVLink_param_request_list_message():
                yield from map(self._parameter, self._parameters)
            case common.MAVLink_param_request_read_message(param_index=index, param_id=name):
                names = list(self._parameters)
                if name in names or 0 <= index < len(names):
                    yield self._parameter(names[index] if index >= 0 else name)
            case common.MAVLink_param_set_message(param_id=name) if name in self._parameters:
                yield self._parameter(name)  # as it is: so a station sees that it has not been changed
            case common.MAVLink_mission_request_list_message(mission_type=kind):
                yield common.MAVLink_mission_count_message(*sender, 0, kind)
            case (
                common.MAVLink_mission_count_message(mission_type=kind)
                | common.MAVLink_mission_clear_all_message(mission_type=kind)
            ):
                yield common.MAVLink_mission_ack_message(*sender, common.MAV_MISSION_UNSUPPORTED, kind)

    def _parameter(self, name: str) -> common.MAVLink_message:
        names, kind = list(self._parameters), common.MAV_PARAM_TYPE_REAL32
        value = float(self._parameters[name])
        return common.MAVLink_param_value_message(name.encode(), value, kind, len(names), names.index(name))


def version() -> common.MAVLink_message:
    """Return who this is: the version of wayfarer, and what it can do."""
    major, minor, patch = (int(part) & 0xFF for part in re.findall(r"\d+", __version__)[:3])
    packed = major << 24 | minor << 16 | patch << 8 | common.FIRMWARE_VERSION_TYPE_DEV
    nothing = [0] * 8
    return common.MAVLink_autopilot_version_message(CAPABILITIES, packed, 0, 0, 0, nothing, nothing, nothing, 0, 0, 0)
