"""A supervisor in virtual time over fake parts: what was done and when, what is broken, and when it is cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from random import Random
from typing import Any

from tests.virtual import run_virtually
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.run_log import RunLog
from wayfarer.control.supervisor import Supervisor
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import (
    STOP,
    Colour,
    CompassReading,
    ContactReading,
    MotionReading,
    MotorHealth,
    PositionFix,
    Rover,
    WheelCommand,
    WheelReading,
)
from wayfarer.safety.mission import RunEnd
from wayfarer.safety.settings import ManualSettings, SafetySettings

AHEAD = WheelCommand(0.5, 0.5)
VEHICLE = Vehicle(length_m=0.4, width_m=0.4, track_m=0.5, max_speed_m_s=1.0)
PARTS = {"motors", "compass", "motion"}


class Workshop:
    """Where all fakes meet: what was done and when, what is broken, and when the run is cancelled."""

    def __init__(self) -> None:
        self.trace: list[tuple[float, str]] = []
        self.broken: dict[str, Exception] = {}
        self.silent: set[str] = set()
        self.points = 0
        self.cancel_at: range = range(0)
        self.run: asyncio.Task[RunEnd] | None = None
        self.wheels = STOP
        self.answer: WheelCommand | Exception | None = None
        self.faults: tuple[str, ...] = ()
        self.colours: list[tuple[float, Colour]] = []
        self.events: list[tuple[str, dict[str, Any]]] = []
        self.outcome: list[tuple[str, str]] = []

    def note(self, what: str) -> None:
        """Something is done, now; raise if it is broken."""
        self.trace.append((asyncio.get_running_loop().time(), what))
        if what in self.broken:
            raise self.broken[what]

    async def point(self, what: str) -> None:
        """Something is done that is awaited: here the run can be cancelled, here a silent part hangs."""
        self.note(what)
        self.points += 1
        if self.run is not None and self.points in self.cancel_at:
            self.run.cancel()
        await (asyncio.sleep(1e6) if what in self.silent else asyncio.sleep(0))

    @property
    def done(self) -> list[str]:
        return [what for _, what in self.trace]

    def times(self, what: str) -> list[float]:
        return [t_s for t_s, done in self.trace if done == what]

    def named(self, event: str) -> list[dict[str, Any]]:
        return [details for name, details in self.events if name == event]


class Part:
    def __init__(self, shop: Workshop, name: str) -> None:
        self.shop, self.name = shop, name

    async def open(self) -> None:
        await self.shop.point(f"{self.name}.open")

    async def close(self) -> None:
        await self.shop.point(f"{self.name}.closing")  # a bus takes its time: what is cut short here is not done
        self.shop.note(f"{self.name}.close")

    async def now_s(self) -> float:
        await self.shop.point(f"{self.name}.read")
        return asyncio.get_running_loop().time()


class Compass(Part):
    async def read(self) -> CompassReading:
        t_s = await self.now_s()
        return CompassReading(t_s, 0.0, 0.0, t_s % 0.1, None)  # one that repeats all values is frozen


class Motion(Part):
    """Sees the rover move as its wheels are commanded, with noise."""

    def __init__(self, shop: Workshop, name: str) -> None:
        super().__init__(shop, name)
        self._t_s: float | None = None
        self._noise = Random(0)

    async def read(self) -> MotionReading:
        t_s = await self.now_s()
        dt_s, self._t_s = 0.0 if self._t_s is None else min(t_s - self._t_s, 0.1), t_s  # the deadman's part
        speed_m_s = (self.shop.wheels.left + self.shop.wheels.right) / 2 * VEHICLE.max_speed_m_s
        return MotionReading(t_s, speed_m_s * dt_s + self._noise.uniform(-1e-4, 1e-4), 0.0, 1.0)


class Contact(Part):
    async def read(self) -> ContactReading:
        return ContactReading(await self.now_s(), (), None)


class Wheels(Part):
    async def read(self) -> WheelReading:
        return WheelReading(await self.now_s(), None, None)


class Position(Part):
    async def read(self) -> PositionFix | None:
        return PositionFix(await self.now_s(), 52.0, 13.0, None)


class Motors(Part):
    deadman_s: float | None = None

    async def drive(self, command: WheelCommand) -> WheelCommand:
        await self.shop.point("motors.drive")
        self.shop.wheels = command
        return command

    async def stop(self) -> None:
        await self.shop.point("motors.stopping")
        self.shop.wheels = STOP
        self.shop.note("motors.stop")

    def halt(self) -> None:
        self.shop.wheels = STOP
        self.shop.note("motors.halt")

    async def read_back(self) -> WheelCommand | None:
        if isinstance(self.shop.answer, Exception):
            raise self.shop.answer
        if self.shop.answer is not None:
            return self.shop.answer
        return None

    async def health(self) -> MotorHealth:
        await self.shop.point("motors.health")
        return MotorHealth(12.0, self.shop.faults)


class Light(Part):
    async def show(self, colour: Colour) -> None:
        await self.shop.point("light.show")
        self.shop.colours.append((asyncio.get_running_loop().time(), colour))


class Overriding:
    """A part of which some methods are replaced: on one of a compiled class nothing can be set."""

    def __init__(self, part: object, **methods: Callable[..., Any]) -> None:
        self._part = part
        self.__dict__.update(methods)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._part, name)


def own_details(details: dict[str, Any]) -> dict[str, Any]:
    """What an event says beside its sentence and its context."""
    return {key: value for key, value in details.items() if key not in {"text", "severity", "run", "mission"}}


class EventLog(RunLog):
    """Keeps ticks, events and positions."""

    def __init__(self) -> None:
        self.ticks: list[TickRecord] = []
        self.events: list[tuple[str, dict[str, Any]]] = []
        self.fixes: list[PositionFix | None] = []

    def tick(self, record: TickRecord) -> None:
        self.ticks.append(record)

    def event(self, name: str, t_s: float, **details: object) -> None:
        self.events.append((name, own_details(details)))

    def position(self, fix: PositionFix | None) -> None:
        self.fixes.append(fix)

    def named(self, name: str) -> list[dict[str, Any]]:
        return [details for event, details in self.events if event == name]


class Log(RunLog):
    def __init__(self, shop: Workshop) -> None:
        self.shop = shop

    def tick(self, record: TickRecord) -> None:
        self.shop.note("log.tick")

    def event(self, name: str, t_s: float, **details: object) -> None:
        self.shop.events.append((name, own_details(details)))
        self.shop.note("log.event")

    def position(self, fix: PositionFix | None) -> None:
        self.shop.note("log.position")

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        self.shop.note("log.board")

    def close(self, reason: str, text: str) -> None:
        self.shop.outcome.append((reason, text))
        self.shop.note("log.close")


class Handler:
    def __init__(self, shop: Workshop) -> None:
        self.shop = shop

    def decide(self, observation: Observation) -> Decision:
        self.shop.note("handler.decide")
        return Decision(AHEAD, Phase.FOLLOW, "follow")

    def reset(self) -> None:
        pass

    def memory(self) -> Mapping[str, float | str]:
        return {}


def supervisor(
    shop: Workshop,
    algorithm: str = "pledge",
    source: str = "motion",
    safety: Mapping[str, Any] | None = None,
    manual: Mapping[str, Any] | None = None,
    **parts: Part | None,
) -> Supervisor:
    config = RoverConfig.model_validate({"name": "bench", "vehicle": VEHICLE, "anomaly_source": source})
    limits = {"start_delay_s": 0.0, "slew_per_s": 1000.0, **(safety or {})}
    config = config.model_copy(update={"safety": SafetySettings(**limits), "manual": ManualSettings(**(manual or {}))})
    bundle: dict[str, Any] = {"motors": Motors(shop, "motors"), "motion": Motion(shop, "motion")} | parts
    rover = Rover(Compass(shop, "compass"), **bundle)
    handler: EscapeHandler = Handler(shop)
    return Supervisor(rover, config, CATALOGUE[algorithm], handler, Log(shop), ladder_seed=1)


Script = Mapping[float, Callable[[Supervisor], object]]


def drive(shop: Workshop, script: Script | None = None, *, for_s: float = 1.0, **rover: Any) -> RunEnd:
    """Run in virtual time, armed from the start, until ``for_s``; the script acts at its times."""

    async def main() -> RunEnd:
        loop = asyncio.get_running_loop()
        under_test = supervisor(shop, **rover)
        under_test.controller.arm(loop.time(), 0.0)
        shop.run = asyncio.create_task(under_test.run())
        for t_s, act in {for_s: lambda it: it.finish("requested", "enough"), **(script or {})}.items():
            loop.call_later(t_s, act, under_test)
        try:
            return await shop.run
        finally:
            assert asyncio.all_tasks() == {asyncio.current_task()}, "a task was left running"

    return run_virtually(main())


def breaking(shop: Workshop, what: str, error: Exception | None = None) -> Callable[[Supervisor], object]:
    return lambda _: shop.broken.update({what: error or RuntimeError(f"bug in {what}")})


def mending(shop: Workshop) -> Callable[[Supervisor], object]:
    return lambda _: shop.broken.clear()


def assert_wheels_stopped_first(shop: Workshop) -> None:
    """The wheels were stopped, then every part closed, and nothing was commanded afterwards."""
    stopping = len(shop.done) - 1 - shop.done[::-1].index("motors.stop")
    after = shop.done[stopping + 1 :]
    assert shop.wheels == STOP
    assert {f"{part}.close" for part in PARTS} <= set(after)
    assert "motors.drive" not in after
    assert after[-1] == "log.close"
