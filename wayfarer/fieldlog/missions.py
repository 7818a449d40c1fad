"""Missions of a run and the episodes in them, as its events and ticks tell. Pure.

A mission is from arming to disarming. An episode is from the first manoeuvre until the goal is followed again.
"""

from __future__ import annotations

from dataclasses import dataclass

from wayfarer.escape.api import Phase
from wayfarer.fieldlog.run_events import Noted
from wayfarer.fieldlog.run_state import RunState
from wayfarer.fieldlog.typed import RunEvent, Tick

SIDES = {1.0: "right", -1.0: "left"}  # tau: clockwise is to the right
MANOEUVRES = frozenset(phase.value for phase in Phase) - {
    Phase.FOLLOW.value, Phase.HALT.value, Phase.MANUAL.value,
}  # fmt: skip


class MissionTracker:
    """Follows the events and the ticks of one run, and updates its state: mode, hold, goal, and the mission so far."""

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
                state.mode, state.operator_hold, state.why_disarmed = event.name, False, event.reason or ""
                self._began_t_s = None
            case Noted(name="hold" | "resume"):
                state.operator_hold = event.name == "hold"
            case Noted(name="manual"):
                state.mode, state.operator_hold = event.name, False
            case Noted(name="manual_ended"):
                state.mode = event.mode or "disarmed"
                state.operator_hold = state.mode == "armed"
            case Noted(name="goal"):
                state.goal_heading_deg = event.goal_heading_deg


@dataclass(slots=True)
class Episode:
    """From the first manoeuvre until the goal is followed again. A hold interrupts it; re-arming ends it.

    ``side`` is that of the first turn, empty if it is not known; ``metres`` by dead reckoning. ``ended_by`` is the
    ``why`` of the tick that ended it, or the event; None if it goes on or was cut off.
    """

    start_s: float
    side: str
    end_s: float
    metres: float = 0.0
    turns: int = 0
    ended_by: str | None = None


@dataclass(slots=True)
class EpisodeBegan(RunEvent):
    """An episode; the fold continues to write in it until it ends."""

    episode: Episode


# Decisions of the recovery, which takes the wheels from the algorithm: its drives are in no episode.
RECOVERY = "ladder."


class EpisodeTracker:
    """Follows the ticks of one run."""

    def __init__(self) -> None:
        self._episode: Episode | None = None
        self._from_m = 0.0

    def take(self, tick: Tick, before: Tick) -> list[RunEvent]:
        """Begin, continue with or end an episode."""
        episode, phase = self._episode, tick.phase
        told: list[RunEvent] = []
        if episode is None:
            if phase not in MANOEUVRES or (tick.why or "").startswith(RECOVERY):
                return told
            side = "" if tick.side is None else SIDES.get(tick.side, "")
            episode = self._episode = Episode(tick.elapsed_s, side, tick.elapsed_s)
            self._from_m = tick.path_m
            told.append(EpisodeBegan(tick.elapsed_s, tick.t_s, episode))
        episode.metres = tick.path_m - self._from_m
        episode.turns += phase == Phase.TURN_AWAY.value != before.phase
        if phase in MANOEUVRES or phase == Phase.FOLLOW.value:
            episode.end_s = tick.elapsed_s
        if phase == Phase.FOLLOW.value:
            self.end(tick.why)
        return told

    def end(self, why: str | None) -> None:
        """End the episode, if there is one."""
        if self._episode is not None:
            self._episode.ended_by, self._episode = why, None
