"""Simulated parts at device depth: they implement the protocols of ``wayfarer.hal`` over the one world.

Each reports what its real counterpart would: the quantised bearing of a CMPS14, flow in counts with a quality, the
sides of a bumper, wheels in the steps of a motor board. None knows more of the world than its sense gives.
"""

from __future__ import annotations

from asyncio import get_running_loop, sleep
from typing import Final

from mypy_extensions import mypyc_attr

from wayfarer.angles import coordinates_deg
from wayfarer.fieldlog.record import WORLD_CORNER
from wayfarer.hal import (
    STOP,
    CompassReading,
    ContactReading,
    MotionReading,
    MotorHealth,
    PositionFix,
    WheelCommand,
    WheelReading,
)
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FLOW_M_PER_COUNT, SQUAL_FULL, FlowSensorModel, HeadingSensorModel
from wayfarer.simhal.world.simulated_world import SimulatedWorld

DEADMAN_S: Final = 0.3  # as forestrover.toml sets its Sabertooth's
FIX_ERROR_M: Final = 3.0  # standard deviation of each axis under trees; chosen by us


@mypyc_attr(allow_interpreted_subclasses=True)
class SimPart:
    """Life cycle shared by all simulated parts: opening one takes the clock of the running loop.

    None waits when it is read or commanded: ``read_without_waiting`` and ``drive_without_waiting`` are not coroutines.
    """

    name = "simulated part"

    def __init__(self, world: SimulatedWorld) -> None:
        self._world = world

    async def open(self) -> None:
        """Take the clock."""
        self._time = get_running_loop().time

    async def close(self) -> None:
        """Nothing to release."""


@mypyc_attr(allow_interpreted_subclasses=True)
class SimCompass(SimPart):
    """A compass with noise on bearing and tilt, quantised to 0.1 degrees as the CMPS14's 16-bit registers are.

    It takes ``opens_s`` to start up.
    """

    name = "simulated compass"

    def __init__(self, world: SimulatedWorld, streams: RandomStreams, opens_s: float = 0.0) -> None:
        super().__init__(world)
        self._sensor = HeadingSensorModel(world, streams)
        self._opens_s = opens_s

    async def open(self) -> None:
        """Take the clock, one sample, as a real one is asked who it is, and the time that starting up takes."""
        await super().open()
        self._sensor.sample(self._time())
        await sleep(self._opens_s)

    async def read(self) -> CompassReading:
        """Return heading and tilt now."""
        return self.read_without_waiting(self._time())

    def read_without_waiting(self, t_s: float) -> CompassReading:
        """Return heading and tilt at ``t_s``, which is now."""
        heading, pitch, roll = self._sensor.whole_tenths(t_s)
        return CompassReading(t_s, heading / 10.0, pitch / 10.0, roll / 10.0, 3)


@mypyc_attr(allow_interpreted_subclasses=True)
class SimFlow(SimPart):
    """An optical flow sensor: displacement since the last read, in counts; it takes ``opens_s`` to start up."""

    name = "simulated optical flow"

    def __init__(
        self, world: SimulatedWorld, streams: RandomStreams, m_per_count: float = FLOW_M_PER_COUNT, opens_s: float = 0.0
    ) -> None:
        super().__init__(world)
        self._sensor = FlowSensorModel(world, streams, m_per_count)
        self._m_per_count = m_per_count
        self._opens_s = opens_s

    async def open(self) -> None:
        """Take the clock, and the time that starting up takes."""
        await super().open()
        self._is_first = True
        await sleep(self._opens_s)

    async def read(self) -> MotionReading:
        """Return the displacement since the previous read; the first one, since nobody knows when, has quality 0."""
        return self.read_without_waiting(self._time())

    def read_without_waiting(self, t_s: float) -> MotionReading:
        """Return the displacement between the previous read and ``t_s``, which is now."""
        forward, right = self._sensor.whole_counts(t_s)
        quality = 0.0 if self._is_first else self._sensor.squal / SQUAL_FULL
        self._is_first = False
        return MotionReading(t_s, forward * self._m_per_count, right * self._m_per_count, quality)


@mypyc_attr(allow_interpreted_subclasses=True)
class SimBumper(SimPart):
    """A bumper all around that also feels along which bearing the touched obstacle lies."""

    name = "simulated bumper"

    async def read(self) -> ContactReading:
        """Return what touches the body now."""
        return self.read_without_waiting(self._time())

    def read_without_waiting(self, t_s: float) -> ContactReading:
        """Return what touches the body at ``t_s``, which is now."""
        self._world.tick_chips()  # a deadman may have tripped since
        self._world.advance_to(t_s)
        touch = self._world.touch
        if touch is None:
            return ContactReading(t_s, (), None)
        return ContactReading(t_s, touch.sides, touch.obstacle.axis_deg)


@mypyc_attr(allow_interpreted_subclasses=True)
class SimWheels(SimPart):
    """Encoders of the wheels and a measurement of the motors' currents, or one of the two.

    ``m_per_count`` is the way of a rim for a count, 0 for the exact way; ``a_per_step`` the same of the currents.
    """

    name = "simulated wheels"

    def __init__(
        self,
        world: SimulatedWorld,
        m_per_count: float = 0.0,
        a_per_step: float = 0.0,
        *,
        way: bool = True,
        current: bool = True,
    ) -> None:
        super().__init__(world)
        self._way, self._current = way, current
        self._m_per_count, self._a_per_step = m_per_count, a_per_step
        self._left = self._right = 0.0  # in counts, or metres if the way is exact
        self._is_first = True

    async def open(self) -> None:
        """Take the clock; what the rims did before is not known."""
        await super().open()
        self._is_first = True

    async def read(self) -> WheelReading:
        """Return the way since the previous read, and the currents now."""
        return self.read_without_waiting(self._time())

    def read_without_waiting(self, t_s: float) -> WheelReading:
        """Return the way between the previous read and ``t_s``, which is now, and the currents."""
        world = self._world
        world.tick_chips()
        world.advance_to(t_s)
        left_way_m = right_way_m = left_a = right_a = None
        if self._way:
            left, right = world.rims_m
            if m_per_count := self._m_per_count:
                left, right = float(round(left / m_per_count)), float(round(right / m_per_count))
            if not self._is_first:
                m_each = m_per_count or 1.0
                left_way_m, right_way_m = (left - self._left) * m_each, (right - self._right) * m_each
            self._left, self._right, self._is_first = left, right, False
        if self._current:
            left_load, right_load = world.motor_load
            left_a, right_a = left_load * world.stall_current_a, right_load * world.stall_current_a
            if a_per_step := self._a_per_step:
                left_a, right_a = round(left_a / a_per_step) * a_per_step, round(right_a / a_per_step) * a_per_step
        return WheelReading(t_s, left_way_m, right_way_m, left_a, right_a)


@mypyc_attr(allow_interpreted_subclasses=True)
class SimReceiver(SimPart):
    """A GPS receiver with white noise; a real one's error wanders."""

    name = "simulated receiver"

    def __init__(self, world: SimulatedWorld, streams: RandomStreams) -> None:
        super().__init__(world)
        self._error_m = streams.normal("receiver", FIX_ERROR_M)

    async def read(self) -> PositionFix:
        """Return a fix."""
        return self.read_without_waiting(self._time())

    def read_without_waiting(self, t_s: float) -> PositionFix:
        """Return a fix of ``t_s``, which is now."""
        world = self._world
        world.tick_chips()
        world.advance_to(t_s)
        north_m, east_m = world.y_m + self._error_m.draw(), world.x_m + self._error_m.draw()
        return PositionFix(t_s, *coordinates_deg(WORLD_CORNER, north_m, east_m), FIX_ERROR_M)


@mypyc_attr(allow_interpreted_subclasses=True)
class SimMotors(SimPart):
    """Both wheel sides; what is commanded is applied from the world's next step on.

    ``steps`` is how many steps of duty the board knows between still and full: 127 for a Sabertooth.
    """

    name = "simulated motors"
    deadman_s: float | None = DEADMAN_S

    def __init__(self, world: SimulatedWorld, steps: float = 127.0) -> None:
        super().__init__(world)
        self._steps = steps

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply a command, in whole steps towards zero."""
        return self.drive_without_waiting(self._time(), command)

    def drive_without_waiting(self, now_s: float, command: WheelCommand) -> WheelCommand:
        """Apply a command."""
        left, right = command.left, command.right
        world, steps = self._world, self._steps
        left, right = int(left * steps) / steps, int(right * steps) / steps
        world.advance_to(now_s)
        world.command(left, right)
        world.deadman_at_s = now_s + DEADMAN_S
        return WheelCommand(left, right)

    async def stop(self) -> None:
        """Stop both sides."""
        self.halt()

    def halt(self) -> None:
        """Stop both sides."""
        self._world.command(*STOP)

    async def read_back(self) -> WheelCommand:
        """Return the duty of both sides."""
        return WheelCommand(*self._world.commanded)

    async def health(self) -> MotorHealth:
        """Return the battery's voltage and no faults."""
        return MotorHealth(self._world.battery_v, ())
