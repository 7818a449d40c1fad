"""Renders a trial's footage and writes it as a film."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import NamedTuple

import av
import numpy as np
from PIL import Image
from rich.console import Console
from rich.progress import track

from wayfarer.errors import BadInput
from wayfarer.experiments.film import screen
from wayfarer.experiments.film.camera import views
from wayfarer.experiments.film.caption import Caption
from wayfarer.experiments.film.footage import Footage
from wayfarer.experiments.film.scenery import scenery_of
from wayfarer.files import atomic_file
from wayfarer.simhal.world.collision import obstacles_of

DRAWN = (960, 540)
BEFORE_S, AFTER_S = 1.0, 1.5  # of the film, before the rover starts and after the trial has ended


class FilmFormat(NamedTuple):
    """A kind of file: its pictures' size and rate, and how they are written."""

    size: tuple[int, int]
    frames_s: int
    codec: str
    options: dict[str, str]
    container_options: dict[str, str]


# MP4 plays in any browser; WebP also plays inside a page such as README.md, and is a tenth of the size.
FORMATS = {
    ".mp4": FilmFormat(DRAWN, 25, "libx264", {"crf": "21", "preset": "medium"}, {"movflags": "faststart"}),
    ".webp": FilmFormat((560, 315), 12, "libwebp_anim", {"quality": "42", "compression_level": "4"}, {"loop": "0"}),
}


@contextmanager
def film(path: Path) -> Iterator[Callable[[Footage, float, Console], None]]:
    """Open a film and give what draws it: from footage, so many times faster than the trial, progress on a console.

    The file is there once it is whole, and what was there stays if anything fails.

    Raises:
        BadInput: its ending is of no known format, it cannot be written, or the system cannot draw.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise BadInput(f"--video {path}: expected a name that ends in {' or '.join(FORMATS)}")
    try:
        with atomic_file(path, follow_symlink=True) as draft, screen.opengl(*DRAWN):
            # FFmpeg opens its output by name, for MP4 twice; this name is that of the open draft (proc(5)).
            yield partial(_draw, f"/proc/self/fd/{draft.fileno()}", ending)
    except OSError as error:
        raise BadInput(f"--video {path} cannot be written: {error.strerror or error}") from error


def _draw(name: str, ending: str, footage: Footage, speed: float, console: Console) -> None:
    written = FORMATS[ending]
    times_s, hidden = _times_s(footage, speed, written.frames_s), not console.is_terminal
    pictures = _pictures(footage, speed, times_s, written)
    with av.open(name, "w", format=ending.removeprefix("."), options=written.container_options) as file:
        stream = file.add_stream(written.codec, written.frames_s, options=written.options)
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt = *written.size, "yuv420p"
        shown = track(pictures, "pictures", len(times_s), console=console, transient=True, disable=hidden)
        for number, picture in enumerate(shown):
            frame = av.VideoFrame.from_ndarray(np.asarray(picture), format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, written.frames_s)
            file.mux(stream.encode(frame))
        file.mux(stream.encode())


def _times_s(footage: Footage, speed: float, frames_s: int) -> list[float]:
    """Return the moment of the trial that each picture shows."""
    first_s, last_s = footage.begins_s - BEFORE_S * speed, footage.ends_s + AFTER_S * speed
    return [first_s + number * speed / frames_s for number in range(round((last_s - first_s) / speed * frames_s))]


def _pictures(footage: Footage, speed: float, times_s: list[float], written: FilmFormat) -> Iterator[Image.Image]:
    spec, world = footage.spec, footage.world
    ticks = footage.at(times_s)
    caption = Caption(footage, speed, written.size[1])
    joints = np.array([tick.joints for tick in ticks])
    seen_from = views(joints, obstacles_of(spec.forest), world.body.length_m, written.frames_s)
    with closing(screen.Screen(scenery_of(spec.forest, world, footage.ticks), *DRAWN)) as painter:
        for tick, t_s, view in zip(ticks, times_s, seen_from, strict=True):
            picture = Image.fromarray(painter.draw(tick, view)).resize(written.size, Image.Resampling.LANCZOS)
            caption.write(picture, tick, over=t_s > footage.ends_s)
            yield picture
