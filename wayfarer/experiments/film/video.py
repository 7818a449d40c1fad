"""Renders a trial's footage and writes it as a film."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import av
import numpy as np
from PIL import Image

from wayfarer.errors import BadInput
from wayfarer.experiments.film import screen
from wayfarer.experiments.film.camera import views
from wayfarer.experiments.film.caption import Caption, CaptionText
from wayfarer.experiments.film.footage import Footage
from wayfarer.experiments.film.scenery import Scenery
from wayfarer.experiments.film.tyre_marks import add_bars, bars_of
from wayfarer.files.atomic_file import atomic_file
from wayfarer.simhal.world.collision import obstacles_of

DRAWN = (960, 540)
BEFORE_S, AFTER_S = 1.0, 1.5  # of the film, before the rover starts and after the trial has ended


class FilmFormat(NamedTuple):
    """A kind of file: its pictures' size and rate, and how they are written."""

    size: tuple[int, int]
    frames_s: int
    container: str
    codec: str
    options: dict[str, str]
    container_options: dict[str, str]


# MP4 plays in any browser; WebP also plays inside a page such as README.md, and is a tenth of the size.
KINDS = {
    ".mp4": FilmFormat(DRAWN, 25, "mp4", "libx264", {"crf": "21", "preset": "medium"}, {"movflags": "faststart"}),
    ".webp": FilmFormat(
        (560, 315), 12, "webp", "libwebp_anim", {"quality": "42", "compression_level": "4"}, {"loop": "0"}
    ),
}


class Film:
    """A file that a film is written to."""

    def __init__(self, draft: Path, kind: FilmFormat) -> None:
        self._draft, self._kind = draft, kind

    def show(self, footage: Footage, speed: float, done: Callable[[float], None]) -> None:
        """Draw and write all pictures.

        Args:
            footage: of the trial.
            speed: how much faster than the trial the film runs.
            done: is told now and then which share of the pictures is there.
        """
        frames_s = self._kind.frames_s
        times_s = _times_s(footage, speed, frames_s)
        with av.open(str(self._draft), "w", format=self._kind.container, options=self._kind.container_options) as file:
            stream = file.add_stream(self._kind.codec, frames_s, options=self._kind.options)
            assert isinstance(stream, av.VideoStream)
            stream.width, stream.height, stream.pix_fmt = *self._kind.size, "yuv420p"
            for number, picture in enumerate(self._pictures(footage, _words(footage, speed), times_s)):
                frame = av.VideoFrame.from_ndarray(np.asarray(picture), format="rgb24")
                frame.pts, frame.time_base = number, Fraction(1, frames_s)
                file.mux(stream.encode(frame))
                done((number + 1) / len(times_s))
            file.mux(stream.encode())

    def _pictures(self, footage: Footage, words: CaptionText, times_s: list[float]) -> Iterator[Image.Image]:
        spec, world = footage.spec, footage.world
        shots = [footage.at(t_s) for t_s in times_s]
        scenery = Scenery(spec.forest, world, *DRAWN)
        bars = bars_of(footage.shots, world.body)
        caption = Caption(spec.forest, words, self._kind.size[1])
        joints = np.array([shot.joints for shot in shots])
        seen_from = views(joints, obstacles_of(spec.forest), world.body.length_m, self._kind.frames_s)
        with closing(screen.Screen(scenery, *DRAWN)) as painter:
            for shot, t_s, view in zip(shots, times_s, seen_from, strict=True):
                painter.place(shot.joints, view)
                add_bars(painter.scene, bars, bars.until(shot.t_s, shot.joints), world.body)
                picture = Image.fromarray(painter.draw()).resize(self._kind.size, Image.Resampling.LANCZOS)
                caption.write(picture, shot, over=t_s > footage.ends_s)
                yield picture


def _words(footage: Footage, speed: float) -> CaptionText:
    spec, terrain = footage.spec, footage.world.terrain
    title = f"{spec.rover.name}, {spec.algorithm}, friction {terrain.friction:.2g}"
    return CaptionText(title if speed == 1.0 else f"{title}, {speed:g} x", footage.outcome.replace("_", " ").upper())


def _times_s(footage: Footage, speed: float, frames_s: int) -> list[float]:
    """Return the moment of the trial that each picture shows."""
    first_s, last_s = footage.begins_s - BEFORE_S * speed, footage.ends_s + AFTER_S * speed
    return [first_s + number * speed / frames_s for number in range(round((last_s - first_s) / speed * frames_s))]


@contextmanager
def film(path: Path) -> Iterator[Film]:
    """Give a film to fill; the file is there once it is whole, and what was there stays if anything fails.

    Raises:
        BadInput: its ending is of no known kind, it cannot be written, or the system cannot draw.
    """
    kind = KINDS.get(path.suffix.lower())
    if kind is None:
        raise BadInput(f"--video {path}: expected a name that ends in {' or '.join(KINDS)}")
    try:
        with atomic_file(path, follow_symlink=True) as draft, screen.opengl(*DRAWN):
            # FFmpeg opens its output by name, for MP4 twice; this name is that of the open draft (proc(5)).
            yield Film(Path(f"/proc/self/fd/{draft.fileno()}"), kind)
    except OSError as error:
        raise BadInput(f"--video {path} cannot be written: {error.strerror or error}") from error
