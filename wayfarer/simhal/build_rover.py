"""Builds a simulated rover over one world, at device depth or at bus depth.

*Device depth*: simulated parts implement the driver protocols directly; fast. *Bus depth*: the real drivers, over fake
buses that hold register-accurate chips. Both feel the same senses, in the same quanta, and so decide the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from importlib.util import find_spec
from typing import Any

from wayfarer.config.factory import assemble
from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.drivers import cmps14, pmw3901, sabertooth, thunderborg
from wayfarer.drivers.camera_motion import CameraMotion, CameraMotionSettings
from wayfarer.drivers.cmps14 import CMPS14, CMPS14Settings
from wayfarer.drivers.pmw3901 import PMW3901, PMW3901Settings
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.drivers.thunderborg_light import ThunderBorgLight
from wayfarer.errors import BadConfig
from wayfarer.hal import Rover
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.cmps14 import CMPS14Chip
from wayfarer.simhal.chips.pmw3901 import PMW3901Chip
from wayfarer.simhal.chips.sabertooth import SabertoothChip
from wayfarer.simhal.chips.thunderborg import ThunderBorgChip
from wayfarer.simhal.parts import SimBumper, SimCompass, SimFlow, SimMotors, SimReceiver
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FlowSensorModel, HeadingSensorModel
from wayfarer.simhal.world.simulated_world import SimulatedWorld

GROUND_M_PER_PIXEL = 0.0015  # of the simulated camera, where the rover file gives none

Clock = Callable[[], float]


class Depth(StrEnum):
    """The depth of the simulation: simulated parts, or simulated chips under the real drivers."""

    DEVICE = "device"
    BUS = "bus"


def build(
    depth: Depth,
    world: SimulatedWorld,
    streams: RandomStreams,
    config: RoverConfig,
    clock: Clock,
    buses: FakeBuses | None = None,
) -> Rover:
    """Return a simulated rover; at bus depth on these buses, or else on new ones.

    Raises:
        BadConfig: at bus depth, a part has no simulated chip.
    """
    if depth is Depth.BUS:
        return bus_depth(world, streams, config, clock, buses or FakeBuses())
    return device_depth(world, streams, config)


def device_depth(world: SimulatedWorld, streams: RandomStreams, config: RoverConfig) -> Rover:
    """Return a rover whose parts implement the driver protocols directly; parts in the file give their quanta."""
    settings = {part: part_settings(part, table)[1] for part, table in config.parts.items()}
    compass, flow = settings.get("compass"), settings.get("motion")
    compass_opens_s = cmps14.OPEN_S if isinstance(compass, CMPS14Settings) else 0.0
    of_the_chip = (flow.m_per_count, pmw3901.OPEN_S) if isinstance(flow, PMW3901Settings) else ()
    return Rover(
        compass=SimCompass(world, streams, compass_opens_s),
        motors=SimMotors(world, _steps(settings.get("motors"))),
        motion=SimFlow(world, streams, *of_the_chip),
        contact=SimBumper(world) if _has_bumper(config) else None,
        position=_receiver(world, streams, config),
    )


def bus_depth(
    world: SimulatedWorld, streams: RandomStreams, config: RoverConfig, clock: Clock, buses: FakeBuses
) -> Rover:
    """Return the rover of the file with its real drivers, each over a simulated chip.

    A bumper is a switch, not a chip, and a receiver speaks through a socket: both are simulated as at device depth, and
    the bumper also feels the obstacle's bearing. What shines at a GPIO pin is left out.
    """
    wiring = ChipWiring(world, streams, clock, buses)
    world.tick_chips = wiring.tick
    on_a_bus = _on_a_bus(config)
    for part, table in list(on_a_bus.items()):
        driver, settings = part_settings(part, table)
        if driver not in wiring.chips:
            if part == "light":
                del on_a_bus[part]
                continue
            lacks = f"rover '{config.name}': no simulated chip for '{table['driver']}'; use --depth device"
            raise BadConfig(f"key 'parts.{part}.driver': {lacks}")
        wiring.chips[driver](settings)
    rover = assemble(config.model_copy(update={"parts": on_a_bus}), buses)
    contact = SimBumper(world) if _has_bumper(config) else None
    return replace(rover, contact=contact, position=_receiver(world, streams, config))


def missing_package(config: RoverConfig, depth: Depth) -> str | None:
    """Say which package a rover's real drivers import that is not installed, and how to get it.

    A driver's ``packages`` are such modules, each with how to get it. None where all are there, and at device depth,
    which has no drivers.
    """
    for part, table in _on_a_bus(config).items() if depth is Depth.BUS else ():
        for module, remedy in getattr(part_settings(part, table)[0], "packages", {}).items():
            if find_spec(module) is None:
                return f"rover '{config.name}' needs {module} for [parts.{part}], which is not installed: {remedy}"
    return None


def _on_a_bus(config: RoverConfig) -> dict[str, dict[str, Any]]:
    """Return the parts whose real drivers run at bus depth."""
    return {part: table for part, table in config.parts.items() if part not in {"contact", "position"}}


class ChipWiring:
    """Puts the chip that a driver wants where its settings say that it is; ``chips`` has the chips by driver.

    ``tick`` lets the motor boards' own deadmen act, as they do without being asked. Whatever moves the world on must
    call it first; the senses' clock does.
    """

    def __init__(self, world: SimulatedWorld, streams: RandomStreams, clock: Clock, buses: FakeBuses) -> None:
        self._world, self._streams, self._clock, self._buses = world, streams, clock, buses
        self._boards: list[ThunderBorgChip | SabertoothChip] = []
        self.chips: dict[Any, Callable[[Any], None]] = {
            CMPS14: self._cmps14,
            PMW3901: self._pmw3901,
            CameraMotion: self._camera,
            ThunderBorg: self._thunderborg,
            ThunderBorgLight: lambda _: None,  # it is on the motor board
            Sabertooth: self._sabertooth,
        }

    def tick(self) -> None:
        """Let deadmen trip whose time has come."""
        for board in self._boards:
            board.tick()

    def _sense_clock(self) -> float:
        self.tick()
        return self._clock()

    def _cmps14(self, settings: CMPS14Settings) -> None:
        chip = CMPS14Chip(MountedCompass(self._world, self._streams, settings), self._sense_clock)
        self._buses.i2c(settings.bus).attach(settings.address, chip)

    def _pmw3901(self, settings: PMW3901Settings) -> None:
        sense = FlowSensorModel(self._world, self._streams, settings.m_per_count)
        self._buses.spi(settings.bus).chip = PMW3901Chip(sense, self._sense_clock, mounting=mounted(settings))

    def _camera(self, settings: CameraMotionSettings) -> None:
        from wayfarer.simhal.world.ground_camera import GroundCamera

        m_per_pixel = settings.m_per_pixel or GROUND_M_PER_PIXEL
        self._buses.cameras[settings.camera] = GroundCamera(self._world, self._streams, m_per_pixel).render

    def _thunderborg(self, settings: ThunderBorgSettings) -> None:
        chip = ThunderBorgChip(
            self._world,
            self._clock,
            full_level=_steps(settings),
            left=settings.left,
            reverse_left=settings.reverse_left,
            reverse_right=settings.reverse_right,
        )
        self._boards.append(chip)
        self._buses.i2c(settings.bus).attach(settings.address, chip)

    def _sabertooth(self, settings: SabertoothSettings) -> None:
        chip = SabertoothChip(
            self._world,
            self._clock,
            address=settings.address,
            full_level=_steps(settings),
            left=settings.left,
            reverse_left=settings.reverse_left,
            reverse_right=settings.reverse_right,
        )
        self._boards.append(chip)
        self._buses.serial(settings.port).chip = chip


class MountedCompass(HeadingSensorModel):
    """What a compass feels that is mounted as the rover file says: the driver's settings, undone."""

    def __init__(self, world: SimulatedWorld, streams: RandomStreams, settings: CMPS14Settings) -> None:
        super().__init__(world, streams)
        self._settings = settings

    def sample(self, t_s: float) -> tuple[int, int, int]:
        """Return heading, pitch and roll in the part's own frame, in tenths of a degree."""
        heading, pitch, roll = super().sample(t_s)
        settings = self._settings
        pitch = -pitch if settings.reverse_pitch else pitch
        roll = -roll if settings.reverse_roll else roll
        if settings.swap_pitch_roll:
            pitch, roll = roll, pitch
        return (heading - round(settings.heading_offset_deg * 10.0)) % 3600, pitch, roll


def mounted(settings: PMW3901Settings) -> Callable[[int, int], tuple[int, int]]:
    """Return the flow chip's x and y for a displacement forward and right, mounted as the rover file says."""

    def turned(forward: int, right: int) -> tuple[int, int]:
        counts = {}
        for axis, along in ((settings.forward, forward), (settings.right, right)):
            counts[axis[1]] = along if axis[0] == "+" else -along
        return counts["x"], counts["y"]

    return turned


def _steps(settings: Any) -> float:
    """Return how many steps of duty a motor board knows up to the highest that its driver allows."""
    if isinstance(settings, ThunderBorgSettings):
        return thunderborg.FULL_LEVEL * settings.duty_limit
    if isinstance(settings, SabertoothSettings):
        return sabertooth.FULL_LEVEL * settings.duty_limit
    return float(sabertooth.FULL_LEVEL)


def _receiver(world: SimulatedWorld, streams: RandomStreams, config: RoverConfig) -> SimReceiver | None:
    return SimReceiver(world, streams) if "position" in config.parts else None


def _has_bumper(config: RoverConfig) -> bool:
    """Tell whether the rover of the file has one; a rover without any parts in its file has all that is simulated."""
    return "contact" in config.parts or not config.parts
