"""Simulated parts at device depth: they implement the protocols of ``wayfarer.hal`` over the one world.

Each reports what its real counterpart would: the quantised bearing of a CMPS14, flow in counts with a quality, the
sides of a bumper. None knows more of the world than its sense gives.
"""

from __future__ import annotations

from asyncio import get_running_loop
from math import degrees

from wayfarer.hal import STOP, CompassReading, ContactReading, MotionReading, MotorHealth, WheelCommand
from wayfarer.simhal.streams import Streams
from wayfarer.simhal.world import World

COMPASS_NOISE_DEG = 1.0  # the released simulator's compass noise (reference/README.md)
TILT_NOISE_DEG = 1.0  # rough ground and accelerometer; not given by the paper
# PMW3901 at 0.1 m above ground: 0.213 mm a count (hardware.md 8.2). Noise: a few counts, and 3 % of the distance.
FLOW_M_PER_COUNT = 0.000213
FLOW_NOISE_COUNTS = 2.0
FLOW_NOISE_SHARE = 0.03
FLOW_QUALITY = 0.8
TENTHS_PER_RAD = degrees(10.0)


class SimPart:
    """Life cycle shared by all simulated parts: opening one takes the clock of the running loop."""

    name = "simulated part"

    def __init__(self, world: World) -> None:
        self._world = world

    async def open(self) -> None:
        """Take the clock."""
        self._time = get_running_loop().time

    async def close(self) -> None:
        """Nothing to release."""


class SimCompass(SimPart):
    """A compass with noise on bearing and tilt, quantised to 0.1 degrees as the CMPS14's 16-bit registers are."""

    name = "simulated compass"

    def __init__(self, world: World, streams: Streams) -> None:
        super().__init__(world)
        self._noise_tenths = streams.normal("compass.heading", COMPASS_NOISE_DEG * 10.0)
        self._tilt_noise_tenths = streams.normal("compass.tilt", TILT_NOISE_DEG * 10.0)

    async def read(self) -> CompassReading:
        """Return heading and tilt now."""
        world, tilt_noise_tenths = self._world, self._tilt_noise_tenths
        t_s = self._time()
        world.advance_to(t_s)
        return CompassReading(
            t_s,
            round(world.heading_rad * TENTHS_PER_RAD + self._noise_tenths()) % 3600 / 10.0,
            round(world.pitch_deg * 10.0 + tilt_noise_tenths()) / 10.0,
            round(world.roll_deg * 10.0 + tilt_noise_tenths()) / 10.0,
            3,
        )


class SimFlow(SimPart):
    """An optical flow sensor: displacement since the last read, in counts."""

    name = "simulated optical flow"

    def __init__(self, world: World, streams: Streams) -> None:
        super().__init__(world)
        self._noise = streams.normal("flow", 1.0)
        self._last_m = 0.0

    async def read(self) -> MotionReading:
        """Return the displacement since the previous read."""
        world, noise = self._world, self._noise
        t_s = self._time()
        world.advance_to(t_s)
        signed_m = world.forward_m - world.reverse_m
        counts, self._last_m = (signed_m - self._last_m) / FLOW_M_PER_COUNT, signed_m
        forward = round(counts + (FLOW_NOISE_COUNTS + FLOW_NOISE_SHARE * abs(counts)) * noise())
        right = round(FLOW_NOISE_COUNTS * noise())
        return MotionReading(t_s, forward * FLOW_M_PER_COUNT, right * FLOW_M_PER_COUNT, FLOW_QUALITY)


class SimBumper(SimPart):
    """A bumper all around that also feels along which bearing the touched obstacle lies."""

    name = "simulated bumper"

    async def read(self) -> ContactReading:
        """Return what touches the body now."""
        t_s = self._time()
        self._world.advance_to(t_s)
        touch = self._world.touch
        if touch is None:
            return ContactReading(t_s, (), None)
        return ContactReading(t_s, touch.sides, touch.obstacle.axis_deg)


class SimMotors(SimPart):
    """Both wheel sides; what is commanded is applied from the world's next step on."""

    name = "simulated motors"

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply a command."""
        self._world.advance_to(self._time())
        self._world.command(command.left, command.right)
        return command

    async def stop(self) -> None:
        """Stop both sides."""
        self._world.command(*STOP)

    async def health(self) -> MotorHealth:
        """Return a full battery and no faults."""
        return MotorHealth(12.6, ())
