"""Modes and missions of a run: disarmed, arming, armed, held, and how far and how long since it was armed. Pure."""

from __future__ import annotations

from wayfarer.fieldlog.run_events import Noted
from wayfarer.fieldlog.run_state import RunState
from wayfarer.fieldlog.typed import Tick


class MissionTracker:
    """Follows the events and the ticks of one run, and updates its state."""

    def __init__(self, state: RunState) -> None:
        self._state = state
        self._began_t_s: float | None = None
        self._from_m = 0.0

    def take(self, tick: Tick) -> None:
        """Count the time and the metres of a mission, if there is one."""
        state = self._state
        if tick.travelled_m is not None:
            state.commanded_m = tick.travelled_m
        if self._began_t_s is not None:
            state.mission_s = tick.t_s - self._began_t_s
            state.mission_m = (tick.travelled_m or self._from_m) - self._from_m

    def note(self, event: Noted) -> None:
        """Take what changes the mode, the hold or the goal; any other event changes nothing."""
        state = self._state
        match event:
            case Noted(name="arming"):
                state.mode, state.operator_hold = event.name, False
            case Noted(name="armed"):
                state.mode = event.name
                state.goal_heading_deg = event.goal_heading_deg
                self._began_t_s, self._from_m = event.t_s, state.tick.travelled_m or 0.0
                if state.from_start is None:
                    state.from_start, state.start = True, state.place
            case Noted(name="disarmed"):
                state.mode, state.why_disarmed = event.name, event.reason or ""
                self._began_t_s = None
            case Noted(name="hold" | "resume"):
                state.operator_hold = event.name == "hold"
            case Noted(name="goal"):
                state.goal_heading_deg = event.goal_heading_deg
