"""The link to a ground station (QGroundControl, Mission Planner, MAVProxy) by MAVLink 2."""

from __future__ import annotations
