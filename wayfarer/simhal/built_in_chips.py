"""The simulated chips of the built-in drivers: which chip, with which settings, on which bus.

Sensors are mounted as the rover file says, so that the driver's settings undo it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wayfarer.drivers import bno055, cmps14, gpio_motors, pmw3901, roboclaw_board, sabertooth, thunderborg
from wayfarer.drivers.bno055 import BNO055Settings
from wayfarer.drivers.camera_motion import CameraMotionSettings
from wayfarer.drivers.cmps14 import CMPS14Settings
from wayfarer.drivers.encoders import EncodersSettings
from wayfarer.drivers.gpio_motors import GpioMotorsSettings
from wayfarer.drivers.pmw3901 import PMW3901Settings
from wayfarer.drivers.roboclaw import RoboClawSettings
from wayfarer.drivers.roboclaw_wheels import RoboClawWheelsSettings
from wayfarer.drivers.sabertooth import SabertoothSettings
from wayfarer.drivers.thunderborg import ThunderBorgSettings
from wayfarer.simhal.chip_wiring import ChipWiring, SimulatedChip
from wayfarer.simhal.chips.bno055 import BNO055Chip
from wayfarer.simhal.chips.cmps14 import CMPS14Chip
from wayfarer.simhal.chips.encoders import QuadratureEncoders
from wayfarer.simhal.chips.h_bridges import HBridgesChip
from wayfarer.simhal.chips.motor_boards import SabertoothChip, ThunderBorgChip
from wayfarer.simhal.chips.pmw3901 import PMW3901Chip
from wayfarer.simhal.chips.roboclaw import Encoders, RoboClawChip
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FlowSensorModel, GroundCamera, HeadingSensorModel
from wayfarer.simhal.world.simulated_world import SimulatedWorld

GROUND_M_PER_PIXEL = 0.0015  # of the simulated camera, if the rover file gives none


class MountedCompass(HeadingSensorModel):
    """What a compass feels that is mounted as the rover file says: the driver's settings, undone."""

    def __init__(
        self, world: SimulatedWorld, streams: RandomStreams, settings: CMPS14Settings | BNO055Settings
    ) -> None:
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


def _attach_bno055(settings: BNO055Settings, wiring: ChipWiring) -> None:
    chip = BNO055Chip(MountedCompass(wiring.world, wiring.streams, settings), wiring.sense_clock)
    if settings.port:
        wiring.buses.serial(settings.port).attach(chip)
    else:
        wiring.buses.i2c(settings.bus).attach(settings.address, chip)


def mounted(settings: PMW3901Settings) -> Callable[[int, int], tuple[int, int]]:
    """Return the flow chip's x and y for a displacement forward and right, mounted as the rover file says."""
    forward_is_x = settings.forward[1] == "x"
    forward_sign, right_sign = (1 if axis[0] == "+" else -1 for axis in (settings.forward, settings.right))

    def turned(forward: int, right: int) -> tuple[int, int]:
        forward, right = forward * forward_sign, right * right_sign
        return (forward, right) if forward_is_x else (right, forward)

    return turned


def _attach_cmps14(settings: CMPS14Settings, wiring: ChipWiring) -> None:
    chip = CMPS14Chip(MountedCompass(wiring.world, wiring.streams, settings), wiring.sense_clock)
    wiring.buses.i2c(settings.bus).attach(settings.address, chip)


def _attach_pmw3901(settings: PMW3901Settings, wiring: ChipWiring) -> None:
    sense = FlowSensorModel(wiring.world, wiring.streams, settings.m_per_count)
    wiring.buses.spi(settings.bus).attach(PMW3901Chip(sense, wiring.sense_clock, mounting=mounted(settings)))


def _attach_camera(settings: CameraMotionSettings, wiring: ChipWiring) -> None:
    m_per_pixel = settings.m_per_pixel or GROUND_M_PER_PIXEL
    wiring.buses.cameras[settings.camera] = GroundCamera(wiring.world, wiring.streams, m_per_pixel).render


def _attach_thunderborg(settings: ThunderBorgSettings, wiring: ChipWiring) -> None:
    chip = ThunderBorgChip(wiring.world, wiring.clock, left=settings.left, **_motors(settings, thunderborg.FULL_LEVEL))
    wiring.boards.append(chip)
    wiring.buses.i2c(settings.bus).attach(settings.address, chip)


def _attach_sabertooth(settings: SabertoothSettings, wiring: ChipWiring) -> None:
    motors = {**_motors(settings, sabertooth.FULL_LEVEL), "left": settings.left, "autobaud": settings.autobaud}
    chip = SabertoothChip(wiring.world, wiring.clock, address=settings.address, **motors)
    wiring.boards.append(chip)
    wiring.buses.serial(settings.port).attach(chip)


def _attach_roboclaw(settings: RoboClawSettings, wiring: ChipWiring) -> None:
    motors = {**_motors(settings, roboclaw_board.FULL_DUTY), "left": settings.left}
    chip = RoboClawChip(wiring.world, wiring.clock, address=settings.address, **motors)
    wiring.boards.append(chip)
    line = wiring.buses.serial(settings.port)
    if isinstance(line.chip, RoboClawChip):  # of its wheels, which came first
        chip.encoders, line.chip = line.chip.encoders, None
    line.attach(chip)


def _attach_roboclaw_wheels(settings: RoboClawWheelsSettings, wiring: ChipWiring) -> None:
    line = wiring.buses.serial(settings.port)
    chip = line.chip
    if not isinstance(chip, RoboClawChip):
        line.attach(chip := RoboClawChip(wiring.world, wiring.clock, address=settings.address))
    if settings.counts_per_m is not None:
        chip.encoders = Encoders(1.0 / settings.counts_per_m, settings.left == 2, *_signs(settings))


def _attach_encoders(settings: EncodersSettings, wiring: ChipWiring) -> None:
    wire = wiring.buses.pins().wire
    encoders = QuadratureEncoders(
        wiring.world,
        ((wire(settings.left_a), wire(settings.left_b)), (wire(settings.right_a), wire(settings.right_b))),
        1.0 / settings.counts_per_m,
        _signs(settings),
        active_low=settings.pull_up,
    )
    wiring.buses.pins().before_read.append(encoders.follow)


def _signs(settings: EncodersSettings | RoboClawWheelsSettings) -> tuple[int, int]:
    return (-1 if settings.reverse_left else 1), (-1 if settings.reverse_right else 1)


def _attach_h_bridges(settings: GpioMotorsSettings, wiring: ChipWiring) -> None:
    wire = wiring.buses.pins().wire
    left, right = ({name: wire(pin) for name, pin in settings.pins(side).items()} for side in ("left", "right"))
    left_enable, right_enable, trigger = (
        None if pin is None else wire(pin) for pin in (settings.left_enable, settings.right_enable, settings.pulse)
    )
    chip = HBridgesChip(
        wiring.world, wiring.clock, left, right,
        left_enable=left_enable, right_enable=right_enable, trigger=trigger, holds_s=settings.deadman_s or 0.0,
        **_motors(settings, gpio_motors.FULL_PERCENT),
    )  # fmt: skip
    wiring.boards.append(chip)


def _motors(
    settings: ThunderBorgSettings | SabertoothSettings | RoboClawSettings | GpioMotorsSettings, full_level: int
) -> dict[str, Any]:
    """Return what all motor boards take; the steps of duty reach up to the highest that the driver allows."""
    return {
        "full_level": full_level * settings.duty_limit,
        "reverse_left": settings.reverse_left,
        "reverse_right": settings.reverse_right,
    }


BNO055 = SimulatedChip(_attach_bno055, lambda _: {"opens_s": bno055.OPEN_S})
CMPS14 = SimulatedChip(_attach_cmps14, lambda _: {"opens_s": cmps14.OPEN_S})
PMW3901 = SimulatedChip(
    _attach_pmw3901, lambda settings: {"m_per_count": settings.m_per_count, "opens_s": pmw3901.OPEN_S}
)
CAMERA = SimulatedChip(_attach_camera)
ENCODERS = SimulatedChip(
    _attach_encoders, lambda settings: {"m_per_count": 1.0 / settings.counts_per_m, "current": False}
)
ROBOCLAW = SimulatedChip(_attach_roboclaw, lambda settings: {"steps": roboclaw_board.FULL_DUTY * settings.duty_limit})
ROBOCLAW_WHEELS = SimulatedChip(
    _attach_roboclaw_wheels,
    lambda settings: {
        "m_per_count": 1.0 / settings.counts_per_m if settings.counts_per_m else 0.0,
        "way": settings.counts_per_m is not None,
        "a_per_step": roboclaw_board.A_PER_STEP,
    },
)
SABERTOOTH = SimulatedChip(_attach_sabertooth, lambda settings: {"steps": sabertooth.FULL_LEVEL * settings.duty_limit})
THUNDERBORG = SimulatedChip(
    _attach_thunderborg, lambda settings: {"steps": thunderborg.FULL_LEVEL * settings.duty_limit}
)
GPIO_MOTORS = SimulatedChip(
    _attach_h_bridges, lambda settings: {"steps": gpio_motors.FULL_PERCENT * settings.duty_limit}
)
NO_CHIP = SimulatedChip(lambda _settings, _wiring: None)  # lights at a pin, or on the motor board
