"""Answers to what stations ask when they connect: parameters, mission, version. Pure.

QGroundControl and Mission Planner wait for a list of parameters with one entry at least, and for a mission, before they
show a vehicle. Parameters are here to be read: a rover's settings are in its file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from math import isfinite

from pymavlink.dialects.v20 import common

from wayfarer import __version__
from wayfarer.config.mavlink_settings import MavlinkSettings

Messages = Iterator[common.MAVLink_message]
CAPABILITIES = common.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | common.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
NO_MISSION = common.MAV_MISSION_UNSUPPORTED


def parameters(settings: MavlinkSettings) -> dict[str, float]:
    """Return the parameters, names of at most 16 characters; SYSID_THISMAV is what ArduPilot calls it."""
    return {
        "SYSID_THISMAV": settings.system_id,
        "LINK_LOST_S": settings.link_lost_s,
        "LINK_LOST_HOLD": settings.on_link_lost == "hold",
        "MAY_ARM": settings.may_arm,
    }


class Answers:
    """What one vehicle answers.

    Args:
        settings: those of its link.
    """

    def __init__(self, settings: MavlinkSettings) -> None:
        self._parameters = parameters(settings)

    def to(self, message: common.MAVLink_message, system: int, component: int) -> Messages:
        """Yield the answers to a message of a sender; none where it asks for nothing."""
        match message:
            case common.MAVLink_param_request_list_message():
                yield from map(self._parameter, range(len(self._parameters)))
            case common.MAVLink_param_request_read_message(param_index=-1, param_id=name):
                yield from self._named(name)
            case common.MAVLink_param_request_read_message(param_index=index):
                if 0 <= index < len(self._parameters):
                    yield self._parameter(index)
            case common.MAVLink_param_set_message(param_id=name):
                yield from self._named(name)  # as it is: so a station sees that it has not been changed
            case common.MAVLink_mission_request_list_message(mission_type=kind):
                yield common.MAVLink_mission_count_message(system, component, 0, kind)
            case common.MAVLink_mission_count_message(mission_type=kind):
                yield common.MAVLink_mission_ack_message(system, component, NO_MISSION, kind)
            case common.MAVLink_mission_clear_all_message(mission_type=kind):
                yield common.MAVLink_mission_ack_message(system, component, NO_MISSION, kind)

    def _named(self, name: str) -> Messages:
        names = list(self._parameters)
        if name in names:
            yield self._parameter(names.index(name))

    def _parameter(self, index: int) -> common.MAVLink_message:
        name, value = list(self._parameters.items())[index]
        kind = common.MAV_PARAM_TYPE_REAL32
        return common.MAVLink_param_value_message(name.encode(), float(value), kind, len(self._parameters), index)


def version() -> Messages:
    """Yield who this is: the version of wayfarer, and what it can do."""
    major, minor, patch = (int(part) & 0xFF for part in re.findall(r"\d+", __version__)[:3])
    packed = major << 24 | minor << 16 | patch << 8 | common.FIRMWARE_VERSION_TYPE_DEV
    nothing = [0] * 8
    yield common.MAVLink_autopilot_version_message(CAPABILITIES, packed, 0, 0, 0, nothing, nothing, nothing, 0, 0, 0)


def on_request(streams: Mapping[int, Callable[[], Messages]], number: float) -> common.MAVLink_message | None:
    """Return the message with a number that a station asks for (REQUEST_MESSAGE); None where the rover has none."""
    make = streams.get(int(number)) if isfinite(number) else None
    return None if make is None else next((each for each in make() if type(each).id == number), None)
