"""A camera as motion sensor, in one of two modes.

``displacement``: the camera looks straight down. Successive pictures are registered to each other by phase correlation,
and the shift is scaled to metres. Between two pictures the rover may drive at most a third, better a tenth, of the
ground that a picture shows: mount the camera high enough, or increase its rate. A turn rotates the picture, which
lowers the quality.

``difference``: the camera looks in any direction, for example ahead. The difference of successive pictures shows that
the rover moves, but not in which direction: readings are not ``signed``. This mode needs two numbers from a calibration
on the ground to be driven.

Pictures that are black, flat or identical to the last bit are not evidence, and the quality of the reading is 0: a real
sensor always has noise. Dirt on the lens that is sharp and dark enough does not move in the picture, like the ground
before a stuck rover. Set a fixed exposure if the light allows it; a short one keeps the picture sharp while the rover
moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

from annotated_types import Interval, MultipleOf

from wayfarer.drivers.buses import Buses
from wayfarer.errors import BadReading, NotInstalled, NotResponding, how_to_install
from wayfarer.hal import MotionReading
from wayfarer.setting_ranges import Hertz, MetresPerSecond

if TYPE_CHECKING:
    import numpy
    from numpy.typing import NDArray

Pixels = Annotated[int, Interval(ge=32, le=640), MultipleOf(2)]  # libcamera wants even sizes
GreyLevels = Annotated[float, Interval(ge=0, le=255)]

# The image axis that points ahead, as (x to the right, y down).
AXES = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}


@dataclass(frozen=True, slots=True)
class CameraMotionSettings:
    """Which camera, how it looks, and what its pictures mean."""

    camera: Literal["0", "1", "2", "3"] = "0"
    """Its number among the connected ones, as text."""
    width: Pixels = 160
    """Width of a picture in pixels, even. Registering 160 x 120 takes 0.5 ms on a desk computer."""
    height: Pixels = 120
    """Height of a picture in pixels, even."""
    rate_hz: Hertz = 20.0
    """Pictures per second."""
    exposure_us: Annotated[int, Interval(ge=10, le=1_000_000)] | None = None
    """Fixed exposure, so that a change of light is not taken for motion; without a value it is automatic."""
    method: Literal["displacement", "difference"] = "displacement"
    """``displacement`` for a camera that looks straight down, ``difference`` for one that looks in any direction."""
    forward: Literal["+x", "-x", "+y", "-y"] = "-y"
    """For displacement, the image axis that points ahead; x runs to the right of the picture and y down. ``-y`` is a
    camera whose picture has the rover's front at its top."""
    m_per_pixel: Annotated[float, Interval(ge=1e-4, le=0.1)] | None = None
    """For displacement, the ground that one pixel shows, in m: drive a metre and divide."""
    dark_below: GreyLevels = 15.0
    """A picture with a lower mean grey level, 0 to 255, is not evidence. Chosen by us: a covered lens must be below
    it, the darkest ground to be driven must not."""
    flat_below: GreyLevels = 5.0
    """A picture whose standard deviation in grey levels is lower is not evidence; chosen by us, as ``dark_below``."""
    difference_still: GreyLevels | None = None
    """For difference, the mean change of a pixel in grey levels from one picture to the next while standing; ``wayfarer
    calibrate flow`` measures it on your ground."""
    difference_moving: GreyLevels | None = None
    """The same grey levels at ``difference_speed_m_s``, on the ground with the least contrast."""
    difference_speed_m_s: MetresPerSecond = 1.0
    """That speed; choose the cruising speed. A higher speed is measured as this one."""

    def __post_init__(self) -> None:
        if self.method == "displacement":
            if self.m_per_pixel is None:
                raise ValueError("method 'displacement' needs m_per_pixel")
        elif self.difference_still is None or self.difference_moving is None:
            raise ValueError("method 'difference' needs difference_still and difference_moving")
        elif self.difference_still >= self.difference_moving:
            raise ValueError("difference_still must be less than difference_moving")


class Picture(NamedTuple):
    """A frame for comparison: ``relief`` is luma minus its mean, so that brightness does not matter.

    ``tells`` says whether it is evidence: not too dark, and not too flat.
    """

    t_s: float
    luma: NDArray[numpy.uint8]
    relief: NDArray[numpy.float32]
    tells: bool


class CameraMotion:
    """The camera as a ``hal.MotionSensor``."""

    part: ClassVar[str] = "motion"
    packages: ClassVar[Mapping[str, str]] = {"cv2": how_to_install("camera")}
    Settings = CameraMotionSettings

    def __init__(self, settings: CameraMotionSettings, buses: Buses) -> None:
        self.name = f"camera {settings.camera} as motion sensor"
        self._settings = settings
        self._camera = buses.camera(
            settings.camera,
            width=settings.width,
            height=settings.height,
            rate_hz=settings.rate_hz,
            exposure_us=settings.exposure_us,
        )
        self._last: Picture | None = None

    async def open(self) -> None:
        """Take a first picture.

        Raises:
            NotResponding: OpenCV is missing, or no camera, or no picture comes.
            BadReading: a picture of another size, or not of grey bytes.
        """
        try:
            self._cv2: Any = import_module("cv2")
        except ImportError as error:
            raise NotInstalled(self.name, error, self.packages) from None
        self._window = self._cv2.createHanningWindow((self._settings.width, self._settings.height), self._cv2.CV_32F)
        self._last = await self._picture()

    async def close(self) -> None:
        """Forget the last picture; the camera belongs to the buses."""
        self._last = None

    async def read(self) -> MotionReading:
        """Return the displacement since the previous picture; waits for a picture, not for motion.

        Raises:
            NotResponding: no picture comes, or this is not open.
            BadReading: a picture of another size, or not of grey bytes.
        """
        last, now = await self._next()
        displaces = self._settings.method == "displacement"
        if not (last.tells and now.tells) or now.t_s <= last.t_s or (now.luma == last.luma).all():
            return MotionReading(now.t_s, 0.0, 0.0, 0.0, signed=displaces)
        return self._displacement(last, now) if displaces else self._difference(last, now)

    async def change(self) -> float:
        """Return by how many grey levels a pixel differs, on average, from the previous picture; raises as ``read``.

        For calibration.
        """
        return _change(*await self._next())

    async def _next(self) -> tuple[Picture, Picture]:
        """Return the previous picture and the next one, which then becomes the previous one."""
        if self._last is None:
            raise NotResponding(f"{self.name}: not open")
        last, self._last = self._last, await self._picture()
        return last, self._last

    async def _picture(self) -> Picture:
        t_s, luma = await self._camera.frame()
        settings = self._settings
        if luma.shape != (settings.height, settings.width) or luma.dtype != "uint8":
            size = " x ".join(map(str, reversed(luma.shape)))
            raise BadReading(
                f"{self.name}: a picture of {size} {luma.dtype}, not {settings.width} x {settings.height} uint8; "
                "does another program use the camera?"
            )
        mean = luma.mean()
        tells = bool(mean >= settings.dark_below and luma.std() >= settings.flat_below)
        return Picture(t_s, luma, (luma - mean).astype("float32"), tells)

    def _displacement(self, last: Picture, now: Picture) -> MotionReading:
        """Register two pictures. The quality is the height of the correlation's peak, 1 for equal pictures."""
        (x, y), response = self._cv2.phaseCorrelate(last.relief, now.relief, self._window)
        ahead_x, ahead_y = AXES[self._settings.forward]
        # The picture moves opposite to the rover; right is a quarter turn clockwise from ahead, also in the picture.
        forward, right = -(x * ahead_x + y * ahead_y), x * ahead_y - y * ahead_x
        m_per_pixel = self._settings.m_per_pixel
        assert m_per_pixel is not None  # the settings saw to that
        return MotionReading(now.t_s, forward * m_per_pixel, right * m_per_pixel, min(1.0, max(0.0, response)))

    def _difference(self, last: Picture, now: Picture) -> MotionReading:
        """Return the motion as a share of the calibrated speed: the same share as that of the picture's change."""
        still, moving = self._settings.difference_still, self._settings.difference_moving
        assert still is not None and moving is not None  # the settings saw to that
        share = min(1.0, max(0.0, (_change(last, now) - still) / (moving - still)))
        forward_m = share * self._settings.difference_speed_m_s * (now.t_s - last.t_s)
        return MotionReading(now.t_s, forward_m, 0.0, 1.0, signed=False)


def _change(last: Picture, now: Picture) -> float:
    """Return the mean change of a pixel, in grey levels."""
    return float(abs(now.relief - last.relief).mean())
