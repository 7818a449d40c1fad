"""A controller with parts whose other end the test has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tests.kit.motors import Motors
from tests.kit.workshop import AHEAD, VEHICLE, EventLog
from wayfarer.angles import METRES_PER_DEG
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.controller import Controller
from wayfarer.control.loop import ControlLoop, WheelMotors
from wayfarer.control.modes import Mode
from wayfarer.control.tick import BoardReport, Inbox
from wayfarer.detector import Detector
from wayfarer.escape.api import Decision, EscapeHandler, Observation, Phase
from wayfarer.hal import CompassReading, MotorHealth, PositionFix, WheelCommand
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.settings import BoardSettings, EntrapmentSettings, ManualSettings, SafetySettings

TICK_S = 0.05
BOARD = BoardSettings(battery_low_v=11.0, battery_critical_v=10.0, battery_low_s=0.5, battery_critical_s=0.5)
BY_HAND = ManualSettings(allowed=True, deadman_s=0.3, speed_m_s=0.8, turn_deg_s=90.0)
HOME = PositionFix(0.0, 52.0, 13.0, 3.0)


class Wanting:
    """A handler that always wants the same wheels."""

    def __init__(self) -> None:
        self.wheels = AHEAD
        self.seen: list[Observation] = []

    def decide(self, observation: Observation) -> Decision:
        self.seen.append(observation)
        return Decision(self.wheels, Phase.FOLLOW, "follow")

    def reset(self) -> None:
        self.seen.clear()

    def memory(self) -> Mapping[str, float | str]:
        return {"counter_deg": 0.0, "episodes": 0}


class Bench:
    """A controller with parts whose other end the test has; the compass speaks each tick unless told otherwise."""

    def __init__(
        self,
        handler: EscapeHandler | None = None,
        wheels: WheelMotors | None = None,
        log: EventLog | None = None,
        *,
        give_up: bool = False,
        watches_motion: bool = False,
        goes_on: bool = False,
        **safety: Any,
    ) -> None:
        limits = SafetySettings(**{"start_delay_s": 0.0, "settle_s": 0.2, "slew_per_s": 1000.0} | safety)
        progress = EntrapmentSettings(give_up=give_up)
        self.config = RoverConfig(
            name="bench", vehicle=VEHICLE, safety=limits, board=BOARD, progress=progress, manual=BY_HAND
        )
        self.motors, self.inbox, self.log = Motors(), Inbox(), log or EventLog()
        self.handler = Wanting()
        may_reckon = limits.on_lost_sense == "continue"
        detector = Detector(self.config.detector, VEHICLE, watches_motion=watches_motion, may_reckon=may_reckon)
        self.t_s = 100.0
        self.suspended_s = 0.0  # of the process, after each tick has begun
        self.controller = Controller(
            self.config, detector, handler or self.handler, self.log, ladder_seed=1, goes_on=goes_on
        )
        self.loop = ControlLoop(
            wheels or self.motors, self.inbox, self.controller, self.log,
            clock=lambda: self.t_s + self.suspended_s, late_s=limits.tick_late_s,
        )  # fmt: skip

    async def tick(
        self,
        ticks: int = 1,
        *,
        heading_deg: float = 0.0,
        pitch_deg: float = 0.0,
        compass: bool = True,
        dt_s: float = TICK_S,
    ) -> None:
        for _ in range(ticks):
            self.t_s += dt_s
            if compass:
                self.inbox.put_compass(CompassReading(self.t_s, heading_deg, pitch_deg, 0.0, None))
            await self.do_tick()

    async def do_tick(self) -> None:
        await self.loop.tick(self.t_s)

    async def armed(self, goal_heading_deg: float | None = 0.0) -> Bench:
        """This bench, driving."""
        await self.tick()
        self.controller.arm(self.t_s, goal_heading_deg)
        await self.tick()
        assert self.controller.mode is Mode.ARMED
        assert self.wheels == AHEAD
        return self

    async def board_says(self, battery_v: float | None, *faults: str, for_s: float = 1.0) -> None:
        """Let the board answer the same at each tick for a while."""
        for _ in range(round(for_s / TICK_S)):
            self.inbox.put_board(BoardReport(self.t_s + TICK_S, MotorHealth(battery_v, faults)))
            await self.tick()

    async def fixes(self, *norths_m: float, every_s: float = 0.5) -> None:
        """Let a receiver give fixes, so many metres north of home, while the rover goes on."""
        for north_m in norths_m:
            fix = HOME._replace(t_s=self.t_s, latitude_deg=HOME.latitude_deg + north_m / METRES_PER_DEG)
            self.inbox.put_fix(fix)
            await self.tick(round(every_s / TICK_S))

    @property
    def end(self) -> str | None:
        """Why the run ended, if it did."""
        return None if self.controller.end is None else self.controller.end.reason

    @property
    def wheels(self) -> WheelCommand:
        return self.motors.commands[-1]

    @property
    def health(self) -> tuple[Level, Condition | None]:
        return self.log.ticks[-1].level, self.log.ticks[-1].cause
